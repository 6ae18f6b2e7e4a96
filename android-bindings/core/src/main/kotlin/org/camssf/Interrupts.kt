package org.camssf

/** Ends work on a thread that was interrupted; the flag is cleared. Costs a nanosecond: for inner loops. */
@Throws(InterruptedException::class)
internal fun checkInterrupt() {
    if (Thread.interrupted()) throw InterruptedException("The calibration was interrupted.")
}
