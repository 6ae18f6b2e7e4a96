package org.camssf.passport

import org.camssf.InvalidArgument
import org.camssf.photo.Photo

/**
 * One physical camera; "" and null where unknown.
 *
 * @property make manufacturer, as in its files.
 * @property model model, as in its files.
 * @property cameraId id of the camera that was used, for a phone with several cameras.
 * @property serial serial number of the body.
 * @property lens model of the lens.
 * @property focalLength mm.
 * @property aperture f-number.
 */
public class CameraUnit @JvmOverloads constructor(
    public val make: String = "",
    public val model: String = "",
    public val cameraId: String = "",
    public val serial: String = "",
    public val lens: String = "",
    public val focalLength: Double? = null,
    public val aperture: Double? = null,
) {
    private fun parts() = listOf(make, model, cameraId, serial, lens, focalLength, aperture)

    override fun equals(other: Any?): Boolean = other is CameraUnit && parts() == other.parts()

    override fun hashCode(): Int = parts().hashCode()

    override fun toString(): String = "CameraUnit(make=$make, model=$model, cameraId=$cameraId, serial=$serial, " +
        "lens=$lens, focalLength=$focalLength, aperture=$aperture)"

    /**
     * This unit, with unknown fields taken from `other`.
     *
     * @param source name of the other's source, for messages.
     * @throws InvalidArgument a field is known in both and differs.
     */
    internal fun agreed(other: CameraUnit, source: String): CameraUnit {
        for ((mine, theirs) in stated().zip(other.stated())) {
            val (name, own) = mine
            val there = theirs.second
            if (own != null && there != null && own != there) {
                throw InvalidArgument(
                    "$source names another camera: $name is ${spoken(there)} there, not ${spoken(own)}.",
                    "Name the unit that the photo was taken with.",
                )
            }
        }
        return CameraUnit(
            make.ifEmpty { other.make }, model.ifEmpty { other.model }, cameraId.ifEmpty { other.cameraId },
            serial.ifEmpty { other.serial }, lens.ifEmpty { other.lens }, focalLength ?: other.focalLength,
            aperture ?: other.aperture,
        )
    }

    /** The words of this unit that `other` states differently, both with their names. */
    internal fun differing(other: CameraUnit): List<String> = words().zip(other.words())
        .filter { (mine, theirs) -> mine.second.isNotEmpty() && theirs.second.isNotEmpty() && mine != theirs }
        .map { (mine, theirs) -> "${mine.first} '${mine.second}' against '${theirs.second}'" }

    /** The fields by their names; null where unknown. */
    private fun stated(): List<Pair<String, Any?>> = words().map { (name, word) -> name to word.ifEmpty { null } } +
        sizes()

    private fun words() =
        listOf("make" to make, "model" to model, "camera_id" to cameraId, "serial" to serial, "lens" to lens)

    private fun sizes() = listOf("focal_length" to focalLength, "aperture" to aperture)

    private fun spoken(value: Any): String = if (value is String) "'$value'" else "$value"

    internal fun toJson(): String {
        for ((name, size) in sizes()) {
            if (size != null && !(size > 0 && size.isFinite())) {
                throw InvalidArgument("The unit's $name is $size.", "Give a number above 0, or null.")
            }
        }
        return (words().map { (name, value) -> name to PassportJson.write(value) } + sizes())
            .joinToString(",", "{", "}") { (name, value) -> "\"$name\":$value" }
    }

    internal companion object {
        /** The camera that took a photo, as far as its file contains it. */
        fun of(photo: Photo): CameraUnit = CameraUnit(
            photo.make, photo.model, photo.camera.id, photo.camera.serial, photo.camera.lens,
            photo.camera.focalLength, photo.camera.aperture,
        )
    }
}
