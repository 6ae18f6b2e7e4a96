package org.camssf

/** This library. */
public object Camssf {
    /** Its version, the Python package's; results and passports name it. */
    public const val VERSION: String = "0.1.0"
}
