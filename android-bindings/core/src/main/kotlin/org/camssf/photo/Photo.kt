package org.camssf.photo

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
    internal val camera: PhysicalCamera = PhysicalCamera(),
) {
    internal companion object {
        /** CIE illuminants by Exif's LightSource codes, as DNG's colour matrices name them. */
        val LIGHT_SOURCES =
            mapOf(17 to "A", 18 to "B", 19 to "C", 20 to "D55", 21 to "D65", 22 to "D75", 23 to "D50")

        fun of(reading: Reading): Photo = of(reading.facts, reading.sha256)

        private fun of(facts: Facts, sha256: String): Photo = Photo(
            facts.name, facts.width, facts.height, facts.origin.orientation, facts.origin.exposure, facts.origin.iso,
            facts.corrections.gainMaps.isNotEmpty(), facts.origin.make, facts.origin.model, sha256,
            facts.colours.neutrals.map { NamedNeutral(LIGHT_SOURCES.getValue(it.illuminant), it.white) },
            facts.origin.camera,
        )
    }
}

/** The camera's white (3) under a CIE illuminant, as the file's colour matrix tells it. */
internal class NamedNeutral(val light: String, val white: DoubleArray)
