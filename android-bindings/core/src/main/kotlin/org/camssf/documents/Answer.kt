package org.camssf.documents

import org.camssf.Rows
import org.camssf.fit.Predictions
import org.camssf.fit.Scores
import org.camssf.fit.Uncertainty
import org.camssf.flatten
import org.camssf.frozen
import org.camssf.photo.Assumption
import org.camssf.photo.MeasuredCapture
import org.camssf.photo.Signals
import org.camssf.recovery.EstimatedLamp
import org.camssf.recovery.Hypothesis
import org.camssf.recovery.Ssf
import org.camssf.short
import org.camssf.verdict.Verdict
import java.util.Collections
import kotlin.math.roundToInt
import kotlin.math.sqrt

/**
 * The basis of an answer, and the hypotheses that it was compared with.
 *
 * @property name "phones", "cameras", "ryyb" or "gaussian"; of a mixture that of the most probable part.
 * @property priorScale width of the prior relative to the learned one: 1, or 4 for a camera that does not belong to
 *   the family of its basis.
 * @property chartFading by how much the colours of the chart have faded in this answer, 0 to 1; 0 for none.
 * @property logEvidence ln of the marginal likelihood of the signals under basis and lamps, nats, up to a constant that
 *   depends only on the rows; null on a basis without a prior.
 */
public class BasisChoice internal constructor(
    public val name: String,
    public val priorScale: Double,
    public val chartFading: Double,
    public val logEvidence: Double?,
    hypotheses: List<Hypothesis>,
) {
    /** If basis or kind of light were chosen by their evidence, what was compared, phones before cameras; else empty. */
    public val hypotheses: List<Hypothesis> = hypotheses.frozen()

    override fun toString(): String = name
}

/**
 * How near the solution is to the optimum, and of which problem. On a basis with a prior the three channels are one
 * problem, p = 1; on the paper's basis each is one, p = 3.
 *
 * @property gap (3) relative duality gap of each channel's problem, 1: a bound of the distance from the optimum.
 * @property layersGap (p) the same of the layers' solution, before the finish.
 * @property gamma (3) the l1 penalty of each channel's problem.
 * @property l2 the quadratic penalty.
 */
public class Convergence internal constructor(
    public val gap: Rows,
    public val layersGap: Rows,
    finishSteps: List<Int>,
    public val gamma: Rows,
    public val l2: Double,
) {
    /** (p) pivots of the finish; 0 where the layers' gap was small enough. */
    public val finishSteps: List<Int> = finishSteps.frozen()

    override fun toString(): String = "Convergence(gap=${gap.joinToString { short(it) }})"
}

/**
 * What a result was made by.
 *
 * @property version of the camssf that wrote it.
 * @property engine "onnx", or "reference" for Python's NumPy; null if there is no answer.
 * @property model SHA-256 of the model's file, lower-case hex; null if no model ran.
 * @property basis SHA-256 of the basis's arrays; null as above.
 */
public class Provenance internal constructor(
    public val version: String,
    public val engine: String?,
    public val model: String?,
    public val basis: String?,
    files: Map<String, String>,
) {
    /** SHA-256 of the lamps', the chart's and other files, by role and name; each photo has its own. */
    public val files: Map<String, String> = Collections.unmodifiableMap(LinkedHashMap(files))

    override fun toString(): String = "camssf $version, model ${model?.take(12)}"
}

/**
 * Curves of peak 1 with their errors.
 *
 * @property values of R, G, B, (681) each.
 * @property std one standard deviation of each; null on a basis without a prior.
 * @property channelGain (3) raw white of each channel relative to green.
 * @property codeCovariance lower triangle of the posterior covariance of the code, row by row; null as above.
 */
internal class Curves(
    val values: List<DoubleArray>,
    val std: List<DoubleArray>?,
    val channelGain: DoubleArray,
    val codeCovariance: DoubleArray?,
)

/** The answer of a result: what a document's part "Answer" holds. */
internal class Answer(
    val curves: Curves,
    val basis: BasisChoice,
    val convergence: Convergence,
    val predictions: Predictions,
    lights: List<EstimatedLamp?>,
    val scores: Scores,
    val uncertainty: Uncertainty?,
) {
    val lights: List<EstimatedLamp?> = lights.frozen()
}

/**
 * All results of one calibration.
 *
 * @property uncertainty null if there is no band.
 */
internal class Solution(
    val capture: MeasuredCapture,
    val signals: Signals,
    val ssf: Ssf,
    val predictions: Predictions,
    val scores: Scores,
    val verdict: Verdict,
    val assumptions: List<Assumption>,
    val uncertainty: Uncertainty?,
) {
    fun answer(): Answer = Answer(
        Curves(
            List(3) { ssf.curve(it) }, ssf.sharedStd?.let { List(3) { ssf.deviation(it)!! } }, ssf.sharedGain,
            ssf.sharedCodeCovariance?.let { triangle(it) },
        ),
        BasisChoice(ssf.basis, ssf.priorScale, ssf.chartFading, ssf.logEvidence, ssf.choice),
        Convergence(
            Rows(ssf.sharedGap, 3), Rows(ssf.sharedLayersGap, ssf.sharedLayersGap.size),
            ssf.sharedFinishSteps.asList(), Rows(ssf.sharedGamma, 3), ssf.l2,
        ),
        predictions, ssf.lights, scores, uncertainty,
    )

    /** The lower triangle of a symmetric matrix, including its diagonal, row by row. */
    private fun triangle(matrix: DoubleArray): DoubleArray {
        val size = sqrt(matrix.size.toDouble()).roundToInt()
        return List(size) { matrix.copyOfRange(it * size, it * size + it + 1) }.flatten()
    }
}
