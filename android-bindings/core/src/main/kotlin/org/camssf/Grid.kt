package org.camssf

/** The wavelengths on which everything is computed: 380 to 720 nm every 0.5 nm. */
public object Grid {
    /** Number of wavelengths. */
    public const val SIZE: Int = 681

    /** Distance between neighbouring wavelengths, nm. */
    public const val STEP: Double = 0.5

    /** The wavelengths, nm. */
    @JvmField
    public val wavelengths: Curve = Curve(DoubleArray(SIZE) { 380.0 + STEP * it })
}
