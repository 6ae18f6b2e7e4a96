package org.camssf.photo

import org.camssf.Rules
import org.camssf.UnitDiffers
import org.camssf.short
import kotlin.math.abs
import kotlin.math.max

/**
 * The physical camera and lens that took a photo, in addition to make and model; "" or null if unknown.
 *
 * @property id ID of the camera used, on a phone with several cameras.
 * @property serial serial number of the body; not written to results or messages.
 * @property lens model of the lens.
 * @property focalLength focal length, mm.
 * @property aperture the f-number.
 * @property activeArea of the sensor, in samples of the stored picture.
 */
public class PhysicalCamera @JvmOverloads constructor(
    public val id: String = "",
    public val serial: String = "",
    public val lens: String = "",
    public val focalLength: Double? = null,
    public val aperture: Double? = null,
    public val activeArea: Region? = null,
) {
    private fun parts() = listOf(id, serial, lens, focalLength, aperture, activeArea)

    override fun equals(other: Any?): Boolean = other is PhysicalCamera && parts() == other.parts()

    override fun hashCode(): Int = parts().hashCode()

    /** Without the serial number, which belongs in no message. */
    override fun toString(): String =
        "PhysicalCamera(id=$id, lens=$lens, focalLength=$focalLength, aperture=$aperture, activeArea=$activeArea)"

    internal companion object {
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
            if (two.serial.isNotEmpty() && one.serial.isNotEmpty() && two.serial != one.serial) {
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
            throw UnitDiffers(
                "$other was taken by another camera or lens than $chart: ${differ.joinToString("; ")}.",
                "Take all photos of a capture with one physical camera, one lens, one zoom setting and one " +
                    "aperture; on a phone with several cameras name the one that shall take them. " +
                    "Calibrate each of them by itself.",
            )
        }

        private fun apart(there: Double?, here: Double?, words: (String, String) -> String): String? {
            if (there == null || here == null || abs(there - here) <= ALIKE * max(there, here)) return null
            return words(short(there), short(here))
        }

        private fun sides(area: Region) = "${area.top}, ${area.left}, ${area.bottom}, ${area.right}"
    }
}
