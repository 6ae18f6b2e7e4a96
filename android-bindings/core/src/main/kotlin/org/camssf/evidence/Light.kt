package org.camssf.evidence

import org.camssf.Grid
import org.camssf.Rules
import kotlin.math.abs
import kotlin.math.expm1
import kotlin.math.ln
import kotlin.math.max

/** T₄ with another lamp in place of a shot's own. */
internal class Rival(val shot: Int, val lamp: String, val weighted: Double)

/** The camera's white (3) under a light of power (681), as a file's colour matrix tells it. */
internal class Foretold(val light: DoubleArray, val white: DoubleArray)

/** What speaks against the lamp that was named: rules 4 and 5 of docs/verdict.md. */
internal object Light {
    private val RIVAL get() = Rules.shipped.number("verdict.rival")
    private val CONDEMNED get() = Rules.shipped.number("verdict.condemned")
    private val TINTED get() = Rules.shipped.number("verdict.tinted")

    /** Lamps tried in the place of the named one. */
    val RIVALS: List<String> get() = Rules.shipped.rivals

    /** Shots of a capture beyond which rivals are not tried. */
    val MOST_RIVALLED: Int get() = Rules.shipped.whole("verdict.most_rivalled")

    /** Rule 4: of all shots and lamps the one that fits best. */
    fun rivalled(rivals: List<Rival>, lamps: List<String>, weighted: Double): List<Reason> {
        val best = rivals.minByOrNull { it.weighted } ?: return emptyList()
        val gain = weighted - best.weighted
        if (gain <= RIVAL) return emptyList()
        val words = mapOf("shot" to "shot ${best.shot + 1}", "rival" to best.lamp, "lamp" to lamps[best.shot])
        return listOf(Reasons.because("rival", gain, words, gain > CONDEMNED))
    }

    /** Rule 5, by the answer to that shot alone. */
    fun tinted(name: String, lamp: String, foretold: List<Foretold>, told: Told): List<Reason> {
        val signals = told.signals
        val patches = used(signals, 0)
        val curves = told.ssf
        val raw = DoubleArray(3) { channel ->
            patches.sumOf { signals.sharedWhite[3 * it + channel] - signals.sharedDark[3 * it + channel] } /
                patches.size
        }
        fun seen(light: DoubleArray, channel: Int) =
            (0 until Grid.SIZE).sumOf { light[it] * curves.sharedValues[3 * it + channel] }
        val off = foretold.minOfOrNull { neutral ->
            val ratio = DoubleArray(3) { channel ->
                val expected =
                    neutral.white[channel] * seen(curves.sharedLamp, channel) / seen(neutral.light, channel)
                ln(raw[channel] / expected)
            }
            max(abs(ratio[0] - ratio[1]), abs(ratio[2] - ratio[1]))
        }
        if (off == null || off <= TINTED) return emptyList()
        return listOf(Reasons.because("tint", off, mapOf("shot" to name, "share" to expm1(off), "lamp" to lamp)))
    }
}
