package org.camssf.spectra

import org.camssf.ChartUnfit
import org.camssf.Grid
import org.camssf.InvalidArgument
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test

class ChartTableTest {
    private val known = ChartTable.read("classic24")

    /** The bundled table as CSV every 5 nm, patches in the order asked for. */
    private fun csv(order: List<Int>, names: (Int) -> String = { "patch $it" }, scale: Double = 1.0): ByteArray {
        val header = (0..68).joinToString(",") { "nm${380 + 5 * it}" }
        val rows = order.joinToString("\n") { patch ->
            val row = known.reflectance(patch)
            names(patch) + "," + (0..68).joinToString(",") { "${scale * row[10 * it]}" }
        }
        return "name,$header\n$rows\n".toByteArray()
    }

    @Test
    fun `every name is read`() {
        assertEquals(8, ChartTable.names().size)
        for (name in ChartTable.names()) {
            val table = ChartTable.read(name)
            assertEquals(24 * Grid.SIZE, table.sharedValues.size)
            assertEquals("white 9.5 (.05 D)", table.patches[table.white])
            assertTrue(table.sharedValues.all { it in 0.0..1.0 } && table.sharedTolerance.all { it == 0.03 })
        }
        assertThrows(InvalidArgument::class.java) { ChartTable.read("sg140") }
        assertThrows(InvalidArgument::class.java) { ChartTable.read("classic24:mine") }
    }

    @Test
    fun `a measured table, also in percent`() {
        for (scale in listOf(1.0, 100.0)) {
            val table = ChartTable.parse("mine.csv", csv((0..23).toList(), scale = scale))
            for (i in table.sharedValues.indices) assertEquals(known.sharedValues[i], table.sharedValues[i], 1e-3)
            assertEquals(18, table.white)
            assertEquals(0.01, table.sharedTolerance[0])
            assertEquals("mine.csv", table.file!!.name)
        }
        assertEquals("nano24", ChartTable.parse("mine.csv", csv((0..23).toList()), "nano24").layout.name)
    }

    @Test
    fun `positions order the patches`() {
        val shuffled = (0..23).sortedBy { (7 * it) % 24 }
        val named = ChartTable.parse("mine.csv", csv(shuffled, { "${'A' + it % 6}${1 + it / 6}" }))
        assertArrayEquals(ChartTable.parse("mine.csv", csv((0..23).toList())).sharedValues, named.sharedValues)
        assertEquals("B1", named.patches[1])
    }

    @Test
    fun `wrong orders, counts and layouts are refused`() {
        assertThrows(ChartUnfit::class.java) { ChartTable.parse("mine.csv", csv((23 downTo 0).toList())) }
        val byColumns = (0..23).map { 6 * (it % 4) + it / 4 }
        assertThrows(ChartUnfit::class.java) { ChartTable.parse("mine.csv", csv(byColumns)) }
        assertThrows(InvalidArgument::class.java) { ChartTable.parse("mine.csv", csv((0..22).toList())) }
        assertThrows(InvalidArgument::class.java) { ChartTable.parse("mine.csv", csv((0..23).toList()), "sg140") }
        assertThrows(InvalidArgument::class.java) { ChartTable.parse("mine.cxf", ByteArray(9)) }
    }
}
