package org.camssf.photo

import org.camssf.photo.dng.DngReader
import org.camssf.photo.dng.DngSource

/**
 * Metadata of a frame, without its samples.
 *
 * @property name of the file.
 * @property width of the active area, px.
 * @property height of the active area, px.
 * @property orientation the TIFF orientation of the display, 1 to 8.
 * @property exposure exposure time, s; null if unknown.
 * @property iso sensitivity; null if unknown.
 * @property gainMap true if the file holds lens-shading maps, which are not applied to its samples.
 * @property make of the camera.
 * @property model of the camera.
 * @property sha256 SHA-256 of the file, lower-case hex.
 * @property camera the physical camera and its lens.
 * @property captured capture time, ISO 8601, with the offset from UTC if the file has one; "" if unknown. In a document
 *   only where the app says so.
 * @property uniqueModel the DNG's UniqueCameraModel, by which raw converters identify the camera; "" if unknown.
 * @property matricesLeftOut which of the file's colour matrices are not used, and why; "" if none.
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
    internal val colourMatrices: List<ColourMatrix> = emptyList(),
    public val camera: PhysicalCamera = PhysicalCamera(),
    public val captured: String = "",
    public val uniqueModel: String = "",
    public val matricesLeftOut: String = "",
    /** Source of its pattern and levels; "" if they are a DNG's own tags. */
    internal val levels: String = "",
) {
    override fun toString(): String = "Photo($name, $make $model, $width × $height)"

    public companion object {
        /**
         * Reads the metadata of a DNG, not its samples.
         *
         * Threads: any but the main one.
         *
         * @param source stays open; the caller closes it. It is read by one thread.
         * @throws org.camssf.UnreadableRaw truncated, damaged, or not a raw file at all.
         * @throws org.camssf.UnsupportedRaw a form of raw file that camssf does not read.
         * @throws org.camssf.NotSensorRaw already demosaiced.
         * @throws InterruptedException the thread is interrupted; the flag is cleared.
         */
        @JvmStatic
        @Throws(InterruptedException::class)
        public fun read(source: DngSource): Photo = DngReader.facts(source, null).let { of(it, it.origin.sha256) }

        internal fun of(reading: Reading): Photo = of(reading.facts, reading.sha256)

        private fun of(facts: Facts, sha256: String): Photo = Photo(
            facts.name, facts.width, facts.height, facts.origin.orientation, facts.origin.exposure, facts.origin.iso,
            facts.corrections.gainMaps.isNotEmpty(), facts.origin.make, facts.origin.model, sha256,
            facts.colours.colourMatrices, facts.origin.camera, facts.origin.captured, facts.origin.uniqueModel,
            facts.colours.matricesLeftOut,
        )
    }
}
