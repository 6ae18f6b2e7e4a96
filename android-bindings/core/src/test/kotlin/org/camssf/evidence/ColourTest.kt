package org.camssf.evidence

import org.camssf.spectra.Lamp
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Test

class ColourTest {
    /** Pairs of the test data of G. Sharma, W. Wu, E. Dalal, Color Res. Appl. 30 (2005), table 1. */
    @Test
    fun `CIEDE2000 as published`() {
        val pairs = listOf(
            doubleArrayOf(50.0, 2.6772, -79.7751, 50.0, 0.0, -82.7485, 2.0425),
            doubleArrayOf(50.0, 0.0, 0.0, 50.0, -1.0, 2.0, 2.3669),
            doubleArrayOf(50.0, 2.49, -0.001, 50.0, -2.49, 0.0009, 7.1792),
            doubleArrayOf(50.0, 2.49, -0.001, 50.0, -2.49, 0.0011, 7.2195),
            doubleArrayOf(50.0, 2.5, 0.0, 50.0, 0.0, -2.5, 4.3065),
            doubleArrayOf(50.0, 2.5, 0.0, 73.0, 25.0, -18.0, 27.1492),
            doubleArrayOf(50.0, 2.5, 0.0, 61.0, -5.0, 29.0, 22.8977),
            doubleArrayOf(60.2574, -34.0099, 36.2677, 60.4626, -34.1751, 39.4387, 1.2644),
            doubleArrayOf(22.7233, 20.0904, -46.694, 23.0331, 14.973, -42.5619, 2.0373),
            doubleArrayOf(2.0776, 0.0795, -1.135, 0.9033, -0.0636, -0.5514, 0.9082),
        )
        for (pair in pairs) {
            val a = pair.copyOfRange(0, 3)
            val b = pair.copyOfRange(3, 6)
            assertEquals(pair[6], Colour.difference(a, b), 5e-5)
            assertEquals(pair[6], Colour.difference(b, a), 5e-5)
        }
    }

    @Test
    fun `white under any lamp is white`() {
        for (lamp in listOf("D65", "A", "FL2", "LED-B3")) {
            val white = Colour.white(Lamp.read(lamp).values)
            val adapted = Colour.adapted(white, white)
            val lab = Colour.lab(adapted)
            assertEquals(100.0, lab[0], 1e-9)
            assertEquals(0.0, lab[1], 1e-9)
            assertEquals(0.0, lab[2], 1e-9)
            for (value in Colour.srgb(adapted)) assertEquals(1.0, value, 1e-3)
        }
    }

    /** CIE 15: x and y of D65 and A, 2°; the grid ends at 720 nm, which costs the third digit. */
    @Test
    fun `chromaticity of two lamps`() {
        for ((lamp, x, y) in listOf(Triple("D65", 0.3127, 0.3290), Triple("A", 0.4476, 0.4074))) {
            val xyz = Colour.white(Lamp.read(lamp).values)
            assertEquals(x, xyz[0] / xyz.sum(), 5e-4)
            assertEquals(y, xyz[1] / xyz.sum(), 5e-4)
        }
    }
}
