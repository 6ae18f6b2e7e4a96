package org.camssf.passport

import org.camssf.InvalidArgument

/**
 * One physical camera; "" and null where nothing is known.
 *
 * @property make as its files name it.
 * @property model likewise.
 * @property cameraId of a phone with several cameras, the one that was used.
 * @property serial of the body.
 * @property lens its model.
 * @property focalLength mm.
 * @property aperture the f-number.
 */
public data class CameraUnit @JvmOverloads constructor(
    public val make: String = "",
    public val model: String = "",
    public val cameraId: String = "",
    public val serial: String = "",
    public val lens: String = "",
    public val focalLength: Double? = null,
    public val aperture: Double? = null,
) {
    /** With make and model of the result where this one is silent; where both speak, they must agree. */
    internal fun filled(make: String, model: String): CameraUnit {
        for ((name, mine, other) in listOf(Triple("make", this.make, make), Triple("model", this.model, model))) {
            if (mine.isNotEmpty() && other.isNotEmpty() && mine != other) {
                throw InvalidArgument(
                    "Another camera by what the result says: $name is '$other' there, not '$mine'.",
                    "Name the unit that the photo was taken with.",
                )
            }
        }
        return copy(make = this.make.ifEmpty { make }, model = this.model.ifEmpty { model })
    }

    internal fun toJson(): String {
        val words = listOf(
            "make" to make, "model" to model, "camera_id" to cameraId, "serial" to serial,
            "lens" to lens,
        )
        val sizes = listOf("focal_length" to focalLength, "aperture" to aperture)
        for ((name, size) in sizes) {
            if (size != null && !(size > 0 && size.isFinite())) {
                throw InvalidArgument("The unit's $name is $size.", "Give a number above 0, or null.")
            }
        }
        return (words.map { (name, value) -> name to Sound.quote(value) } + sizes)
            .joinToString(",", "{", "}") { (name, value) -> "\"$name\":$value" }
    }
}
