package org.camssf.spectra

import org.camssf.InvalidArgument
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertFalse
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test

/** Layouts of the user's own; tests/spectra/test_layouts.py has the same list for Python. */
class ChartLayoutTest {
    private val fields = mapOf(
        "format" to "\"camssf-layout/1\"", "name" to "\"garden card\"", "columns" to "7", "rows" to "5",
        "patch" to "[18, 12]", "gap" to "[3, 2]", "white" to "\"p19\"",
        "fiducials" to "[[-9, -9], [153, -9], [153, 77], [-9, 77]]",
    )

    private fun parse(vararg changed: Pair<String, String?>): ChartLayout {
        val all = (fields + changed).filterValues { it != null }
        val text = all.map { "\"${it.key}\": ${it.value}" }.joinToString(",", "{", "}")
        return ChartLayout.parse("card.json", text.toByteArray())
    }

    private fun csv(count: Int, name: (Int) -> String = { "p${it + 1}" }): ByteArray {
        val nodes = (400..700 step 20).toList()
        val rows = List(count) { i ->
            name(i) + nodes.joinToString("") { ",${if (i == 3) 0.9 else 0.1 + (i * 7 % 11 + it / 20 % 5) * 0.03}" }
        }
        return ("patch," + nodes.joinToString(",") + "\n" + rows.joinToString("\n")).toByteArray()
    }

    @Test
    fun `a layout file is read`() {
        val layout = parse()
        assertEquals("ChartLayout(garden card, 7 × 5)", layout.toString())
        assertEquals(18.0 / 21, layout.sideX, 1e-15)
        assertEquals(12.0 / 14, layout.sideY, 1e-15)
        assertEquals("p19", layout.white)
        assertArrayEquals(doubleArrayOf(-18.0 / 21, -15.0 / 14), layout.fiducials.copyOf(2), 1e-15)
        assertFalse(layout.shipped)
        assertTrue(ChartLayout.all().all { it.shipped })
        assertEquals(1.0, parse("patch" to "5", "gap" to "0").sideX)
        assertEquals(0, parse("fiducials" to null, "white" to null).fiducials.size)
    }

    @Test
    fun `damaged layouts are refused in Python's words`() {
        val damaged = listOf(
            ("format" to "\"camssf-layout/2\"") to "a layout has \"format\": \"camssf-layout/1\"",
            ("colums" to "6") to "a layout has no field \"colums\"",
            ("rows" to null) to "the field \"rows\" is missing",
            ("name" to "\"SG140\"") to "\"name\" is that of a shipped layout, SG140",
            ("name" to "\"../card\"") to
                "\"name\" needs 1 to 64 letters, digits, spaces, dots, hyphens or underscores",
            ("columns" to "6.5") to "\"columns\" must be a whole number from 2 to 30",
            ("columns" to "true") to "\"columns\" must be a whole number from 2 to 30",
            ("rows" to "31") to "\"rows\" must be a whole number from 2 to 30",
            ("rows" to "\"5\"") to "\"rows\" must be a whole number from 2 to 30",
            ("columns" to "2") to "it has 10 patches; 12 to 300 are possible",
            ("patch" to "[18, 0]") to "\"patch\" must be a number above 0, or two: across and down",
            ("gap" to "-1") to "\"gap\" must be a number of at least 0, or two: across and down",
            ("gap" to "[1, 2, 3]") to "\"gap\" must be a number of at least 0, or two: across and down",
            ("gap" to "1e9") to "\"gap\" must be a number of at least 0, or two: across and down",
            ("gap" to "20") to "the gaps are too wide: a patch must take at least 60 % of the step to the next",
            ("white" to "19") to "\"white\" must be the name of a patch in the table",
            ("fiducials" to "[[-9, -9], [153, -9], [153, 77]]") to MARKS,
            ("fiducials" to "[[-9, 77], [153, 77], [153, -9], [-9, -9]]") to MARKS,
            ("fiducials" to "[[9, 9], [90, 9], [90, 50], [9, 50]]") to MARKS,
            ("fiducials" to "[[-9, -9], [-9, -9], [-9, -9], [-9, -9]]") to MARKS,
            ("fiducials" to "[1, 2, 3, 4]") to MARKS,
        )
        for ((change, message) in damaged) {
            val error = assertThrows(InvalidArgument::class.java) { parse(change) }
            assertEquals("card.json: $message.", error.message)
            assertTrue("docs/tables.md" in error.advice)
        }
        for (text in listOf("", "[", "7", "null", "[]", "{\"rows\": NaN}", "[".repeat(5000))) {
            assertThrows(InvalidArgument::class.java) { ChartLayout.parse("card.json", text.toByteArray()) }
        }
    }

    @Test
    fun `a table of measured reflectances belongs to it`() {
        val layout = parse()
        val chart = ChartTable.parse("mine.csv", csv(35), layout)
        assertEquals("garden card:mine.csv", chart.name)
        assertEquals(18, chart.white)
        assertEquals(layout, chart.layout)
        assertEquals(3, ChartTable.parse("mine.csv", csv(35), parse("white" to null)).white)
        val few = assertThrows(InvalidArgument::class.java) { ChartTable.parse("mine.csv", csv(24), layout) }
        assertEquals("mine.csv holds 24 patches, garden card has 35.", few.message)
        val missing = assertThrows(InvalidArgument::class.java) {
            ChartTable.parse("mine.csv", csv(35), parse("white" to "\"E5\""))
        }
        assertTrue("no patch 'E5'" in missing.message)
    }

    @Test
    fun `patches may be named by position, letters for columns or for rows`() {
        val layout = parse("white" to null)
        val byColumn = ChartTable.parse("mine.csv", csv(35) { "${'A' + it % 7}${1 + it / 7}" }, layout)
        val byRow = ChartTable.parse("mine.csv", csv(35) { "${'A' + it / 7}${1 + it % 7}" }, layout)
        assertArrayEquals(byColumn.sharedValues, byRow.sharedValues)
        val shuffled = ChartTable.parse("mine.csv", csv(35) { "${'A' + it / 5}${1 + it % 5}" }, layout)
        assertEquals(listOf("A1", "B1", "C1"), shuffled.patches.take(3))
    }

    private companion object {
        const val MARKS = "\"fiducials\" must be four points [x, y], clockwise from the top left, around the patches"
    }
}
