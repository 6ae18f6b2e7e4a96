package org.camssf

import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Test

class GridTest {
    @Test
    fun `grid ends at 720 nm`() {
        val grid = Grid.wavelengths.values
        assertEquals(380.0, grid.first())
        assertEquals(720.0, grid[Grid.SIZE - 1])
        assertEquals(Grid.SIZE, grid.size)
    }
}
