package org.camssf.colour

import org.camssf.InvalidArgument

/**
 * Signals of a surface relative to those of a perfect white.
 *
 * @property values (c) one for each channel and photo.
 * @property standardError (c) of [values].
 * @throws InvalidArgument a value that is not finite, or an invalid standard error.
 */
internal class RelativeSignals(val values: DoubleArray, val standardError: DoubleArray) {
    init {
        if (!values.all { it.isFinite() }) throw InvalidArgument("A signal is not finite.", "Give finite signals.")
        check(standardError)
    }

    companion object {
        /** @throws InvalidArgument a standard error that is negative or not finite. */
        fun check(standardError: DoubleArray) {
            if (!standardError.all { it.isFinite() && it >= 0 }) {
                throw InvalidArgument("A standard error is negative or not finite.", "Give standard errors ≥ 0.")
            }
        }
    }
}
