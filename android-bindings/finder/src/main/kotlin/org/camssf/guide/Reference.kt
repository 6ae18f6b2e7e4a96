package org.camssf.guide

import org.camssf.finder.ChartKind
import kotlin.math.ln
import kotlin.math.max
import kotlin.math.min

/**
 * Known luminances and colours of the patches of a kind of chart.
 *
 * @property luminance luminance of each patch, 0 to 1.
 */
internal class Reference private constructor(val luminance: DoubleArray, colours: DoubleArray) {
    /** Indices of the white and the black patch. */
    val white = luminance.indices.maxBy { luminance[it] }
    val black = luminance.indices.minBy { luminance[it] }

    /** 1 - smallest / largest of red, green and blue, for each patch. */
    val colourfulness = DoubleArray(luminance.size) {
        val red = colours[3 * it]
        val green = colours[3 * it + 1]
        val blue = colours[3 * it + 2]
        1 - min(min(red, green), blue) / max(max(red, green), blue)
    }

    /** ln of [luminance] relative to a middle grey of 0.2. */
    val tone = DoubleArray(luminance.size) { ln(luminance[it] / 0.2) }

    companion object {
        /** The reference of a kind of chart; null where finder.json has no luminances, as for the SG. */
        fun of(kind: ChartKind): Reference? = kind.shape.run { luminance?.let { Reference(it, colours) } }
    }
}
