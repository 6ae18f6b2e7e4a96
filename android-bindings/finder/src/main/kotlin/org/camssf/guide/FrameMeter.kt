package org.camssf.guide

import org.camssf.finder.Candidate
import org.camssf.finder.ChartKind
import org.camssf.finder.Picture
import kotlin.math.max

/** Measures one frame, given its candidate. The arrays for each kind of chart are reused from frame to frame. */
internal class FrameMeter(private val focal: Double) {
    private class Kept(kind: ChartKind) {
        val light = PatchLight(kind.columns, kind.rows)
        val reference = Reference.of(kind)
        val evenness = Evenness(kind, reference)
    }

    private val kept = HashMap<ChartKind, Kept>()
    private val sharpness = Sharpness()

    /** The measures of a frame, in which the candidate lies in this plane. */
    fun measure(picture: Picture, candidate: Candidate, plane: ChartPlane, speed: Double?): FrameMeasures {
        val pixels = Pixels(picture)
        val own = kept.getOrPut(candidate.kind) { Kept(candidate.kind) }
        val light = own.light
        light.read(pixels, plane)
        val reference = own.reference
        val brightest = reference?.white ?: light.level.indices.maxByOrNull { light.level[it] }!!
        val clipped = light.clipped[brightest]
        val white = white(light, reference, brightest)
        own.evenness.look(light, white)
        val grey = grey(light, brightest)
        val factor = if (reference == null || grey == brightest) {
            light.level[grey] / max(white, 1e-9)
        } else {
            reference.luminance[grey] / reference.luminance[brightest]
        }
        val longer = max(picture.width, picture.height)
        return FrameMeasures(
            candidate = candidate,
            size = plane.longest / longer,
            margin = plane.margin(picture.width, picture.height),
            tilt = plane.tilt(picture.width, picture.height, focal * longer),
            speed = speed,
            white = white,
            clipped = clipped,
            blur = sharpness.look(pixels, plane, light, white),
            glare = own.evenness.glare,
            veil = own.evenness.veil,
            shadow = own.evenness.shadow,
            gradient = own.evenness.gradient,
            tint = Surroundings.tint(pixels, plane, light, grey, factor),
            pitch = plane.pitch,
        )
    }

    /**
     * Level of the white patch; if it is clipped, at least the median of its estimates from patches brighter than
     * dark grey.
     */
    private fun white(light: PatchLight, reference: Reference?, index: Int): Double {
        if (reference == null || light.clipped[index] < Limits.CLIPPED.end) return light.level[index]
        val estimates = (0 until light.count).filter {
            light.clipped[it] < Limits.CLIPPED.end && reference.luminance[it] > 0.08
        }.map { light.level[it] * reference.luminance[index] / reference.luminance[it] }.sorted()
        return max(light.level[index], if (estimates.isEmpty()) CLIPPED_ALL else estimates[estimates.size / 2])
    }

    /**
     * Index of the white patch, or if that is clipped, of the next grey patch that is not: the 24 patches have them
     * in sequence.
     */
    private fun grey(light: PatchLight, white: Int): Int =
        (white until minOf(white + 3, light.count)).firstOrNull { light.clipped[it] < 0.02 } ?: white

    private companion object {
        /** Level if all patches are clipped: two stops too bright, after which the next frame shows more. */
        const val CLIPPED_ALL = 4 * Limits.GOOD_WHITE
    }
}
