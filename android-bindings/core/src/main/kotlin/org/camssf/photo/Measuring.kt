package org.camssf.photo

import org.camssf.InvalidArgument
import org.camssf.ProgressReporter
import org.camssf.Refusal
import org.camssf.Stage
import org.camssf.json.range
import org.camssf.spectra.Bundled
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp

/** Measures the photos of a capture, one shot after the other. Not thread-safe. */
internal class Measuring(private val capture: Capture, private val reporter: ProgressReporter) {
    private val done = ArrayList<MeasuredShot>()
    private var unfinished: PartialShot? = null

    /** The data so far, for the report of a refusal. */
    fun partial(): PartialCapture =
        PartialCapture(
            capture.chart, capture.shots.map { it.lamp }, done.toList(), unfinished, capture.whiteReflectance,
        )

    /**
     * Measures all shots.
     *
     * @throws org.camssf.CalibrationException a file, chart or frame is unusable, or the arguments are invalid;
     *   [partial] then has the data so far.
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
        unfinished = PartialShot()
        reporter.begin(Stage.READING, j)
        val corners = shot.corners
        val region = ChartPose.region(corners)
        val watch = { reporter.check() }
        val photo = Reading.of(shot.photo, region, true, watch)
        val sensor = photo.facts.sensor
        val black = DoubleArray(3) { sensor.sharedBlack[sensor.cfa.indexOf("RGB"[it])] }
        val facts = Photo.of(photo)
        unfinished = PartialShot(facts, black, sensor.white)
        reporter.begin(Stage.FINDING, j)
        val pose = ChartPose.refine(photo, corners, capture.chart)
        unfinished = PartialShot(facts, black, sensor.white, pose)
        reporter.begin(Stage.MEASURING, j)
        val white = shot.white?.let { Reading.of(it, region, false, watch) }
        val dark = shot.dark?.let { Reading.of(it, region, false, watch) }
        val (whiteFacts, darkFacts) = listOf(white, dark).map { it?.let(Photo::of) }
        checkRoles(CHART to facts, WHITE to whiteFacts, DARK to darkFacts)
        val means = PatchMeans.measure(photo, pose, white, dark, shot.lensShading)
        unfinished = null
        return MeasuredShot(shot.lamp, facts, whiteFacts, darkFacts, pose, means, shot.lensShading)
    }

    companion object {
        private const val MOST_SHOTS = 64

        /** Combines shots that were measured one by one into a capture. */
        fun joined(shots: List<MeasuredShot>, chart: ChartTable, whiteReflectance: Double?): MeasuredCapture {
            if (shots.isEmpty()) throw InvalidArgument("No shot was given.", "Give at least one photo of the chart.")
            if (shots.size >
                MOST_SHOTS
            ) {
                throw InvalidArgument("there are ${shots.size} shots.", "Give at most $MOST_SHOTS.")
            }
            agree(shots, whiteReflectance)
            return MeasuredCapture(shots, chart, whiteReflectance)
        }

        /** Checks that measured shots belong together. */
        fun agree(shots: List<MeasuredShot>, whiteReflectance: Double?) {
            check(shots.map { it.means.white != null }, whiteReflectance)
            agree(shots)
        }

        /**
         * Checks that all shots or none have a white frame, and that its target's reflectance is possible.
         */
        private fun check(framed: List<Boolean>, card: Double?) {
            if (framed.toSet().size > 1) {
                throw InvalidArgument(
                    "some shots have a white frame and some have none.",
                    "Give a white frame for all shots, or for none.",
                )
            }
            if (card != null && card !in Bundled.limits.range("card")) {
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

        private const val CHART = "the chart's photo"
        private const val WHITE = "the white frame"
        private const val DARK = "the dark frame"

        /** Checks that photos of different roles, each with its name in words, are different files by their content. */
        private fun checkRoles(vararg frames: Pair<String, Photo?>) {
            val known = frames.filter { it.second != null }
            for ((i, one) in known.withIndex()) {
                for (other in known.drop(i + 1)) {
                    if (one.second?.sha256 == other.second?.sha256) {
                        throw InvalidArgument(
                            "${one.first.replaceFirstChar {
                                it.uppercase()
                            }} and ${other.first} are the same photo " +
                                "(${one.second?.sha256?.take(12)}).",
                            "Give another file for one of them: the white frame shows an even white target in the " +
                                "chart's light, the dark frame no light. Or leave it out.",
                        )
                    }
                }
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
            for ((j, shot) in shots.withIndex()) {
                for ((k, other) in shots.withIndex()) {
                    val chart = "$CHART of shot ${j + 1}" to shot.photo
                    checkRoles(chart, "$WHITE of shot ${k + 1}" to other.white)
                    checkRoles(chart, "$DARK of shot ${k + 1}" to other.dark)
                }
            }
            val bodies = shots.map { "${it.photo.make} ${it.photo.model}" }.toSortedSet()
            if (bodies.size > 1) {
                throw Refusal.of("frames_differ.cameras", "cameras" to bodies.joinToString())
            }
            val first = shots[0].photo
            for (shot in shots.drop(1)) {
                PhysicalCamera.check(first.name, first.camera, shot.photo.name, shot.photo.camera)
            }
        }
    }
}
