package org.camssf.spectra

import org.camssf.Grid
import kotlin.math.ceil
import kotlin.math.exp
import kotlin.math.sqrt

/**
 * Modes Φ of a relative error that is smooth over a correlation length ℓ, (681) per column. Column q is
 * √(h / (ℓ √(π/2))) exp(-((λ - t_q) / ℓ)²), with h = ℓ / 2 and
 * t_q = 380 - 2 ℓ + q h, up to the first t_q at or above 720 + 2 ℓ.
 */
internal class Directions private constructor(length: Double) {
    val columns: List<DoubleArray>

    init {
        val step = length / 2.0
        val weight = sqrt(step / (length * sqrt(Math.PI / 2.0)))
        val grid = Grid.wavelengths
        columns = List(ceil((340.0 + 4.0 * length) / step).toInt() + 1) { q ->
            val place = 380.0 - 2.0 * length + step * q
            DoubleArray(Grid.SIZE) {
                val u = (grid[it] - place) / length
                weight * exp(-u * u)
            }
        }
    }

    companion object {
        private val made = HashMap<Double, Directions>()

        /** The directions of this correlation length, nm; cached, thread-safe. */
        fun of(length: Double): Directions = synchronized(made) { made.getOrPut(length) { Directions(length) } }
    }
}
