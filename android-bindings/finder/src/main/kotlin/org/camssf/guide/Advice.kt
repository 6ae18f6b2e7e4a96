package org.camssf.guide

import kotlin.math.abs
import kotlin.math.max
import kotlin.math.roundToInt

/**
 * The one thing to do next, the most urgent first. [words] are all that this library says to the person who holds the
 * phone; an app with words of its own takes [name] and [Guidance.amount].
 *
 * @property unit of [Guidance.amount]; empty where it means nothing.
 */
public enum class Advice(public val unit: String) {
    /** No chart is in view. */
    NO_CHART(""),

    /** It is seen in a mirror, or the app gives frames that are mirrored already. */
    MIRRORED(""),

    /** More than one chart is in view, and it cannot be known which is meant. */
    TWO_CHARTS(""),

    /** It reaches the picture's border. */
    CUT(""),

    /** It is too small; the amount is by how many times nearer the camera should come. */
    TOO_FAR("times"),

    /** The camera looks at it from aside; the amount is the angle. */
    TILTED("degrees"),

    /** Camera or chart move; the amount is in distances from patch to patch, a second. */
    MOVING("pitches a second"),

    /** The amount is how many stops more light the exposure should let in. */
    TOO_DARK("stops"),

    /** The amount is how many stops less light the exposure should let in. */
    TOO_BRIGHT("stops"),

    /** Borders are soft; the amount is the blur's standard deviation. */
    OUT_OF_FOCUS("px"),

    /** Something shines on patches; the amount is on how many. */
    GLARE("patches"),

    /** A shadow's edge crosses the chart; the amount is how much darker it is there. */
    SHADOW("stops"),

    /** The light falls off across the chart; the amount is from the brightest to the darkest corner. */
    UNEVEN("stops"),

    /** Something coloured around colours the light; the amount is how much, as a share of white. */
    TINTED("share of white"),

    /** All holds, not yet long enough. */
    STEADY(""),

    /** All has held for some frames: take the photo. */
    NOW(""),
    ;

    /** One line for the person, with the amount in it. */
    public fun words(amount: Double): String = when (this) {
        NO_CHART -> "Point the camera at the chart, all of it in view."
        MIRRORED -> "The chart is seen in a mirror: photograph the chart itself."
        TWO_CHARTS -> "Two charts are in view: take one away."
        CUT -> "The chart touches the picture's border: move back, or bring it to the middle."
        TOO_FAR -> "Come nearer, about ${tenths(amount)} times as near."
        TILTED -> "Look straight at the chart: it is tilted by ${amount.roundToInt()}°."
        MOVING -> "Hold still."
        TOO_DARK -> "Too dark: expose ${stops(amount)} more."
        TOO_BRIGHT -> "Too bright: expose ${stops(amount)} less."
        OUT_OF_FOCUS -> "Focus on the chart."
        GLARE -> "Something shines on ${count(amount)}: turn the chart or move the lamp aside."
        SHADOW -> "A shadow lies on part of the chart, ${stops(amount)} darker: step out of the light."
        UNEVEN -> "The light falls off by ${stops(amount)} across the chart: move the lamp away."
        TINTED -> "Something coloured is near: take it away, or turn to something grey."
        STEADY -> "Good. Hold still."
        NOW -> "Now."
    }

    private fun tenths(amount: Double): String = "${(10 * amount).roundToInt() / 10.0}"

    /** In halves: nobody sets an exposure finer by hand. */
    private fun stops(amount: Double): String {
        val halves = max(1, (2 * abs(amount)).roundToInt())
        val text = if (halves % 2 == 0) {
            "${halves / 2}"
        } else if (halves == 1) {
            "half a"
        } else {
            "${halves / 2}½"
        }
        return if (halves <= 2) "$text stop" else "$text stops"
    }

    private fun count(amount: Double): String =
        if (amount.roundToInt() <= 1) "a patch" else "${amount.roundToInt()} patches"
}

/**
 * What to say now.
 *
 * @property advice one thing, the same for some frames.
 * @property amount in [Advice.unit], of the latest frames; 0 where there is none.
 * @property measured the latest frame's own numbers, before any smoothing; null where no chart was found in it.
 */
public class Guidance internal constructor(
    public val advice: Advice,
    public val amount: Double,
    public val measured: FrameMeasures?,
) {
    /** One line for the person. */
    public val words: String get() = advice.words(amount)
}
