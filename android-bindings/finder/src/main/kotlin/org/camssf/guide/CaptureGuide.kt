package org.camssf.guide

import org.camssf.InvalidArgument
import org.camssf.finder.ChartFinder
import org.camssf.finder.Finding
import org.camssf.finder.Found
import org.camssf.finder.Picture
import org.camssf.spectra.ChartTable
import kotlin.math.log2

/**
 * Guides a user who photographs a chart: it takes preview frames, gives one line of advice, and says "now" when all
 * conditions hold.
 *
 * Frames must come from one camera, 640 × 480 or larger, not rotated and not mirrored, at 5 to 60 frames per second.
 * Each measure is the median of five frames with hysteresis, and new advice must last four frames (two after
 * [Advice.NO_CHART]) before it is given. Only "now" ends at once.
 *
 * The guide never refuses a capture, because the preview is not the RAW photo. It cannot detect the lamp's spectrum,
 * light from behind the camera, or a printed copy of the chart.
 *
 * Use one guide for one stream of frames, on one thread at a time. It keeps arrays but no frame, holds nothing that
 * must be closed, and uses no class of Android.
 *
 * @param focal focal length of the lens / longer side of the picture on the sensor, for the tilt: 0.75 is the main
 *   camera of an ordinary phone (26 mm on film). In Camera2: LENS_INFO_AVAILABLE_FOCAL_LENGTHS / width of
 *   SENSOR_INFO_PHYSICAL_SIZE.
 * @param chart the only chart to look for; without it, any of the shipped ones.
 * @throws InvalidArgument the focal length is not between 0.2 and 20.
 */
public class CaptureGuide @JvmOverloads constructor(focal: Double = 0.75, chart: ChartTable? = null) {
    private val finder = if (chart == null) ChartFinder() else ChartFinder(chart)
    private val meter: FrameMeter
    private val motion = Motion()

    private val margin = Steady(Limits.MARGIN)
    private val size = Steady(Limits.SIZE)
    private val tilt = Steady(Limits.TILT)
    private val speed = Steady(Limits.SPEED)
    private val dark = Steady(Limits.DARK)
    private val bright = Steady(Limits.BRIGHT)
    private val clipped = Steady(Limits.CLIPPED)
    private val blur = Steady(Limit(1.0, Limits.BLUR_PIXELS.end / Limits.BLUR_PIXELS.begin))
    private val glare = Steady(Limits.GLARE)
    private val veil = Steady(Limits.VEIL)
    private val shadow = Steady(Limits.SHADOW)
    private val gradient = Steady(Limits.GRADIENT)
    private val tint = Steady(Limits.TINT)
    private val all =
        listOf(margin, size, tilt, speed, dark, bright, clipped, blur, glare, veil, shadow, gradient, tint)

    private var said = Advice.NO_CHART
    private var waiting = Advice.NO_CHART
    private var waited = 0
    private var lost = Limits.LOST
    private var held = 0
    private var softness = 0.0
    private var shining = 0
    private var patches = 0

    init {
        if (!(focal > 0.2 && focal < 20)) {
            throw InvalidArgument(
                "A focal length of $focal picture widths.",
                "Give it in longer sides of the picture, as 0.75.",
            )
        }
        meter = FrameMeter(focal)
    }

    /**
     * Finds the chart in a frame and gives advice.
     *
     * @param frame read before this returns; its image can be closed then.
     * @param time time of the frame, ns, from `Image.getTimestamp` or any clock.
     * @throws InvalidArgument the picture does not consist of 8-bit planes.
     */
    public fun look(frame: Picture, time: Long): Guidance = take(frame, finder.find(frame), time)

    /**
     * The same as [look] for a frame that the app has already searched.
     *
     * @throws InvalidArgument the picture does not consist of 8-bit planes.
     */
    public fun take(frame: Picture, found: Found, time: Long): Guidance {
        val candidate = found.candidate?.takeIf { it.confidence >= Limits.CONFIDENCE }
        val plane = candidate?.let { ChartPlane.of(it) }
        if (candidate == null || plane == null) return missed()
        if (lost >= Limits.LOST) forget()
        lost = 0
        val measures = meter.measure(frame, candidate, plane, motion.speed(candidate, time, plane.pitch))
        keep(measures)
        val due = when {
            candidate.mirrored || Finding.MIRRORED in found.findings -> Advice.MIRRORED
            Finding.TWO_CHARTS in found.findings -> Advice.TWO_CHARTS
            else -> due()
        }
        held = if (due == Advice.STEADY && measures.speed != null) held + 1 else 0
        return say(if (held >= Limits.HELD) Advice.NOW else due, measures)
    }

    /** Restarts the guide, for example for another camera. */
    public fun reset() {
        forget()
        said = Advice.NO_CHART
        waited = 0
        lost = Limits.LOST
    }

    private fun forget() {
        all.forEach { it.forget() }
        motion.forget()
        held = 0
    }

    private fun missed(): Guidance {
        held = 0
        lost++
        if (lost >= Limits.LOST) {
            said = Advice.NO_CHART
            waited = 0
        } else if (said == Advice.NOW) {
            said = Advice.STEADY
        }
        return Guidance.Searching(said, amount(said))
    }

    private fun keep(found: FrameMeasures) {
        softness = found.blur ?: softness
        if (found.glare.isNotEmpty()) shining = found.glare.size
        patches = found.candidate.patches.size
        margin.take(found.margin)
        size.take(found.size)
        tilt.take(found.tilt)
        speed.take(found.speed)
        dark.take(found.white)
        bright.take(found.white)
        clipped.take(found.clipped)
        val most = maxOf(Limits.BLUR_PIXELS.begin, Limits.BLUR_PITCHES.begin * found.pitch)
        blur.take(found.blur?.let { it / most })
        glare.take(found.glare.size.toDouble())
        veil.take(found.veil)
        shadow.take(found.shadow)
        gradient.take(found.gradient)
        tint.take(found.tint)
    }

    /**
     * The advice for the current measures, the most urgent first: later conditions cannot be judged before the
     * earlier ones hold.
     */
    private fun due(): Advice = when {
        margin.bad -> Advice.CUT
        size.bad -> Advice.TOO_FAR
        tilt.bad -> Advice.TILTED
        speed.bad -> Advice.MOVING
        clipped.bad || bright.bad -> Advice.TOO_BRIGHT
        dark.bad -> Advice.TOO_DARK
        blur.bad -> Advice.OUT_OF_FOCUS
        glare.bad || veil.bad -> Advice.GLARE
        shadow.bad -> Advice.SHADOW
        gradient.bad -> Advice.UNEVEN
        tint.bad -> Advice.TINTED
        else -> Advice.STEADY
    }

    private fun amount(advice: Advice): Double = when (advice) {
        Advice.TOO_FAR -> Limits.GOOD_SIZE / maxOf(size.value, 1e-3)
        Advice.TILTED -> tilt.value
        Advice.MOVING -> speed.value
        Advice.TOO_DARK -> log2(Limits.GOOD_WHITE / maxOf(dark.value, 1e-4))
        Advice.TOO_BRIGHT -> maxOf(0.5, log2(bright.value / Limits.GOOD_WHITE))
        Advice.OUT_OF_FOCUS -> softness
        Advice.GLARE -> (if (veil.bad) patches else shining).toDouble()
        Advice.SHADOW -> shadow.value
        Advice.UNEVEN -> gradient.value
        Advice.TINTED -> tint.value
        else -> 0.0
    }

    /** Updates the advice: "now" begins and ends at once; other advice must have lasted some frames. */
    private fun say(due: Advice, measures: FrameMeasures): Guidance {
        if (due != waiting) {
            waiting = due
            waited = 0
        }
        waited++
        val first = said == Advice.NO_CHART
        when {
            due == Advice.NOW -> said = due
            said == Advice.NOW -> said = Advice.STEADY
        }
        if (due != said && (waited >= Limits.PATIENCE || (first && waited >= 2))) said = due
        return Guidance.Measured(said, amount(said), measures)
    }
}
