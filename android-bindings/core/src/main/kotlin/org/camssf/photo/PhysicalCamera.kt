package org.camssf.photo

import org.camssf.Refusal
import org.camssf.Rules
import org.camssf.UnitDiffers
import org.camssf.model.Models
import org.camssf.short
import kotlin.math.abs
import kotlin.math.max

/**
 * The physical camera and lens that took a photo, in addition to make and model; "" or null if unknown.
 *
 * @property id ID of the camera used, on a phone with several cameras.
 * @property serial serial number of the body; not in messages, and in a document only where the app says so.
 * @property lens model of the lens.
 * @property focalLength focal length, mm.
 * @property aperture the f-number.
 * @property activeArea of the sensor, in samples of the stored picture.
 */
public class PhysicalCamera internal constructor(
    public val id: String,
    public val serial: String,
    public val lens: String,
    public val focalLength: Double?,
    public val aperture: Double?,
    public val activeArea: Region?,
    /**
     * 4 hex digits of the hash of maker, model and serial number, which documents hold in its place: of 65,536 units
     * of a model one has the same, so that they tell units apart and lead to none of them.
     */
    internal val serialCheck: String,
) {
    @JvmOverloads
    public constructor(
        id: String = "",
        serial: String = "",
        lens: String = "",
        focalLength: Double? = null,
        aperture: Double? = null,
        activeArea: Region? = null,
    ) : this(id, serial, lens, focalLength, aperture, activeArea, "")

    /** The same camera, a `make` and `model`, with its [serialCheck]. */
    internal fun checked(make: String, model: String): PhysicalCamera {
        if (serial.isEmpty()) return this
        val digits = Models.sha256("camssf unit\n$make\n$model\n$serial".toByteArray()).take(DIGITS)
        return PhysicalCamera(id, serial, lens, focalLength, aperture, activeArea, digits)
    }

    private fun parts() =
        listOf(id, serial, lens, focalLength, aperture, activeArea, serialCheck.takeIf { serial.isEmpty() })

    override fun equals(other: Any?): Boolean = other is PhysicalCamera && parts() == other.parts()

    override fun hashCode(): Int = parts().hashCode()

    /** Without the serial number, which belongs in no message. */
    override fun toString(): String =
        "PhysicalCamera(id=$id, lens=$lens, focalLength=$focalLength, aperture=$aperture, activeArea=$activeArea)"

    internal companion object {
        private const val DIGITS = 4

        /**
         * Relative difference up to which two focal lengths or f-numbers count as equal, because files round them.
         */
        private val ALIKE get() = Rules.shipped.number("patches.alike")

        /**
         * Throws `UnitDiffers` if two photos come from different physical cameras or lenses; unknown values are not
         * compared.
         *
         * @param one camera of the photo called `chart`.
         * @param two camera of the photo called `other`.
         */
        fun check(chart: String, one: PhysicalCamera, other: String, two: PhysicalCamera) {
            val differ = ArrayList<String>()
            for ((word, there, here) in listOf(
                Triple("camera", two.id, one.id),
                Triple("lens", two.lens, one.lens),
            )) {
                if (there.isNotEmpty() && here.isNotEmpty() &&
                    there != here
                ) {
                    differ += "$word '$there' against '$here'"
                }
            }
            val serials = listOf(one.serial to two.serial, one.serialCheck to two.serialCheck)
            if (serials.any { (here, there) -> here.isNotEmpty() && there.isNotEmpty() && here != there }) {
                differ += "another serial number"
            }
            apart(two.focalLength, one.focalLength) { a, b ->
                "focal length $a mm against $b mm"
            }?.let { differ += it }
            apart(two.aperture, one.aperture) { a, b -> "aperture f/$a against f/$b" }?.let { differ += it }
            val (place, area) = two.activeArea to one.activeArea
            if (place != null && area != null && place != area) {
                differ += "active area ${sides(place)} against ${sides(area)}"
            }
            if (differ.isEmpty()) return
            throw Refusal.of(
                "unit_differs.photos", "file" to other, "other" to chart, "differences" to differ.joinToString("; "),
            )
        }

        private fun apart(there: Double?, here: Double?, words: (String, String) -> String): String? {
            if (there == null || here == null || abs(there - here) <= ALIKE * max(there, here)) return null
            return words(short(there), short(here))
        }

        private fun sides(area: Region) = "${area.top}, ${area.left}, ${area.bottom}, ${area.right}"
    }
}
