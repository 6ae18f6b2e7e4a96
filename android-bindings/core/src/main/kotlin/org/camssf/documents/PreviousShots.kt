package org.camssf.documents

import org.camssf.InvalidArgument
import org.camssf.Refusal
import org.camssf.photo.FrameMeans
import org.camssf.photo.MeasuredCapture
import org.camssf.photo.MeasuredShot
import org.camssf.photo.Normalise
import org.camssf.photo.Normalised
import org.camssf.photo.PartialCapture
import org.camssf.photo.PatchMeans
import org.camssf.photo.Photo
import org.camssf.photo.PhysicalCamera
import org.camssf.spectra.ChartTable
import org.camssf.verdict.Status
import org.camssf.verdict.Verdict

/** Takes the named shots of a stored result as further shots of a new capture: Python's camssf.documents.previous. */
internal class PreviousShots(
    private val name: String,
    private val verdict: Verdict,
    private val stored: PartialCapture?,
) {
    /**
     * The capture with the named shots of this result behind its own, all relative to the chart's white patch.
     *
     * @throws InvalidArgument the result is not accepted, names no lamp, is of another chart, or holds the same
     *   photo.
     * @throws UnitDiffers it is of another camera.
     */
    fun joined(capture: MeasuredCapture): MeasuredCapture {
        val stored = checked(capture)
        val table = table(stored.chart, capture.chart)
        // The files of the previous result's lamps are not those of the new one.
        val named = stored.shots.filterNot { it.lamp.unnamed }.map { it.under(it.lamp.withoutFile()) }
        return MeasuredCapture((capture.shots + named).map { evened(it, table) }, table, null, capture.files)
    }

    /** The capture of this result, if it can be joined with another one. */
    private fun checked(capture: MeasuredCapture): PartialCapture {
        if (verdict.outcome != Status.ACCEPTED || stored == null) {
            val why = verdict.reasons.firstOrNull()?.message.orEmpty()
            throw InvalidArgument("The previous result $name was ${verdict.outcome.word}: $why", AGAIN)
        }
        if (stored.shots.all { it.lamp.unnamed }) {
            throw InvalidArgument("The previous result $name names no lamp.", AGAIN)
        }
        checkUnit(stored.shots[0].photo, capture.shots[0].photo)
        val hashes = stored.shots.map { it.photo.sha256 }
        val twin = capture.shots.firstOrNull { it.photo.sha256 in hashes } ?: return stored
        throw InvalidArgument("${twin.photo.name} is already in the previous result $name.", "Take a new photo.")
    }

    /**
     * The table of the chart of both: errors of one chart are common to all its photos.
     *
     * Names and files must be equal; of a chart whose name states no table, the previous result has chosen one.
     *
     * @throws InvalidArgument the charts differ.
     */
    private fun table(theirs: ChartTable, ours: ChartTable): ChartTable {
        val same = (listOf(ours) + ours.otherTables()).firstOrNull {
            theirs.name == it.name && theirs.layout.name == it.layout.name && theirs.file == it.file
        }
        return same ?: throw InvalidArgument(
            "The previous result $name was measured on the chart ${theirs.name}, not on ${ours.name}.",
            "Photograph the same chart again, and give the same table.",
        )
    }

    /** Compares what both files state. */
    private fun checkUnit(stored: Photo, photo: Photo) {
        val pairs = listOf(
            Triple("make", stored.make, photo.make),
            Triple("model", stored.model, photo.model),
            Triple("unique_model", stored.uniqueModel, photo.uniqueModel),
            Triple("size", "${stored.width} × ${stored.height}", "${photo.width} × ${photo.height}"),
        )
        val differ = pairs.filter { (_, there, here) -> there.isNotEmpty() && here.isNotEmpty() && there != here }
        if (differ.isNotEmpty()) {
            val words = differ.joinToString("; ") { (word, there, here) -> "$word $there against $here" }
            throw Refusal.of(
                "unit_differs.previous", "previous" to name, "file" to photo.name, "differences" to words,
            )
        }
        val theirs = "the photo ${stored.name} of the previous result $name"
        PhysicalCamera.check(theirs, stored.camera, photo.name, photo.camera)
    }

    companion object {
        private const val AGAIN =
            "Give the result of an accepted calibration of this unit, under a lamp that you named."

        /**
         * The shot without its white frame, its chart photo as in even light: b_w y in place of b y, b = W - D. It
         * needs no gain modes.
         */
        fun evened(shot: MeasuredShot, table: ChartTable): MeasuredShot {
            val means = shot.means
            if (means.white == null) return shot
            val signals = when (val one = Normalise.one(means, table.patches, table.white, 1)) {
                is Normalised.Usable -> one.signals
                is Normalised.Unusable -> throw one.error
            }
            val y = signals.sharedValues
            val dark = signals.sharedDark
            val b = DoubleArray(3) { (3 * table.white + it).let { at -> signals.sharedWhite[at] - dark[at] } }
            val chart = means.chart.with(
                DoubleArray(y.size) { dark[it] + b[it % 3] * y[it] },
                DoubleArray(y.size) { b[it % 3] * signals.sharedError[it] },
            )
            // The dark frame's error is in that of y already.
            val own = means.dark?.let { it.with(it.sharedMean, DoubleArray(y.size)) }
            return MeasuredShot(
                shot.lamp, shot.photo, shot.white, shot.dark, shot.pose,
                PatchMeans(chart, null, own, means.sharedBlack, means.saturation, evened = true), shot.lensShading,
            )
        }

        private fun FrameMeans.with(mean: DoubleArray, error: DoubleArray) =
            FrameMeans(mean, error, sharedCount, sharedClipped, sharedDead, sharedGradient, sharedGreens)
    }
}
