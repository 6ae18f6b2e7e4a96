package org.camssf.photo

import java.security.MessageDigest

/**
 * What a frame's file says, without its samples.
 *
 * @property name of the file.
 * @property width of the active area, px.
 * @property height of the active area, px.
 * @property orientation of the display, TIFF's, 1 to 8.
 * @property exposure s, null where unknown.
 * @property iso null where unknown.
 * @property gainMap the file holds a lens-shading map, which its samples do not contain.
 * @property make of the camera.
 * @property model of the camera.
 * @property sha256 of the file, lower-case hex.
 */
public class Photo internal constructor(
    public val name: String,
    public val width: Int,
    public val height: Int,
    public val orientation: Int,
    public val exposure: Double?,
    public val iso: Double?,
    public val gainMap: Boolean,
    public val make: String,
    public val model: String,
    public val sha256: String,
    internal val neutrals: List<NamedNeutral> = emptyList(),
) {
    internal companion object {
        /** CIE illuminants by Exif's LightSource codes, as DNG's colour matrices name them. */
        private val LIGHT_SOURCES =
            mapOf(17 to "A", 18 to "B", 19 to "C", 20 to "D55", 21 to "D65", 22 to "D75", 23 to "D50")

        fun of(mosaic: Mosaic): Photo = Photo(
            mosaic.name, mosaic.width, mosaic.height, mosaic.orientation, mosaic.exposure, mosaic.iso,
            mosaic.gainMaps.isNotEmpty(), mosaic.make, mosaic.model, mosaic.sha256.ifEmpty { hash(mosaic) },
            mosaic.neutrals.map { NamedNeutral(LIGHT_SOURCES.getValue(it.illuminant), it.white) },
        )

        /** Of the samples, row by row, where there was no file (Camera2). */
        private fun hash(mosaic: Mosaic): String {
            val digest = MessageDigest.getInstance("SHA-256")
            val row = ByteArray(2 * mosaic.region.width)
            for (y in 0 until mosaic.region.height) {
                for (x in 0 until mosaic.region.width) {
                    val sample = mosaic.samples[y * mosaic.region.width + x].toInt()
                    row[2 * x] = sample.toByte()
                    row[2 * x + 1] = (sample shr 8).toByte()
                }
                digest.update(row)
            }
            return digest.digest().joinToString("") { "%02x".format(it) }
        }
    }
}

/** The camera's white (3) under a CIE illuminant, as the file's colour matrix tells it. */
internal class NamedNeutral(val light: String, val white: DoubleArray)
