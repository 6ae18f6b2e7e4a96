package org.camssf.photo

import org.camssf.InvalidArgument
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test

class MosaicTest {
    private fun mosaic(white: Double = 1023.0, black: Double = 64.0, orientation: Int = 1) = Mosaic(
        Mosaic.Origin("frame", orientation = orientation),
        4,
        4,
        Region(0, 0, 4, 4),
        ShortArray(16) { 300 },
        Mosaic.Sensor("RGGB", doubleArrayOf(64.0, 64.0, 64.0, black), white),
    )

    @Test
    fun `levels are numbers, and the orientation is one of eight`() {
        assertEquals(300, mosaic(orientation = 8)[3, 3])
        val wrong = listOf<() -> Mosaic>(
            { mosaic(white = Double.NaN) },
            { mosaic(white = Double.POSITIVE_INFINITY) },
            { mosaic(white = 0.0) },
            { mosaic(black = Double.NaN) },
            { mosaic(black = Double.NEGATIVE_INFINITY) },
            { mosaic(orientation = 0) },
            { mosaic(orientation = 99) },
        )
        for (each in wrong) {
            val error = assertThrows(InvalidArgument::class.java) { each() }
            assertTrue(error.message.startsWith("frame: ") && error.advice.startsWith("Give "), error.toString())
        }
    }
}
