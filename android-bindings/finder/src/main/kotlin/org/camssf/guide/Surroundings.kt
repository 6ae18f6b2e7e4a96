package org.camssf.guide

/** Measures how coloured the surroundings of the chart are, relative to the chart's own light. */
internal object Surroundings {
    private const val ACROSS = 40
    private const val DOWN = 30

    /**
     * Distance from the outer patches' centres in which pixels are ignored, pitches; it includes the chart's frame.
     */
    private const val BEYOND = 1.2
    private const val FEWEST = 60

    /**
     * Largest minus smallest channel of the surroundings' mean, where the chart's white patch is 1. 0 if the chart
     * fills nearly the whole picture; null if the picture has no colours or the grey patch no light.
     *
     * @param grey index of a neutral patch that is not clipped.
     * @param factor luminance of that patch / luminance of the white patch.
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
        if (seen < FEWEST) return 0.0 // the chart fills nearly the whole picture
        val white = DoubleArray(3) { light.colour[3 * grey + it] / factor }
        if (white.min() <= 0) return null
        val parts = listOf(red / white[0], green / white[1], blue / white[2]).map { it / seen }
        return parts.max() - parts.min()
    }
}
