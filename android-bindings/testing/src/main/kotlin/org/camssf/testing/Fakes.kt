package org.camssf.testing

import org.camssf.Camssf
import org.camssf.Grid
import org.camssf.InvalidArgument
import org.camssf.Nodes
import org.camssf.Reason
import org.camssf.Recovered
import org.camssf.Refusal
import org.camssf.Refused
import org.camssf.Rows
import org.camssf.documents.Provenance
import org.camssf.documents.Solution
import org.camssf.fit.Predictions
import org.camssf.fit.Scores
import org.camssf.fit.Uncertainty
import org.camssf.photo.Assumption
import org.camssf.photo.MeasuredCapture
import org.camssf.photo.Normalise
import org.camssf.photo.PartialCapture
import org.camssf.recovery.BasisConstants
import org.camssf.recovery.Ssf
import org.camssf.recovery.predictSignals
import org.camssf.verdict.Status
import org.camssf.verdict.Verdict

/**
 * Fake results without a calibration, for an app's own tests of its screens and files: an answer, a doubtful answer
 * and a refusal.
 *
 * ```kotlin
 * val results = listOf(Fakes.recovered(), Fakes.recovered(listOf("glare")), Fakes.refused(Refusal.of("glare.veil", "shot" to 1, "amount" to 0.05)))
 * ```
 *
 * Threads: any. No model runs, and ONNX Runtime is not needed. A fake answer states in its assumptions that it is a fake.
 */
public object Fakes {
    /** Code of the assumption that every fake answer has. */
    public const val FAKE: String = "fake"

    private const val BASIS = "phones"
    private const val BAND = 0.02
    private val NO_HASH = "0".repeat(64)

    /** An accepted answer, of the mean curves of the phones. */
    @JvmStatic
    public fun recovered(): Recovered = recovered(emptyList())

    /** The same, doubtful for reasons of these codes. */
    @JvmStatic
    public fun recovered(doubts: List<String>): Recovered = recovered(doubts, null)

    /**
     * An answer: the mean curves of the phones, with a band of 2 % of the peak, on the signals of [SampleCapture].
     *
     * @param doubts codes of the reasons for which it is doubtful; empty for an accepted answer.
     * @param curves (681, 3) other curves, row-major, on [Grid], any scale; null for these.
     * @throws InvalidArgument the curves have another size, or do not respond to white.
     */
    @JvmStatic
    public fun recovered(doubts: List<String>, curves: DoubleArray?): Recovered {
        val shot = SampleCapture.measured()
        val capture = MeasuredCapture(listOf(shot), SampleCapture.chart(), null)
        val table = capture.chart
        val signals = Normalise.all(listOf(shot.means), table.patches, table.white)
        val white = table.reflectance(table.white)
        val lamp = shot.lamp.sharedValues
        val values = scaled(curves ?: mean(), DoubleArray(Grid.SIZE) { white[it] * lamp[it] * Grid.STEP })
        val predicted = predictSignals(values, table.sharedValues, lamp, white)
        val r = BasisConstants.of(BASIS)!!.atoms
        val peaks = List(3) { c -> (0 until Grid.SIZE).maxOf { values[3 * it + c] } }
        val ssf = Ssf(
            Ssf.Curves(
                values,
                DoubleArray(values.size) { BAND * peaks[it % 3] },
                DoubleArray(3 * r),
                DoubleArray(9 * r * r) { if (it / (3 * r) == it % (3 * r)) BAND * BAND else 0.0 },
                predicted,
                lamp,
            ),
            Ssf.Proof(DoubleArray(3), DoubleArray(1), IntArray(1), 0.0),
            DoubleArray(3) { 1.0 },
            DoubleArray(3),
            0.0,
            BASIS,
        )
        val n = signals.patches
        val used = BooleanArray(n) { true }
        val all = Rows(predicted, 1, n, 3)
        val scores = Scores.of(signals, predicted, table, listOf(shot.lamp), used, "a fake's own patches")
        val reasons = doubts.map {
            Reason(it, "A doubt called $it.", "It is a fake: nothing is to be done.", null, null)
        }
        val status = if (doubts.isEmpty()) Status.ACCEPTED else Status.DOUBTFUL
        val solution = Solution(
            capture,
            signals,
            ssf,
            Predictions(used, Rows(DoubleArray(n) { 1.0 }, 1, n), all, null, all, null),
            scores,
            Verdict(status, reasons),
            signals.assumptions + Assumption(FAKE, "Made by camssf-testing: these are no camera's curves."),
            Uncertainty(ssf.halfWidth, ssf.halfWidthWithoutPhoto, emptyList(), emptyList()),
        )
        val provenance = Provenance(Camssf.VERSION, "onnx", NO_HASH, NO_HASH, emptyMap())
        return Recovered(capture, solution.answer(), solution.verdict, solution.assumptions, provenance)
    }

    /**
     * A refusal.
     *
     * @param error its cause, for example `Refusal.of("overexposed.region", "region" to 1, "share" to 0.4)`.
     */
    @JvmStatic
    public fun refused(error: Refusal): Refused {
        val shot = SampleCapture.measured()
        val partial = PartialCapture(SampleCapture.chart(), listOf(shot.lamp), listOf(shot))
        val provenance = Provenance(Camssf.VERSION, null, null, null, emptyMap())
        return Refused(error, Verdict(Status.REFUSED, listOf(error.reason)), provenance, partial)
    }

    private fun mean(): DoubleArray {
        val basis = BasisConstants.of(BASIS)!!
        val curves = List(3) { c -> Nodes.straight { basis.mean[c * Nodes.SIZE + it] } }
        return DoubleArray(3 * Grid.SIZE) { maxOf(curves[it % 3][it / 3], 0.0) }
    }

    private fun scaled(curves: DoubleArray, white: DoubleArray): DoubleArray {
        if (curves.size != 3 * Grid.SIZE) {
            throw InvalidArgument("${curves.size} numbers are no curves.", "Give (681, 3), row-major.")
        }
        val sums = List(3) { c -> (0 until Grid.SIZE).sumOf { white[it] * curves[3 * it + c] } }
        if (sums.any { !(it > 0 && it.isFinite()) }) {
            throw InvalidArgument("A curve does not see white.", "Give curves with a positive peak.")
        }
        return DoubleArray(curves.size) { curves[it] / sums[it % 3] }
    }
}
