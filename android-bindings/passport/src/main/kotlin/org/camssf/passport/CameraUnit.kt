package org.camssf.passport

import org.camssf.InvalidArgument
import org.camssf.photo.Photo

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
    /** With what the other knows where this one is silent; where both speak, they must agree. */
    internal fun agreed(other: CameraUnit, source: String): CameraUnit {
        for ((mine, theirs) in told().zip(other.told())) {
            val (name, own) = mine
            val there = theirs.second
            if (own != null && there != null && own != there) {
                throw InvalidArgument(
                    "Another camera by what $source says: $name is ${spoken(there)} there, not ${spoken(own)}.",
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

    /** By their names, null where nothing is known. */
    private fun told(): List<Pair<String, Any?>> = words().map { (name, word) -> name to word.ifEmpty { null } } +
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
        return (words().map { (name, value) -> name to Sound.quote(value) } + sizes())
            .joinToString(",", "{", "}") { (name, value) -> "\"$name\":$value" }
    }

    internal companion object {
        /** By what camera a photo was taken, as far as its file says. */
        fun of(photo: Photo): CameraUnit = CameraUnit(
            photo.make, photo.model, photo.camera.id, photo.camera.serial, photo.camera.lens,
            photo.camera.focalLength, photo.camera.aperture,
        )
    }
}
