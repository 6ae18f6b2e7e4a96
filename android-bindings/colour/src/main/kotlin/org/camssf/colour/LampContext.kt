package org.camssf.colour

/** Colours under one lamp: the posterior of XYZ given signals, for the prior "general" of reflectance. */
internal class LampContext(val response: SurfaceResponse) {
    val posterior = SurfacePosterior(SurfacePrior.read("general"), response, reflectance = false)

    /** For pixels; made when it is first needed. */
    val table: PixelTable by lazy { PixelTable(exact().means, response.white) }

    /** The colour of signals (3). */
    fun colour(signals: RelativeSignals): StandardColour {
        val surface = posterior.of(signals)
        val relative = surface.mean.copyOfRange(3, 6)
        val ones = DoubleArray(3) { 1.0 }
        val slopes = Spaces.slopes(relative, ones)
        // Lab's errors are those of XYZ over its white, which depends on the lamp, too.
        val parts = surface.parts.map { Spread(block(it, 0), Spaces.through(slopes, block(it, 3))) }
        val reach = SurfaceDistance.of(signals.values, surface.signalCovariance, response.reachable)
        return StandardColour(surface.mean.copyOf(3), Spaces.lab(relative, ones), parts, reach)
    }

    /** Of signals at the nodes of a table of pixels. */
    fun exact(): ExactOutputs = posterior.exact(PixelTable.signals, PixelTable.coarseSignals)

    /** The block (3, 3) of a covariance (6, 6) that begins at a row. */
    fun block(of: DoubleArray, from: Int) = DoubleArray(9) { of[(from + it / 3) * 6 + from + it % 3] }
}
