package org.camssf

/** Throws if this thread was interrupted, and clears the flag; cheap enough for inner loops. */
@Throws(InterruptedException::class)
internal fun checkInterrupt() {
    if (Thread.interrupted()) throw InterruptedException("The calibration was interrupted.")
}
