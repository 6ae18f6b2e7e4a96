package org.camssf.recovery

import org.camssf.Grid
import org.camssf.spectra.Lamp
import kotlin.math.max

/**
 * (k, q, 681) modes of k lamps, padded with modes of zeros, which have no effect, to the largest number of modes.
 *
 * @param fewest q is at least this.
 */
internal fun lampModes(lamps: List<Lamp>, fewest: Int = 0): Tensor {
    val q = max(fewest, lamps.maxOf { it.sharedModes.size })
    val modes = Tensor.full(0.0, lamps.size, q, Grid.SIZE)
    for ((j, lamp) in lamps.withIndex()) {
        lamp.sharedModes.forEachIndexed { i, mode -> mode.copyInto(modes.values, (j * q + i) * Grid.SIZE) }
    }
    return modes
}
