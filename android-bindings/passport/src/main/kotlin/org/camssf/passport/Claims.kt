package org.camssf.passport

import org.camssf.PassportInvalid

/** Reads a passport from its payload: checks Python's data/passport.schema.json, and the result by [ResultForm]. */
internal object Claims {
    const val FORMAT = "camssf-passport/1"

    fun read(payload: ByteArray): Passport {
        val text = Parts.text(payload, "payload", Parts.WHAT)
        val places = HashMap<String, IntRange>()
        val claims = Parts.members(text, "payload", Parts.WHAT) { name, place -> places[name] = place }
        for ((name, right) in FORM) {
            if (name == "result" && ResultForm.isRefused(claims[name])) {
                throw PassportInvalid("The passport's result was refused: it is no calibration.", "Calibrate again.")
            }
            if (name !in claims || !right(claims[name])) {
                throw PassportInvalid(
                    "The passport's $name is missing or invalid.",
                    Parts.advice(Parts.WHAT),
                )
            }
        }
        val serials = claims["serials"] as Map<*, *>
        val result = text.substring(places.getValue("result"))
        return Passport(
            id = claims["jti"] as String,
            issued = second(claims["iat"] as Long),
            begins = second(claims["nbf"] as Long),
            ends = second(claims["exp"] as Long),
            unit = unit(claims["unit"] as Map<*, *>),
            captured = claims["captured"] as String,
            chartSerial = serials["chart"] as String,
            lampSerials = (serials["lamps"] as List<*>).map { it as String },
            software = (claims["software"] as Map<*, *>)["version"] as String,
            resultSha256 = claims["result_sha256"] as String,
            result = result,
        )
    }

    private fun unit(of: Map<*, *>) = CameraUnit(
        make = of["make"] as String,
        model = of["model"] as String,
        cameraId = of["camera_id"] as String,
        serial = of["serial"] as String,
        lens = of["lens"] as String,
        focalLength = (of["focal_length"] as Number?)?.toDouble(),
        aperture = (of["aperture"] as Number?)?.toDouble(),
    )

    fun isSecond(value: Any?): Boolean = value is Long && value in 0 until AFTER_ALL

    private fun isSize(value: Any?): Boolean = value == null ||
        (value is Number && value.toDouble().let { it > 0 && it <= Double.MAX_VALUE })

    private fun isUnit(value: Any?): Boolean = value is Map<*, *> &&
        listOf("make", "model", "camera_id", "serial", "lens").all { ResultForm.isText(value[it]) } &&
        listOf("focal_length", "aperture").all { it in value && isSize(value[it]) }

    private fun areSerials(value: Any?): Boolean = value is Map<*, *> && ResultForm.isText(value["chart"]) &&
        (value["lamps"] as? List<*>)?.let { it.size <= 64 && it.all(ResultForm::isText) } ?: false

    private fun isSoftware(value: Any?): Boolean = value is Map<*, *> && ResultForm.isText(value["version"]) &&
        ("name" !in value || ResultForm.isText(value["name"]))

    private val HASH = Regex("[0-9a-f]{64}")
    private val FORM: Map<String, (Any?) -> Boolean> = linkedMapOf(
        "format" to { it == FORMAT },
        "jti" to { it is String && PassportKeys.PASSPORT.matches(it) },
        "iat" to ::isSecond,
        "nbf" to ::isSecond,
        "exp" to ::isSecond,
        "unit" to ::isUnit,
        "captured" to ResultForm::isText,
        "serials" to ::areSerials,
        "software" to ::isSoftware,
        "result_sha256" to { it is String && HASH.matches(it) && it.any { digit -> digit != '0' } },
        "result" to ResultForm::holds,
    )
}
