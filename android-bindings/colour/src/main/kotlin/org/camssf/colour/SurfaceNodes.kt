package org.camssf.colour

/** The 35 wavelengths, 380 to 720 nm every 10 nm, between which reflectances are linear. */
internal object SurfaceNodes {
    const val SIZE = 35

    /** Wavelengths (35), nm. */
    val wavelengths = DoubleArray(SIZE) { 380.0 + 10.0 * it }

    /** (35) of (35): at each node 1, at the others 0. */
    val units = List(SIZE) { a -> DoubleArray(SIZE) { if (it == a) 1.0 else 0.0 } }
}
