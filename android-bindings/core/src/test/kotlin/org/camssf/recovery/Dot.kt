package org.camssf.recovery

/** Σ a b. */
internal fun dot(a: DoubleArray, b: DoubleArray): Double = a.indices.sumOf { a[it] * b[it] }
