package org.camssf.fit

import org.camssf.Grid
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test

class ColourTest {
    /** The pairs of the test data of G. Sharma, W. Wu, E. Dalal, Color Res. Appl. 30 (2005), table 1. */
    @Test
    fun `CIEDE2000 as published`() {
        val pairs = listOf(
            doubleArrayOf(50.0, 2.6772, -79.7751, 50.0, 0.0, -82.7485, 2.0425),
            doubleArrayOf(50.0, 3.1571, -77.2803, 50.0, 0.0, -82.7485, 2.8615),
            doubleArrayOf(50.0, 2.8361, -74.02, 50.0, 0.0, -82.7485, 3.4412),
            doubleArrayOf(50.0, -1.3802, -84.2814, 50.0, 0.0, -82.7485, 1.0),
            doubleArrayOf(50.0, -1.1848, -84.8006, 50.0, 0.0, -82.7485, 1.0),
            doubleArrayOf(50.0, -0.9009, -85.5211, 50.0, 0.0, -82.7485, 1.0),
            doubleArrayOf(50.0, 0.0, 0.0, 50.0, -1.0, 2.0, 2.3669),
            doubleArrayOf(50.0, 2.49, -0.001, 50.0, -2.49, 0.0009, 7.1792),
            doubleArrayOf(50.0, 2.49, -0.001, 50.0, -2.49, 0.001, 7.1792),
            doubleArrayOf(50.0, 2.49, -0.001, 50.0, -2.49, 0.0011, 7.2195),
            doubleArrayOf(50.0, 2.49, -0.001, 50.0, -2.49, 0.0012, 7.2195),
            doubleArrayOf(50.0, -0.001, 2.49, 50.0, 0.0009, -2.49, 4.8045),
            doubleArrayOf(50.0, -0.001, 2.49, 50.0, 0.001, -2.49, 4.8045),
            doubleArrayOf(50.0, -0.001, 2.49, 50.0, 0.0011, -2.49, 4.7461),
            doubleArrayOf(50.0, 2.5, 0.0, 50.0, 0.0, -2.5, 4.3065),
            doubleArrayOf(50.0, 2.5, 0.0, 73.0, 25.0, -18.0, 27.1492),
            doubleArrayOf(50.0, 2.5, 0.0, 61.0, -5.0, 29.0, 22.8977),
            doubleArrayOf(50.0, 2.5, 0.0, 56.0, -27.0, -3.0, 31.903),
            doubleArrayOf(50.0, 2.5, 0.0, 58.0, 24.0, 15.0, 19.4535),
            doubleArrayOf(50.0, 2.5, 0.0, 50.0, 3.1736, 0.5854, 1.0),
            doubleArrayOf(50.0, 2.5, 0.0, 50.0, 3.2972, 0.0, 1.0),
            doubleArrayOf(50.0, 2.5, 0.0, 50.0, 1.8634, 0.5757, 1.0),
            doubleArrayOf(50.0, 2.5, 0.0, 50.0, 3.2592, 0.335, 1.0),
            doubleArrayOf(60.2574, -34.0099, 36.2677, 60.4626, -34.1751, 39.4387, 1.2644),
            doubleArrayOf(63.0109, -31.0961, -5.8663, 62.8187, -29.7946, -4.0864, 1.263),
            doubleArrayOf(61.2901, 3.7196, -5.3901, 61.4292, 2.248, -4.962, 1.8731),
            doubleArrayOf(35.0831, -44.1164, 3.7933, 35.0232, -40.0716, 1.5901, 1.8645),
            doubleArrayOf(22.7233, 20.0904, -46.694, 23.0331, 14.973, -42.5619, 2.0373),
            doubleArrayOf(36.4612, 47.858, 18.3852, 36.2715, 50.5065, 21.2231, 1.4146),
            doubleArrayOf(90.8027, -2.0831, 1.441, 91.1528, -1.6435, 0.0447, 1.4441),
            doubleArrayOf(90.9257, -0.5406, -0.9208, 88.6381, -0.8985, -0.7239, 1.5381),
            doubleArrayOf(6.7747, -0.2908, -2.4247, 5.8714, -0.0985, -2.2286, 0.6377),
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
            val white = Colour.white(Lamp.read(lamp).sharedValues)
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
            val xyz = Colour.white(Lamp.read(lamp).sharedValues)
            assertEquals(x, xyz[0] / xyz.sum(), 5e-4)
            assertEquals(y, xyz[1] / xyz.sum(), 5e-4)
        }
    }

    private val d65 = doubleArrayOf(0.3127 / 0.3290, 1.0, (1 - 0.3127 - 0.3290) / 0.3290)

    /** CIE 15: the other way round, XYZ of L*a*b*; below L* = 8 along the straight line. */
    private fun xyz(l: Double, a: Double, b: Double): DoubleArray {
        val y = (l + 16) / 116
        return listOf(y + a / 500, y, y - b / 200).mapIndexed { i, f ->
            d65[i] * if (f > 6.0 / 29) f * f * f else 3 * (6.0 / 29) * (6.0 / 29) * (f - 4.0 / 29)
        }.toDoubleArray()
    }

    @Test
    fun `Lab is what its colour was made of, in the dark, too`() {
        val colours = listOf(
            doubleArrayOf(52.0, 40.0, -30.0),
            doubleArrayOf(97.0, -10.0, 80.0),
            doubleArrayOf(5.0, 3.0, -2.0),
            doubleArrayOf(8.5, -9.0, 6.0),
            doubleArrayOf(0.0, 0.0, 0.0),
        )
        val all = colours.flatMap { (l, a, b) -> xyz(l, a, b).toList() }.toDoubleArray()
        assertArrayEquals(colours.flatMap { it.toList() }.toDoubleArray(), Colour.lab(all), 1e-9)
    }

    /** IEC 61966-2-1: the primaries' XYZ, and its curve read backwards. */
    @Test
    fun `sRGB of its primaries, and of greys down to black`() {
        val primaries = doubleArrayOf(0.4124, 0.2126, 0.0193, 0.3576, 0.7152, 0.1192, 0.1805, 0.0722, 0.9505)
        val found = Colour.srgb(primaries)
        for (i in found.indices) assertEquals(if (i / 3 == i % 3) 1.0 else 0.0, found[i], 3e-3)
        for (value in listOf(0.0, 0.01, 0.03, 0.04, 0.05, 0.3, 0.8)) {
            val linear = if (value <= 0.04045) value / 12.92 else Math.pow((value + 0.055) / 1.055, 2.4)
            for (got in Colour.srgb(DoubleArray(3) { d65[it] * linear })) assertEquals(value, got, 2e-4)
        }
        // What lies outside is cut off.
        val outside = Colour.srgb(doubleArrayOf(9.0, 9.0, 9.0, -9.0, -9.0, -9.0))
        assertArrayEquals(doubleArrayOf(1.0, 1.0, 1.0, 0.0, 0.0, 0.0), outside)
    }

    @Test
    fun `XYZ of a grey is that part of the white's, whose Y is 1`() {
        val lamp = Lamp.read("A").sharedValues
        val white = Colour.white(lamp)
        assertEquals(1.0, white[1], 1e-12)
        val greys = Colour.xyz(DoubleArray(2 * Grid.SIZE) { if (it < Grid.SIZE) 0.5 else 0.2 }, lamp)
        for (i in 0..2) {
            assertEquals(0.5 * white[i], greys[i], 1e-12)
            assertEquals(0.2 * white[i], greys[3 + i], 1e-12)
        }
        // Two halves of the spectrum make the whole.
        fun half(at: Int) = (at % Grid.SIZE < 300) == (at < Grid.SIZE)
        val halves = Colour.xyz(DoubleArray(2 * Grid.SIZE) { if (half(it)) 1.0 else 0.0 }, lamp)
        for (i in 0..2) assertEquals(white[i], halves[i] + halves[3 + i], 1e-12)
        // No eye's blue cone sees red.
        assertTrue(halves[5] < 0.1 * halves[2])
    }

    /** By von Kries a grey stays a grey; what the lamp gives nothing to see is black, not a number without sense. */
    @Test
    fun `a grey under any lamp is seen grey`() {
        val white = Colour.white(Lamp.read("A").sharedValues)
        val seen = Colour.adapted(DoubleArray(6) { white[it % 3] * if (it < 3) 0.3 else 0.6 }, white)
        for (i in 0..5) assertEquals(d65[i % 3] * if (i < 3) 0.3 else 0.6, seen[i], 1e-9)
        assertArrayEquals(DoubleArray(3), Colour.adapted(DoubleArray(3), DoubleArray(3)))
    }

    /** BabelColor's averages under D65: the white, a grey and the red patch. */
    @Test
    fun `patches have the colours that they are known for`() {
        val found = Colour.reflectance(ChartTable.read("classic24"))
        val known = mapOf(18 to listOf(243, 243, 242), 21 to listOf(122, 122, 121), 14 to listOf(175, 54, 60))
        for ((patch, colour) in known) {
            for (c in 0..2) assertEquals(colour[c] / 255.0, found[3 * patch + c], 0.03)
        }
    }
}
