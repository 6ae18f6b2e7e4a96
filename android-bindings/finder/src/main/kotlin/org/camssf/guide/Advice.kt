package org.camssf.guide

import kotlin.math.abs
import kotlin.math.max
import kotlin.math.roundToInt

/**
 * The one thing to do next, the most urgent first.
 *
 * [words] gives a sentence for the user; an app with its own wording uses [name] and [Guidance.amount] instead.
 *
 * @property unit unit of [Guidance.amount]; empty if the amount has no meaning.
 */
public enum class Advice(public val unit: String) {
    /** No chart is in view. */
    NO_CHART(""),

    /** The chart is seen in a mirror, or the app gives frames that are already mirrored. */
    MIRRORED(""),

    /** More than one chart is in view, so the intended one is unknown. */
    TWO_CHARTS(""),

    /** The chart reaches the picture's border. */
    CUT(""),

    /** The chart is too small; the amount is the factor by which the camera should come nearer. */
    TOO_FAR("times"),

    /** The camera looks at the chart obliquely; the amount is the angle. */
    TILTED("degrees"),

    /** Camera or chart move; the amount is the speed, in distances between neighbouring patches per second. */
    MOVING("pitches a second"),

    /** The exposure is too low; the amount is the number of stops to add. */
    TOO_DARK("stops"),

    /** The exposure is too high; the amount is the number of stops to remove. */
    TOO_BRIGHT("stops"),

    /** The borders of the patches are blurred; the amount is the blur's standard deviation. */
    OUT_OF_FOCUS("px"),

    /** Patches have glare; the amount is their number. */
    GLARE("patches"),

    /** The edge of a shadow crosses the chart; the amount is how much darker the shadow is. */
    SHADOW("stops"),

    /**
     * The light falls off across the chart; the amount is the difference between the brightest and the darkest
     * corner.
     */
    UNEVEN("stops"),

    /** Coloured surroundings colour the light; the amount is their colourfulness, as a share of white. */
    TINTED("share of white"),

    /** All conditions hold, but not yet for long enough. */
    STEADY(""),

    /** All conditions have held for some frames: take the photo. */
    NOW(""),
    ;

    /** One line for the user, including the amount. */
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

    /** In half stops: an exposure that is set by hand needs no finer steps. */
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
 * The advice to show now: [Searching] if no chart was found in the latest frame, [Measured] otherwise.
 *
 * @property advice the one thing to do, stable for some frames.
 * @property amount in [Advice.unit], from the latest frames; 0 if there is none.
 */
public sealed class Guidance(public val advice: Advice, public val amount: Double) {
    /** One line for the user. */
    public val words: String get() = advice.words(amount)

    override fun toString(): String = words

    /** No chart was found in the latest frame; for some frames [advice] is still that of the frames before. */
    public class Searching internal constructor(advice: Advice, amount: Double) : Guidance(advice, amount)

    /**
     * A chart was found and measured in the latest frame.
     *
     * @property measures of that frame alone, not smoothed.
     */
    public class Measured internal constructor(
        advice: Advice,
        amount: Double,
        public val measures: FrameMeasures,
    ) : Guidance(advice, amount) {
        /** True if all conditions have held for some frames, [Advice.NOW]: take the photo. */
        public val ready: Boolean get() = advice == Advice.NOW

        override fun toString(): String = "$words $measures"
    }
}

/** Receives each frame's guidance. */
public fun interface GuidanceListener {
    /** Called once for each frame that was looked at. */
    public fun guide(guidance: Guidance)
}
