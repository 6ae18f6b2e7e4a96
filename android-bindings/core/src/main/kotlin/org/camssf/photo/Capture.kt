package org.camssf.photo

import org.camssf.CalibrationException
import org.camssf.FramesDiffer
import org.camssf.InvalidArgument
import org.camssf.SsfCalibrator
import org.camssf.UnreadableRaw
import org.camssf.photo.dng.DngReader
import org.camssf.photo.dng.DngSource
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import java.io.File
import java.io.IOException
import java.security.MessageDigest
import java.util.concurrent.CancellationException

/**
 * Where a photo comes from: it is opened when its turn comes and let go before the next one, so that one capture never
 * holds more than the frames of one shot in memory.
 */
public fun interface Frame {
    /**
     * Reads the photo, at least the `region` of its active area if there is one.
     *
     * @throws CalibrationException if it cannot be read.
     */
    public fun read(region: Region?): Mosaic

    public companion object {
        /** A photo that is in memory already. */
        @JvmStatic
        public fun of(mosaic: Mosaic): Frame = Frame { mosaic }

        /** A DNG file; only the strips and tiles around the chart are decoded. */
        @JvmStatic
        public fun of(file: File): Frame = dng { DngSource.of(file) }

        /**
         * A DNG that `open` opens anew at each call, a `Uri` for example; it is closed here. What `open` throws becomes
         * [UnreadableRaw].
         */
        @JvmStatic
        public fun dng(open: () -> DngSource): Frame = Frame { region ->
            val source = opened(open)
            try {
                source.use { DngReader.read(it, region) }
            } catch (error: IOException) {
                throw UnreadableRaw("${source.name} cannot be closed: ${error.message}.", AGAIN, cause = error)
            }
        }

        private const val AGAIN = "Check that the photo is still there and that the app may read it, and try again."

        /** What a provider throws is its own: no file, no permission, no network. */
        private fun opened(open: () -> DngSource): DngSource = try {
            open()
        } catch (error: Exception) {
            if (error is CalibrationException || error is CancellationException || error is InterruptedException) {
                throw error
            }
            throw UnreadableRaw("The photo cannot be opened: ${error.message ?: error}.", AGAIN, cause = error)
        }
    }
}

/**
 * One photo of the chart under one lamp, with its white and dark frames where they exist.
 *
 * @property photo of the chart.
 * @property lamp its light.
 * @property corners (4, 2) rough outer corners of the block of patches, see [ChartPose.refine].
 * @property white the white frame, taken like the photo; all shots of a capture have one, or none.
 * @property dark the dark frame, likewise.
 * @property lensShading what is done about the shading that the photo's file describes.
 */
public class Shot @JvmOverloads constructor(
    public val photo: Frame,
    public val lamp: Lamp,
    public val corners: DoubleArray,
    public val white: Frame? = null,
    public val dark: Frame? = null,
    public val lensShading: LensShading = LensShading.AS_STORED,
)

/**
 * k shots of one chart with one camera.
 *
 * @property shots k of them.
 * @property chart the chart's table.
 * @property whiteReflectance of the white frame's card, one number; null for a perfect diffuser.
 */
public class Capture @JvmOverloads constructor(
    public val shots: List<Shot>,
    public val chart: ChartTable,
    public val whiteReflectance: Double? = null,
) {
    /** One shot. */
    public constructor(shot: Shot, chart: ChartTable) : this(listOf(shot), chart)
}

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

/**
 * One measured shot: small, so that an app may measure right after the photo and solve later.
 *
 * @property lamp its light.
 * @property photo what the chart photo's file says.
 * @property white what the white frame's file says, or null.
 * @property dark what the dark frame's file says, or null.
 * @property pose where the chart lies in the photo.
 * @property means the patch statistics of all frames.
 * @property lensShading what was done about the shading that the file describes.
 */
public class MeasuredShot internal constructor(
    public val lamp: Lamp,
    public val photo: Photo,
    public val white: Photo?,
    public val dark: Photo?,
    public val pose: ChartPose,
    public val means: PatchMeans,
    public val lensShading: LensShading,
)

/**
 * k measured shots of one chart with one camera: what [SsfCalibrator.solve] needs.
 *
 * @property shots k of them.
 * @property chart the chart's table.
 * @property whiteReflectance of the white frame's card, one number; null for a perfect diffuser.
 */
public class MeasuredCapture internal constructor(
    public val shots: List<MeasuredShot>,
    public val chart: ChartTable,
    public val whiteReflectance: Double?,
)

/** What is known so far, for the evidence of a refusal: finished shots, and the one that was in work. */
internal class Begun(val chart: ChartTable) {
    val shots = ArrayList<MeasuredShot>()
    var lamp: Lamp? = null
    var photo: Photo? = null
    var saturation = 0.0
    var pose: ChartPose? = null

    /** Lamps of all shots, for the hashes of their files. */
    var lamps: List<Lamp> = emptyList()
}

/** Photos → measured capture. */
internal object Measure {
    private const val MOST_SHOTS = 64

    fun measure(capture: Capture, begun: Begun, tell: Tell): MeasuredCapture {
        val k = capture.shots.size
        if (k == 0) throw InvalidArgument("there is no photo.", "Give the DNG of at least one photo of the chart.")
        if (k > MOST_SHOTS) throw InvalidArgument("there are $k photos.", "Give at most $MOST_SHOTS.")
        check(capture.shots.map { it.white != null }, capture.whiteReflectance)
        begun.lamps = capture.shots.map { it.lamp }
        for ((j, shot) in capture.shots.withIndex()) {
            val at = if (k > 1) " ${j + 1} of $k" else ""
            tell("reading photo$at", j.toDouble() / k)
            begun.lamp = shot.lamp
            begun.photo = null
            begun.pose = null
            val region = ChartPose.region(shot.corners)
            val photo = shot.photo.read(region)
            begun.photo = Photo.of(photo)
            begun.saturation = photo.white
            tell("looking for the chart$at", (j + 0.4) / k)
            val pose = ChartPose.refine(photo, shot.corners, capture.chart)
            begun.pose = pose
            tell("measuring the patches$at", (j + 0.7) / k)
            val white = shot.white?.read(region)
            val dark = shot.dark?.read(region)
            val means = PatchMeans.measure(photo, pose, white, dark, shot.lensShading)
            begun.shots += MeasuredShot(
                shot.lamp,
                begun.photo!!,
                white?.let(Photo::of),
                dark?.let(Photo::of),
                pose,
                means,
                shot.lensShading,
            )
            begun.lamp = null
            begun.photo = null
        }
        agree(begun.shots)
        return MeasuredCapture(begun.shots.toList(), capture.chart, capture.whiteReflectance)
    }

    /** Shots that were measured one by one. */
    fun joined(shots: List<MeasuredShot>, chart: ChartTable, whiteReflectance: Double?): MeasuredCapture {
        if (shots.isEmpty()) throw InvalidArgument("No shot was given.", "Give at least one photo of the chart.")
        check(shots.map { it.means.white != null }, whiteReflectance)
        agree(shots)
        return MeasuredCapture(shots, chart, whiteReflectance)
    }

    /** All shots have a white frame, or none; its card reflects what a card can. */
    private fun check(framed: List<Boolean>, card: Double?) {
        if (framed.toSet().size > 1) {
            throw InvalidArgument(
                "some shots have a white frame and some have none.",
                "Give a white frame for all shots, or for none.",
            )
        }
        if (card != null && card !in 0.05..1.2) {
            throw InvalidArgument("a white card of reflectance $card is none.", "Write 95 % as 0.95.")
        }
        if (card != null && !framed[0]) {
            throw InvalidArgument(
                "a white card's reflectance was given, but no white frame.",
                "Give the white frame, or leave it out.",
            )
        }
    }

    /** One camera took all shots, each another photo. */
    private fun agree(shots: List<MeasuredShot>) {
        val twin = shots.groupBy { it.photo.sha256 }.values.firstOrNull { it.size > 1 }
        if (twin != null) {
            throw InvalidArgument(
                "${twin[0].photo.name} was given ${twin.size} times: one photo is one piece of evidence.",
                "Give each photo once; a second shot is another photo, best under another lamp.",
            )
        }
        val bodies = shots.map { "${it.photo.make} ${it.photo.model}" }.toSortedSet()
        if (bodies.size > 1) {
            throw FramesDiffer(
                "the photos come from different cameras: ${bodies.joinToString()}.",
                "Calibrate one camera at a time.",
            )
        }
    }
}

/** Tells the stage in words and the part done, 0 to 1; ends a call that was cancelled. */
internal typealias Tell = (String, Double) -> Unit
