package org.camssf

import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Test

/** The wanted words are what Python's `f"{value:.1f}"` and `f"{value:g}"` give. */
class NumbersTest {
    @Test
    fun `ties of the binary value go to even`() {
        assertEquals("2.2", fixed(2.25, 1))
        assertEquals("2.8", fixed(2.75, 1))
        assertEquals("0.12", fixed(0.125, 2))
        assertEquals("2", fixed(2.5, 0))
        assertEquals("0.1", fixed(0.15, 1)) // a little less than it is written
        assertEquals("1.00", fixed(0.995000000000000106, 2)) // a little more
        assertEquals("12%", percent(0.125, 0))
        assertEquals("100000", short(100000.5))
    }

    @Test
    fun `signs, large numbers and none`() {
        assertEquals("-0.0", fixed(-0.04, 1))
        assertEquals("-2.2", fixed(-2.25, 1))
        assertEquals("100000000000000000000.0", fixed(1e20, 1))
        assertEquals("nan", fixed(Double.NaN, 1))
        assertEquals("-inf", fixed(Double.NEGATIVE_INFINITY, 1))
    }

    @Test
    fun `an exponent`() {
        assertEquals("1.3e-05", scientific(1.25e-5, 1)) // a little more than it is written
        assertEquals("1.2e+00", scientific(1.25, 1))
        assertEquals("1.0e-04", scientific(9.96e-5, 1))
        assertEquals("-1.00e+123", scientific(-1e123, 2))
        assertEquals("0.0e+00", scientific(0.0, 1))
        assertEquals("nan", scientific(Double.NaN, 1))
    }
}
