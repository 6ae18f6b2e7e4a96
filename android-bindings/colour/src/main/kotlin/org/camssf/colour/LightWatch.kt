package org.camssf.colour

import org.camssf.ColourOutOfReach
import org.camssf.FramesDiffer
import org.camssf.InvalidArgument
import org.camssf.Reason
import org.camssf.Refusal
import org.camssf.Rules
import org.camssf.Underexposed
import org.camssf.UnitDiffers
import org.camssf.frozen
import kotlin.math.exp
import kotlin.math.ln

/**
 * Colours of one live frame, and what is known of its light.
 *
 * @property colours one for each region; none if the light has changed.
 * @property guidance what the user should do about the light, the most urgent first; empty if there is nothing to do.
 * @property chiSquared χ² of the white's raw ratios against those of the reference, two degrees of freedom; null
 *   without a white.
 * @property level of the light at the white over that at the reference, for which the colours are corrected; null
 *   without a white.
 */
public class LiveColours internal constructor(
    public val colours: List<StandardColour>,
    public val guidance: List<Reason>,
    public val chiSquared: Double?,
    public val level: Double?,
) {
    override fun toString(): String = "LiveColours($colours, $guidance)"
}

/**
 * Measures regions of live RAW frames as long as the light is that of the standardiser's reference, and says when it is
 * not.
 *
 * The white's raw red and blue over green are compared with those of the reference, by χ² with the noise of both and the
 * reference's tolerance. Above `colour.contradicted` of rules.json the light has changed. A change of its level alone
 * is corrected by the white.
 *
 * ```kotlin
 * fun live(watch: LightWatch, frame: Mosaic, whiteArea: Region, stripArea: Region): String {
 *     val (white, strip) = RawRegion.measure(frame, listOf(whiteArea, stripArea))
 *     val found = watch.look(listOf(strip), white)
 *     return found.guidance.firstOrNull()?.let { "${it.message} ${it.advice}" } ?: "${found.colours.single().lab}"
 * }
 * ```
 *
 * Frames of a preview in YUV or RGB are processed by the camera and cannot be measured. Immutable; safe to share between
 * threads. Threads: any but the main one.
 *
 * @property standardiser of the light; make both again after the light has changed.
 */
public class LightWatch(public val standardiser: Standardiser) {
    private val reference = standardiser.reference
    private val start = WhiteRatios.of(reference, reference.tolerance / 2)

    /** What to do if this is not the light of the calibration, and its lamp was not named; null otherwise. */
    private val ofCalibration: Reason? = standardiser.camera.ownWhite?.let { own ->
        val change = start.since(WhiteRatios(own.raw, DoubleArray(3), WhiteSignal.OWN_WHITE))
        if (standardiser.lamps.size == 1 || change.chiSquared <= WhiteRatios.CONTRADICTED) {
            null
        } else {
            Refusal.of(
                "lamp_unfit.uncalibrated_light", "red" to change.red, "blue" to change.blue,
                value = change.chiSquared, threshold = WhiteRatios.CONTRADICTED,
            ).reason
        }
    }

    override fun toString(): String = "LightWatch($standardiser)"

    /**
     * The colours of regions of one frame. Signals of another exposure than the reference's are scaled as in
     * [Standardiser.colourOf].
     *
     * @param regions measured in the frame.
     * @param white the surface of the standardiser's reference in the same frame; null if it is not in view. Then the
     *   light is taken to be unchanged, in level too, and the guidance says so.
     * @throws ColourOutOfReach no surface can have the colour of a region under this lamp.
     * @throws FramesDiffer another camera than the result's or the reference's, or a frame of another exposure that
     *   does not state it.
     * @throws UnitDiffers another physical camera or lens.
     * @throws Underexposed the white is too dark: below ten standard errors.
     * @throws InvalidArgument another lens shading than the reference's.
     */
    @JvmOverloads
    public fun look(regions: List<RawRegion>, white: RawRegion? = null): LiveColours {
        if (white == null) {
            return LiveColours(colours(regions, reference), listOfNotNull(ofCalibration, UNSEEN).frozen(), null, null)
        }
        if (!isLit(white.sharedRaw, white.sharedError)) {
            throw Refusal.of("underexposed.live_white", "file" to white.source.photo.name)
        }
        val seen = Reference(white, reference.reflectance, reference.tolerance)
        val level = standardiser.factor(white.source) * seen.sharedRaw[1] / reference.sharedRaw[1]
        // It is one surface: its tolerance is that of both.
        val change = WhiteRatios.of(seen, 0.0).since(start)
        if (change.chiSquared <= WhiteRatios.CONTRADICTED) {
            return LiveColours(
                colours(regions, seen), listOfNotNull(ofCalibration).frozen(), change.chiSquared, level,
            )
        }
        val changed = Refusal.of(
            "lamp_unfit.light_changed", "red" to change.red, "blue" to change.blue, value = change.chiSquared,
            threshold = WhiteRatios.CONTRADICTED,
        )
        return LiveColours(emptyList(), listOf(changed.reason).frozen(), change.chiSquared, level)
    }

    private fun colours(regions: List<RawRegion>, white: Reference): List<StandardColour> =
        regions.map { standardiser.colourOf(it, white) }.frozen()

    private companion object {
        val UNSEEN: Reason = Refusal.of("lamp_unfit.white_unseen").reason
    }
}

/**
 * ln of a white's raw red and blue over its green.
 *
 * @param raw (3) of the white.
 * @param standardError (3) of `raw`.
 * @param ratioError one standard deviation of each ratio by other causes than noise.
 */
internal class WhiteRatios(raw: DoubleArray, standardError: DoubleArray, ratioError: Double) {
    private val red = ln(raw[0] / raw[1])
    private val blue = ln(raw[2] / raw[1])
    private val noise = DoubleArray(3) { standardError[it] / raw[it] * (standardError[it] / raw[it]) }
    private val ofRed = noise[0] + noise[1] + ratioError * ratioError
    private val ofBlue = noise[2] + noise[1] + ratioError * ratioError

    /** Relative change of the two ratios, and its χ² with two degrees of freedom. */
    class Change(val red: Double, val blue: Double, val chiSquared: Double)

    /** The change since an earlier white, whose errors are independent of these. */
    fun since(earlier: WhiteRatios): Change {
        val (r, b) = red - earlier.red to blue - earlier.blue
        val (rr, bb) = ofRed + earlier.ofRed to ofBlue + earlier.ofBlue
        val rb = noise[1] + earlier.noise[1] // green is in both ratios
        val chiSquared = (bb * r * r - 2 * rb * r * b + rr * b * b) / (rr * bb - rb * rb)
        return Change(exp(r) - 1, exp(b) - 1, chiSquared)
    }

    companion object {
        /**
         * χ² of a white's two raw ratios above which its light is not the named or the earlier one; chance exceeds it
         * once in 10,000.
         */
        val CONTRADICTED get() = Rules.shipped.number("colour.contradicted")

        fun of(reference: Reference, ratioError: Double): WhiteRatios =
            WhiteRatios(reference.sharedRaw, reference.sharedError, ratioError)
    }
}
