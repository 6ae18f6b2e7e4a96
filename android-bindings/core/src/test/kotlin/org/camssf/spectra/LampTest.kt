package org.camssf.spectra

import org.camssf.Grid
import org.camssf.InvalidArgument
import org.camssf.LampUnfit
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertFalse
import org.junit.jupiter.api.Assertions.assertNull
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import kotlin.math.exp
import kotlin.math.pow

class LampTest {
    private fun csv(vararg rows: Pair<Int, Double>, separator: String = ",") =
        rows.joinToString("\n") { "${it.first}$separator${it.second}" }.toByteArray()

    private fun flat(from: Int = 380, to: Int = 720) = (from..to step 5).map { it to 2.0 }.toTypedArray()

    @Test
    fun `every name is read, with a mean of one`() {
        val names = Lamp.names()
        assertTrue(names.size >= 57)
        for (name in names) {
            val lamp = Lamp.read(name)
            assertEquals(Grid.SIZE, lamp.sharedValues.size)
            assertEquals(1.0, lamp.sharedValues.average(), 1e-12, name)
            assertTrue(lamp.sharedValues.all { it >= 0 } && lamp.sharedModes.all { it.size == Grid.SIZE })
        }
    }

    @Test
    fun `an unnamed light has kinds and no spectrum`() {
        val light = Lamp.auto()
        assertTrue(light.unnamed && light.tolerance.isNaN() && light.sharedModes.isEmpty())
        val kinds = light.lamps.map { Lamp.kindOf(it.name) }.distinct()
        assertEquals(listOf("daylight", "bulb", "white-led", "fluorescent"), kinds)
        assertEquals(1.0, light.logPrior.sumOf { exp(it) }, 1e-6)
        for (wrong in listOf({ light.sharedValues }, { light.withTolerance("2%") }, { Lamp.read(" Auto ") })) {
            val error = assertThrows(InvalidArgument::class.java) { wrong() }
            assertTrue("is not named" in error.message && error.advice.isNotEmpty(), error.message)
        }
        assertTrue("auto" !in Lamp.names() && !Lamp.read("A").unnamed)
    }

    @Test
    fun `a name is one hypothesis beside its kind, unless it is taken as said`() {
        val kinds = mapOf("D50" to "daylight", "2856K" to "bulb", "LED-B3" to "white-led", "FL2" to "fluorescent")
        for ((name, kind) in kinds) {
            val lamp = Lamp.read(name)
            val names = lamp.lamps.map { Lamp.kindOf(it.name) ?: it.name }
            assertEquals(listOf(name) + List(names.size - 1) { kind }, names)
            assertEquals(1.0, lamp.logPrior.sumOf { exp(it) }, 1e-6)
            assertTrue(!lamp.withTolerance("2%").uncertain && !lamp.asSaid().uncertain)
        }
        assertEquals(listOf(1, 6), listOf("daylight", "white-led").map { Lamp.read(it).lamps.size })
        for (name in listOf("E", "HP1", "LED-RGB1", "5000K", "equal-energy")) {
            assertFalse(Lamp.read(name).uncertain, name)
        }
    }

    @Test
    fun `names are free of case, blanks and hyphens`() {
        for ((said, meant) in listOf("cie d65" to "D65", "f2" to "FL2", "led b3" to "LED-B3", "fl 3.1" to "FL3.1")) {
            assertArrayEquals(Lamp.read(meant).sharedValues, Lamp.read(said).sharedValues)
        }
    }

    @Test
    fun `a bulb is Planck's, and A is 2856 K`() {
        val lamp = Lamp.read("3000K").sharedValues
        val grid = Grid.wavelengths.values
        fun planck(nm: Double) = nm.pow(-5) / (exp(1.4388e7 / (nm * 3000)) - 1)
        for (m in 0 until Grid.SIZE step 40) {
            assertEquals(planck(grid[m]) / planck(550.0), lamp[m] / lamp[340], 1e-12)
        }
        val a = Lamp.read("A").sharedValues
        val hot = Lamp.read("2856K").sharedValues
        // The table was made for 2848 K and c₂ = 1.4350e-2 m K, which is 2855.5 K on today's scale: 1e-3 at 380 nm.
        for (m in 0 until Grid.SIZE step 40) assertEquals(1.0, hot[m] / a[m], 1e-3)
    }

    @Test
    fun `daylight's formula gives the tables`() {
        val table = Lamp.read("D65").sharedValues
        val formula = Lamp.read("D:6504").sharedValues
        for (m in table.indices) assertEquals(table[m], formula[m], 2e-3)
    }

    @Test
    fun `temperatures that no lamp has`() {
        for (name in listOf("900K", "30000K", "D:3000", "D:30000")) {
            assertThrows(InvalidArgument::class.java) { Lamp.read(name) }
        }
    }

    @Test
    fun `no lamp and an unknown one are told apart`() {
        assertTrue("missing" in assertThrows(InvalidArgument::class.java) { Lamp.read(" ") }.message)
        assertTrue("'candle'" in assertThrows(InvalidArgument::class.java) { Lamp.read("candle") }.message)
    }

    @Test
    fun `tolerances in percent and kelvins`() {
        val lamp = Lamp.read("D55").withTolerance("300K, 1%")
        assertEquals(0.01, lamp.tolerance)
        assertEquals(300.0, lamp.toleranceKelvin)
        assertEquals(500.0, lamp.withTolerance("400K").withTolerance("2%").toleranceKelvin)
        assertNull(Lamp.read("D55").toleranceKelvin)
        assertEquals(1, lamp.sharedModes.size)
        val high = Bundled.daylight(5803.0)
        val low = Bundled.daylight(5203.0)
        // Half of the change of ln L, less its mean: blue against red.
        val wanted = 0.5 * (kotlin.math.ln(high[100] / low[100]) - kotlin.math.ln(high[600] / low[600]))
        assertEquals(wanted, lamp.sharedModes[0][100] - lamp.sharedModes[0][600], 1e-12)
        for (text in listOf("60%", "2000K", "much", "-1%", "0K")) {
            assertThrows(InvalidArgument::class.java, { Lamp.read("D55").withTolerance(text) }, text)
        }
        assertThrows(InvalidArgument::class.java) { Lamp.read("FL2").withTolerance("100K") }
    }

    @Test
    fun `a measured lamp, in three writings`() {
        val plain = Lamp.parse("lamp.csv", csv(*flat()))
        assertEquals(0.01, plain.tolerance)
        assertEquals("file lamp.csv", plain.source)
        for (value in plain.sharedValues) assertEquals(1.0, value, 1e-12)
        val rows = flat().joinToString("\n") { "${it.first};2,0" }
        assertArrayEquals(plain.sharedValues, Lamp.parse("lamp.csv", "nm;power\n$rows".toByteArray()).sharedValues)
        val fields = flat().joinToString(" ") { "SPEC_${it.first}" }
        val cgats = "CGATS.17\nBEGIN_DATA_FORMAT\n$fields\nEND_DATA_FORMAT\nBEGIN_DATA\n" +
            flat().joinToString(" ") { "2.0" } + "\nEND_DATA\n"
        assertArrayEquals(plain.sharedValues, Lamp.parse("lamp.sp", cgats.toByteArray()).sharedValues)
    }

    @Test
    fun `a standard deviation beside the power is left out`() {
        val plain = Lamp.parse("lamp.csv", csv(*flat()))
        fun rows(third: Double) = flat().joinToString("\n") { "${it.first},${it.second},$third" }
        for (head in listOf("", "nm,power,std\n", "nm,W/m2,power_sigma\n", "nm,I,Error\n")) {
            val lamp = Lamp.parse("x.csv", "$head${rows(0.02)}".toByteArray())
            assertArrayEquals(plain.sharedValues, lamp.sharedValues)
        }
        for (text in listOf(rows(2.0), rows(0.5), rows(-0.1), rows(Double.NaN), "nm,lamp A,lamp B\n${rows(0.02)}")) {
            val error = assertThrows(InvalidArgument::class.java) { Lamp.parse("x.csv", text.toByteArray()) }
            assertTrue("no standard deviation" in error.message, error.message)
        }
        val mixed = "${flat().joinToString("\n") { "${it.first},1" }}\n740,1,0.01"
        assertThrows(InvalidArgument::class.java) { Lamp.parse("x.csv", mixed.toByteArray()) }
    }

    @Test
    fun `a gap is named where it is, and one beyond the grid is none`() {
        fun without(vararg nm: Int) = csv(*flat().filter { it.first !in nm }.toTypedArray())
        val error = assertThrows(LampUnfit::class.java) { Lamp.parse("x.csv", without(520, 525, 530, 535)) }
        assertTrue("x.csv has a gap of 25 nm: nothing from 515 to 540 nm." in error.message, error.message)
        Lamp.parse("x.csv", without(520, 525, 530))
        Lamp.parse("x.csv", csv(*flat(), 790 to 2.0))
    }

    @Test
    fun `what is held is said`() {
        assertTrue("held constant outside 400 to 700 nm" in Lamp.parse("x.csv", csv(*flat(400, 700))).source)
    }

    @Test
    fun `unfit measurements`() {
        val cases = listOf(
            csv(*flat(450, 720)),
            csv(*flat().map { it.first to 0.0 }.toTypedArray()),
            csv(*flat().mapIndexed { i, it -> it.first to if (i == 9) -1.0 else 2.0 }.toTypedArray()),
            csv(400 to 1.0, 500 to 1.0, 600 to 1.0, 700 to 1.0),
        )
        for (content in cases) assertThrows(LampUnfit::class.java) { Lamp.parse("x.csv", content) }
        val wrong = listOf("", "hello", "380,1\n380,2\n390,1", "0.38,1\n0.39,1\n0.40,1")
        for (text in wrong) assertThrows(InvalidArgument::class.java) { Lamp.parse("x.csv", text.toByteArray()) }
    }

    @Test
    fun `numbers are what Python takes for numbers`() {
        fun rows(end: String, first: String = "380") = flat().joinToString("\n") { (nm, power) ->
            if (nm == 380) "$first,$power$end" else "$nm,$power$end"
        }.toByteArray()
        for (end in listOf("", "e0", "E+00")) {
            assertEquals(Grid.SIZE, Lamp.parse("x.csv", rows(end)).sharedValues.size)
        }
        for (end in listOf("f", "d", "D", "e", "x")) {
            assertThrows(InvalidArgument::class.java, { Lamp.parse("x.csv", rows(end)) }, end)
        }
        // A first line that is no number is a heading: the table then begins at 385 nm.
        for (first in listOf("380.0f", "0x1p0", "\u0663\u0668\u0660")) {
            assertTrue("outside 385" in Lamp.parse("x.csv", rows("", first)).source, first)
        }
        val none = flat().joinToString("\n") { "${it.first},${if (it.first == 500) "nan" else "1"}" }
        assertThrows(LampUnfit::class.java) { Lamp.parse("x.csv", none.toByteArray()) }
    }

    @Test
    fun `thousands separators are refused with their line, decimal commas are read`() {
        fun rows(value: String, mark: Char) =
            flat().joinToString("\n") { (nm, _) -> "$nm$mark${if (nm == 390) value else "950"}" }.toByteArray()
        for ((value, mark) in listOf(
            "\"9,000\"" to ',', "9,000" to '\t', "9.000" to ';', "9.000,5" to ';', "9'000" to ',',
            "9\u2019000" to ';',
            "9\u00a0000" to ' ', "9\u2009000" to '\t', "9 000" to ';',
        )) {
            val error = assertThrows(InvalidArgument::class.java, { Lamp.parse("x.csv", rows(value, mark)) }, value)
            assertTrue(error.message.startsWith("x.csv, line 3: '${value.trim('"')}' "), error.message)
        }
        assertTrue(Lamp.parse("x.csv", rows("0,95", ';')).sharedValues[20] < 0.01)
    }

    @Test
    fun `closing markers, descending wavelengths, one row and rawtoaces' illuminant are read`() {
        val plain = Lamp.parse("lamp.csv", csv(*flat()))
        val rows = flat().map { "${it.first}\t2" }
        val fields = flat().joinToString(";") { "${it.first} nm" }
        val main = flat().joinToString { "\"${it.first}\": [2.0]" }
        for (text in listOf(
            "Date: x\n>>>>>Begin<<<<<\n${rows.joinToString("\n")}\n>>>>>End<<<<<\nCCT\t5503\n",
            rows.reversed().joinToString("\n"),
            "name;$fields\nlamp;${flat().joinToString(";") { "2,0" }}\n",
            """{"spectral_data": {"index": {"main": ["power"]}, "data": {"main": {$main}}}}""",
        )) {
            assertArrayEquals(plain.sharedValues, Lamp.parse("lamp.csv", text.toByteArray()).sharedValues)
        }
        for (text in listOf("{", "[[1]]", """{"spectral_data": {}}""", "{\"a\":".repeat(5000))) {
            assertThrows(InvalidArgument::class.java) { Lamp.parse("x.json", text.toByteArray()) }
        }
    }

    @Test
    fun `noise below zero counts inside the grid only, and units are named`() {
        val noisy = csv(*flat(340, 760).map { (nm, _) -> nm to if (nm in 380..720) 2.0 else -1.0 }.toTypedArray())
        assertArrayEquals(Lamp.parse("x.csv", csv(*flat())).sharedValues, Lamp.parse("x.csv", noisy).sharedValues)
        val micrometres = flat().joinToString("\n") { "${it.first / 1000.0},1" }.toByteArray()
        val error = assertThrows(InvalidArgument::class.java) { Lamp.parse("x.csv", micrometres) }
        assertTrue("as in micrometres" in error.message, error.message)
    }

    @Test
    fun `digits of other scripts are no temperature`() {
        for (text in listOf("\u0663\u0660\u0660\u0660K", "D:\u0665\u0665\u0660\u0660")) {
            assertThrows(InvalidArgument::class.java) { Lamp.read(text) }
        }
        assertThrows(InvalidArgument::class.java) { Lamp.read("D55").withTolerance("\u0662%") }
    }
}
