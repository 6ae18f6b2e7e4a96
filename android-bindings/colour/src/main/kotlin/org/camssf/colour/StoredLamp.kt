package org.camssf.colour

import org.camssf.Grid
import org.camssf.Recovered
import org.camssf.Rules
import org.camssf.spectra.Bundled
import org.camssf.spectra.Directions
import org.camssf.spectra.Lamp
import kotlin.math.sqrt

/** The light of a result's first shot as a lamp: as it was named, or as it was estimated. */
internal object StoredLamp {
    /** The lamp, its power of mean 1; null if it was neither named nor estimated. */
    fun of(result: Recovered): Lamp? {
        val lamp = result.capture.shots[0].lamp
        val light = result.lights.firstOrNull()
        if (light != null) return estimated(lamp.name, light.sharedPower, light.sharedStd)
        return if (lamp.unnamed) null else lamp.withPower(Bundled.scaled(lamp.sharedValues))
    }

    /**
     * The lamp of an estimated light. Its modes give its standard deviation at each wavelength, for errors that are
     * smooth over `lamp_correlation`.
     */
    fun estimated(name: String, power: DoubleArray, std: DoubleArray): Lamp {
        val smooth = unitErrors(Rules.shipped.number("covariance.lamp_correlation"))
        val modes = smooth.map { mode -> DoubleArray(power.size) { std[it] * mode[it] / power[it] } }
        return Lamp(name, power, 0.0, modes, "estimated from the photo")
    }
}

/** Errors (p) of (681) that are smooth over a length in nm, with a variance of 1 at every wavelength. */
internal fun unitErrors(length: Double): List<DoubleArray> {
    val smooth = Directions.of(length).columns
    val sizes = DoubleArray(Grid.SIZE) { m -> sqrt(smooth.sumOf { it[m] * it[m] }) }
    return smooth.map { column -> DoubleArray(Grid.SIZE) { column[it] / sizes[it] } }
}
