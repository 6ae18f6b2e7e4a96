package org.camssf.photo

import org.camssf.FramesDiffer
import org.camssf.InvalidArgument
import org.camssf.Stage
import org.camssf.Tell
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp

/** A shot that is being measured: its photo has been read, but the measurement is not finished. */
internal class InWork(val lamp: Lamp, val photo: Photo, val saturation: Double, val pose: ChartPose?)

/**
 * The data of a capture so far, for the report of a refusal.
 *
 * @property lamps of all shots; the report needs the hashes of their files.
 * @property shots the finished ones.
 * @property inWork the unfinished shot; null between two shots.
 * @property files as in [MeasuredCapture].
 */
internal class Begun(
    val chart: ChartTable,
    val lamps: List<Lamp>,
    val shots: List<MeasuredShot>,
    val inWork: InWork? = null,
    val files: Map<String, String> = emptyMap(),
) {
    /** Of a finished capture. */
    constructor(capture: MeasuredCapture) :
        this(capture.chart, capture.shots.map { it.lamp }, capture.shots, null, capture.files)

    /** Signals of each finished shot; null if they cannot be computed. */
    val signals: List<Signals?> by lazy {
        shots.mapIndexed { j, shot ->
            when (val one = Normalise.one(shot.means, chart.patches, chart.white, j + 1)) {
                is Normalised.Sound -> one.signals
                is Normalised.Unsound -> null
            }
        }
    }
}

/** Measures the photos of a capture, one shot after the other. Not thread-safe. */
internal class Measuring(private val capture: Capture, private val tell: Tell) {
    private val done = ArrayList<MeasuredShot>()
    private var inWork: InWork? = null

    /** The data so far, for the report of a refusal. */
    fun begun(): Begun = Begun(capture.chart, capture.shots.map { it.lamp }, done.toList(), inWork)

    /**
     * Measures all shots.
     *
     * @throws org.camssf.CalibrationException a file, chart or frame is unusable, or the arguments are invalid;
     *   [begun] then has the data so far.
     */
    fun run(): MeasuredCapture {
        val k = capture.shots.size
        if (k == 0) throw InvalidArgument("there is no photo.", "Give the DNG of at least one photo of the chart.")
        if (k > MOST_SHOTS) throw InvalidArgument("there are $k photos.", "Give at most $MOST_SHOTS.")
        check(capture.shots.map { it.white != null }, capture.whiteReflectance)
        checkTorch(capture.shots)
        capture.shots.forEachIndexed { j, shot -> done += measure(shot, j) }
        agree(done)
        return MeasuredCapture(done, capture.chart, capture.whiteReflectance)
    }

    private fun measure(shot: Shot, j: Int): MeasuredShot {
        tell.begin(Stage.READING, j)
        val corners = shot.corners
        val region = ChartPose.region(corners)
        val watch = { tell.check() }
        val photo = Reading.of(shot.photo, region, true, watch)
        val white = shot.white?.let { Reading.of(it, region, false, watch) }
        val dark = shot.dark?.let { Reading.of(it, region, false, watch) }
        val saturation = photo.facts.sensor.white
        val facts = Photo.of(photo)
        inWork = InWork(shot.lamp, facts, saturation, null)
        tell.begin(Stage.FINDING, j)
        val pose = ChartPose.refine(photo, corners, capture.chart)
        inWork = InWork(shot.lamp, facts, saturation, pose)
        tell.begin(Stage.MEASURING, j)
        val means = PatchMeans.measure(photo, pose, white, dark, shot.lensShading)
        val whiteFacts = white?.let(Photo::of)
        val darkFacts = dark?.let(Photo::of)
        inWork = null
        return MeasuredShot(shot.lamp, facts, whiteFacts, darkFacts, pose, means, shot.lensShading)
    }

    companion object {
        private const val MOST_SHOTS = 64

        /** Combines shots that were measured one by one into a capture. */
        fun joined(shots: List<MeasuredShot>, chart: ChartTable, whiteReflectance: Double?): MeasuredCapture {
            if (shots.isEmpty()) throw InvalidArgument("No shot was given.", "Give at least one photo of the chart.")
            check(shots.map { it.means.white != null }, whiteReflectance)
            agree(shots)
            return MeasuredCapture(shots, chart, whiteReflectance)
        }

        /**
         * Checks that all shots or none have a white frame, and that its target's reflectance lies between 0.05 and
         * 1.2.
         */
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

        /** Checks that a shot by the torch has a photo with the torch off, which is subtracted, and no white frame. */
        private fun checkTorch(shots: List<Shot>) {
            val unfit = shots.indexOfFirst {
                it.lamp.name == Lamp.TORCH && (it.dark == null || it.white != null)
            }
            if (unfit >= 0) {
                throw InvalidArgument(
                    "Shot ${unfit + 1}: the torch's light needs a dark frame, the same photo with the torch off, " +
                        "and no white frame.",
                    "Give the photo with the torch off as the dark frame, and leave the white frame out.",
                )
            }
        }

        /** Checks that the shots are different photos taken by one camera. */
        private fun agree(shots: List<MeasuredShot>) {
            val twin = shots.groupBy { it.photo.sha256 }.values.firstOrNull { it.size > 1 }
            if (twin != null) {
                throw InvalidArgument(
                    "${twin[0].photo.name} was given ${twin.size} times: the same photo adds no information.",
                    "Give each photo once; a second shot is another photo, best under another lamp.",
                )
            }
            val bodies = shots.map { "${it.photo.make} ${it.photo.model}" }.toSortedSet()
            if (bodies.size > 1) {
                throw FramesDiffer(
                    "The photos come from different cameras: ${bodies.joinToString()}.",
                    "Calibrate one camera at a time.",
                )
            }
            val first = shots[0].photo
            for (shot in shots.drop(1)) {
                PhysicalCamera.check(first.name, first.camera, shot.photo.name, shot.photo.camera)
            }
        }
    }
}
