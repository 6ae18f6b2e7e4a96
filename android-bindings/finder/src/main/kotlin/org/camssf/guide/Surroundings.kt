package org.camssf.guide

/** How coloured that is which lies around the chart, seen in the chart's own light. */
internal object Surroundings {
    private const val ACROSS = 40
    private const val DOWN = 30

    /** Pitches from the outer patches' centres: the chart's own frame counts neither. */
    private const val BEYOND = 1.2
    private const val FEWEST = 60

    /**
     * Most less least channel of the mean, the chart's white patch being 1.
     *
     * @param grey index of a neutral patch that is not clipped.
     * @param factor its luminance over the white patch's.
     */
    fun tint(pixels: Pixels, plane: ChartPlane, light: PatchLight, grey: Int, factor: Double): Double? {
        if (!pixels.hasColour) return null
        var (red, green, blue) = Triple(0.0, 0.0, 0.0)
        var seen = 0
        for (j in 0 until DOWN) {
            for (i in 0 until ACROSS) {
                val x = (2 * i + 1) * pixels.width / (2 * ACROSS)
                val y = (2 * j + 1) * pixels.height / (2 * DOWN)
                if (plane.shows(x, y, BEYOND)) continue
                pixels.read(x, y)
                red += pixels.red
                green += pixels.green
                blue += pixels.blue
                seen++
            }
        }
        if (seen < FEWEST) return 0.0 // the chart is nearly all that there is
        val white = DoubleArray(3) { light.colour[3 * grey + it] / factor }
        if (white.min() <= 0) return null
        val parts = listOf(red / white[0], green / white[1], blue / white[2]).map { it / seen }
        return parts.max() - parts.min()
    }
}
