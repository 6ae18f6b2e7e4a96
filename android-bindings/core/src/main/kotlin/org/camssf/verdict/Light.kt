package org.camssf.verdict

import org.camssf.Grid
import org.camssf.Reason
import org.camssf.Rules
import org.camssf.recovery.Choice
import org.camssf.recovery.Hypothesis
import kotlin.math.abs
import kotlin.math.expm1
import kotlin.math.ln
import kotlin.math.max

/**
 * Another lamp in place of a shot's own.
 *
 * @property shot 0-based.
 * @property lamp the other lamp's name.
 * @property gain increase in ln of the marginal likelihood over the named lamp, on the narrowed prior.
 */
internal class Rival(val shot: Int, val lamp: String, val gain: Double)

/** The camera's white (3) under a light of power (681), from a file's colour matrix. */
internal class CameraWhite(val light: DoubleArray, val white: DoubleArray)

/**
 * Checks the named lamp against rival lamps and against the raw white, and an unnamed light against the camera's
 * family (rules 4, 5 and 8 of docs/verdict.md).
 */
internal object Light {
    /** The only cameras that are similar enough to each other to estimate a light. */
    const val PHONES = "phones"

    private val RIVAL get() = Rules.shipped.number("verdict.rival")
    private val OTHER_LAMP_REFUSES get() = Rules.shipped.number("verdict.other_lamp_refuses")
    private val WHITE_BALANCE_MISMATCH get() = Rules.shipped.number("verdict.white_balance_mismatch")
    private val WHITE_BALANCE_MISMATCH_UNNAMED get() = Rules.shipped.number("verdict.white_balance_mismatch_unnamed")

    /** Width of the prior for comparing lamps, relative to that of the answer: the basis was enlarged on purpose. */
    val NARROW get() = Rules.shipped.number("verdict.narrow")

    /** Lamps tried in place of the named one. */
    val RIVALS: List<String> get() = Rules.shipped.rivals

    /** Largest number of shots for which rivals are tried. */
    val MOST_SHOTS_COMPARED: Int get() = Rules.shipped.whole("verdict.most_shots_compared")

    /**
     * Rule 4: finds the best-fitting rival of all shots.
     *
     * @param tintedShots 0-based, shots whose raw white also contradicts the lamp; the rival then refuses above its
     *   limit.
     * @param checks receives the best rival's gain.
     */
    fun rivalLamp(
        rivals: List<Rival>,
        lamps: List<String>,
        tintedShots: List<Int> = emptyList(),
        checks: Checks = Checks(),
    ): List<Reason> {
        val best = rivals.maxByOrNull { it.gain } ?: return emptyList()
        val byWhite = best.shot in tintedShots && best.gain <= OTHER_LAMP_REFUSES
        checks.note("rival", best.gain, best.shot, refuses = RIVAL.takeIf { byWhite })
        if (best.gain <= RIVAL) return emptyList()
        val words = mapOf("shot" to best.shot + 1, "lamp" to lamps[best.shot])
        val fatal = byWhite || best.gain > OTHER_LAMP_REFUSES
        return listOf(Reasons.because("rival", best.gain, words, fatal, RIVAL.takeIf { byWhite }))
    }

    /**
     * Rule 8: an unnamed light can be estimated only if the signals say that the camera is a phone. For other cameras
     * the curves and the light cannot be separated well. The maker's name does not count: it may be missing, unknown,
     * or wrong.
     */
    fun unnamed(choice: List<Hypothesis>, family: String?, checks: Checks = Checks()): List<Reason> {
        val (phones, others) = choice.partition { Choice.MAKERS_OF[it.basis] == PHONES }
        val own = phones.sumOf { it.probability }
        // The odds of the maker's name are in the probabilities.
        val name = when (family) {
            null -> 1.0
            PHONES -> Choice.MAKER
            else -> 1.0 / Choice.MAKER
        }
        val phone = own / (own + others.sumOf { it.probability } * name)
        val number = Rules.shipped::number
        checks.note("unnamed", phone)
        if (phone >= number("verdict.unnamed")) return emptyList()
        return listOf(Reasons.because("unnamed", phone, emptyMap(), phone < number("verdict.unnameable")))
    }

    /**
     * Rule 5: compares the raw white of shot j, 0-based, with the file's colour matrix, by the answer to that shot
     * alone.
     *
     * @param lamp its name as given, or the kind of the light that was estimated.
     * @param unnamed whether its light is unnamed; then the limit is that for an estimated light.
     */
    fun whiteBalanceMismatch(
        j: Int,
        lamp: String,
        unnamed: Boolean,
        neutrals: List<CameraWhite>,
        inputs: VerdictInputs,
        checks: Checks,
    ): List<Reason> {
        val limit = if (unnamed) WHITE_BALANCE_MISMATCH_UNNAMED else WHITE_BALANCE_MISMATCH
        val curves = inputs.ssf
        val raw = inputs.signals.rawWhite(0)
        fun seen(light: DoubleArray, channel: Int) =
            (0 until Grid.SIZE).sumOf { light[it] * curves.sharedValues[3 * it + channel] }
        val off = neutrals.mapNotNull { neutral ->
            val expected = DoubleArray(3) { channel ->
                neutral.white[channel] * seen(curves.sharedLamp, channel) / seen(neutral.light, channel)
            }
            // No valid prediction of the white: other rules report such curves.
            if (expected.any { !(it > 0) }) return@mapNotNull null
            val ratio = DoubleArray(3) { ln(raw[it] / expected[it]) }
            max(abs(ratio[0] - ratio[1]), abs(ratio[2] - ratio[1]))
        }.minOrNull()
        if (off != null) checks.note("white_balance_mismatch", off, j, limit)
        if (off == null || off <= limit) return emptyList()
        val words = mapOf("shot" to j + 1, "share" to expm1(off), "lamp" to lamp)
        return listOf(Reasons.because("tint", off, words, threshold = limit))
    }
}
