package org.camssf.verdict

import org.camssf.Grid
import org.camssf.Rules
import org.camssf.recovery.Choice
import org.camssf.recovery.Hypothesis
import kotlin.math.abs
import kotlin.math.exp
import kotlin.math.expm1
import kotlin.math.ln
import kotlin.math.max

/**
 * Another lamp in place of a shot's own.
 *
 * @property shot 0-based.
 * @property gain of ln of the marginal likelihood over the named lamp's, on the narrowed prior.
 */
internal class Rival(val shot: Int, val lamp: String, val gain: Double)

/** The camera's white (3) under a light of power (681), as a file's colour matrix tells it. */
internal class Foretold(val light: DoubleArray, val white: DoubleArray)

/** What speaks against the lamp that was named, or against that it was not: rules 4, 5 and 8 of docs/verdict.md. */
internal object Light {
    /** The one basis whose cameras are alike enough to tell a light by. */
    private const val PHONES = "phones"

    private val RIVAL get() = Rules.shipped.number("verdict.rival")
    private val CONDEMNED get() = Rules.shipped.number("verdict.condemned")
    private val TINTED get() = Rules.shipped.number("verdict.tinted")
    private val TINTED_UNNAMED get() = Rules.shipped.number("verdict.tinted_unnamed")

    /** How probable it is beforehand that a lamp is named wrongly. */
    private val MISNAMED get() = Rules.shipped.number("verdict.misnamed")

    /** Lamps are compared by cameras that spread so much less than their basis, which was enlarged on purpose. */
    val NARROW get() = Rules.shipped.number("verdict.narrow")

    /** Lamps tried in the place of the named one. */
    val RIVALS: List<String> get() = Rules.shipped.rivals

    /** Shots of a capture beyond which rivals are not tried. */
    val MOST_RIVALLED: Int get() = Rules.shipped.whole("verdict.most_rivalled")

    /**
     * Rule 4: of all shots and lamps the one that fits best, and how probable it is that a named lamp is wrong.
     *
     * @param tintedShots those whose raw white contradicts the lamp, too: with two witnesses it is refused.
     * @param checks told of the best.
     */
    fun rivalLamp(
        rivals: List<Rival>,
        lamps: List<String>,
        tintedShots: List<Int> = emptyList(),
        checks: Checks = Checks(),
    ): List<Reason> {
        val best = rivals.maxByOrNull { it.gain } ?: return emptyList()
        checks.note("rival", best.gain, best.shot)
        if (best.gain <= RIVAL) return emptyList()
        val own = rivals.filter { it.shot == best.shot }
        // e^gain overflows beyond 709: the mean as a multiple of the best one's.
        val rest = own.sumOf { exp(it.gain - best.gain) } / own.size * MISNAMED / (1.0 - MISNAMED)
        val words = mapOf(
            "shot" to "shot ${best.shot + 1}",
            "rival" to best.lamp,
            "lamp" to lamps[best.shot],
            "probability" to rest / (rest + exp(-best.gain)),
        )
        val alone = best.gain > CONDEMNED
        val fatal = alone || best.shot in tintedShots
        return listOf(Reasons.because("rival", best.gain, words, fatal, if (fatal && !alone) RIVAL else null))
    }

    /**
     * A camera that may be no phone, in a light that nobody named: its curves and the light look too much alike.
     *
     * Nearly all makers of phones are known by name, so a file that names none of them is taken for a camera's, and must
     * speak as clearly for a phone as a basis that answers alone.
     */
    fun unnamed(choice: List<Hypothesis>, family: String?, checks: Checks = Checks()): List<Reason> {
        var phone = choice.sumOf { if (it.basis == PHONES) it.probability else 0.0 }
        val rest = choice.sumOf { if (it.basis != PHONES) it.probability else 0.0 }
        // Else the odds hold the maker's word, or there was no choice.
        if (family == null && rest > 0) phone /= phone + Choice.CLEAR * rest
        val number = Rules.shipped::number
        val bound = if (family == PHONES) number("verdict.unnamed") else Choice.CLEAR / (1.0 + Choice.CLEAR)
        checks.note("unnamed", phone, limit = bound)
        if (phone >= bound) return emptyList()
        val fatal = phone < number("verdict.unnameable")
        val words = mapOf("probability" to phone)
        val name = if (family == null && phone > 0) "no_maker" else "unnamed"
        return listOf(Reasons.because(name, phone, words, fatal, if (fatal) null else bound))
    }

    /**
     * Rule 5 of shot j, 0-based, by the answer to that shot alone.
     *
     * @param unnamed nobody named its light, so that the limit is that of an estimated one.
     */
    fun tinted(
        j: Int,
        unnamed: Boolean,
        foretold: List<Foretold>,
        told: VerdictInputs,
        checks: Checks,
    ): List<Reason> {
        val limit = if (unnamed) TINTED_UNNAMED else TINTED
        val signals = told.signals
        val patches = used(signals, 0)
        val curves = told.ssf
        val raw = DoubleArray(3) { channel ->
            patches.sumOf { signals.sharedWhite[3 * it + channel] - signals.sharedDark[3 * it + channel] } /
                patches.size
        }
        fun seen(light: DoubleArray, channel: Int) =
            (0 until Grid.SIZE).sumOf { light[it] * curves.sharedValues[3 * it + channel] }
        val off = foretold.mapNotNull { neutral ->
            val expected = DoubleArray(3) { channel ->
                neutral.white[channel] * seen(curves.sharedLamp, channel) / seen(neutral.light, channel)
            }
            // Curves that foretell no white: other rules see to them.
            if (expected.any { !(it > 0) }) return@mapNotNull null
            val ratio = DoubleArray(3) { ln(raw[it] / expected[it]) }
            max(abs(ratio[0] - ratio[1]), abs(ratio[2] - ratio[1]))
        }.minOrNull()
        if (off != null) checks.note("tinted", off, j, limit)
        if (off == null || off <= limit) return emptyList()
        val words = mapOf("shot" to "shot ${j + 1}", "share" to expm1(off), "lamp" to told.lamps[0].name)
        return listOf(Reasons.because("tint", off, words, threshold = limit))
    }
}
