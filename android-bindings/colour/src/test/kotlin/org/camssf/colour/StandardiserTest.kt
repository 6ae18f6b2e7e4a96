package org.camssf.colour

import org.camssf.ColourOutOfReach
import org.camssf.Grid
import org.camssf.InvalidArgument
import org.camssf.LampUnfit
import org.camssf.Recovered
import org.camssf.SsfCalibrator
import org.camssf.fit.Colour
import org.camssf.flatten
import org.camssf.photo.Capture
import org.camssf.photo.Corners
import org.camssf.photo.PhotoSource
import org.camssf.photo.Region
import org.camssf.photo.Shot
import org.camssf.photo.dng.DngReader
import org.camssf.photo.dng.DngSource
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertNull
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import java.io.File
import java.lang.reflect.InvocationTargetException
import java.net.URLClassLoader
import kotlin.math.abs
import kotlin.math.sqrt

/** The face of standard colour; the golden stage `colour` holds its numbers. */
class StandardiserTest {
    private val root = File(System.getProperty("camssf.root"))
    private val text = GoldenResult.text

    /** The calibration's own white, relative to green, seen under its own lamp. */
    private val gains = doubleArrayOf(0.55, 1.0, 0.7)
    private val white = Reference(DoubleArray(3) { 8000 * gains[it] }, DoubleArray(3) { 4.0 })
    private val d55 = Lamp.read("D55")

    private fun raw(y: Double, vararg balance: Double) = DoubleArray(3) { 8000 * gains[it] * y * balance[it] }

    @Test
    fun `white is white, and grey has its lightness`() {
        val found = Standardiser.read(text, d55, white)
        assertArrayEquals(doubleArrayOf(100.0, 0.0, 0.0), found.colourOf(white.raw.values).lab.values, 0.25)
        val grey = found.colourOf(raw(0.18, 1.0, 1.0, 1.0))
        assertEquals(116 * Math.cbrt(0.18) - 16, grey.lab[0], 0.05)
        assertEquals("D55", found.lamps.single().name)
        assertEquals(1.0, found.lamps.single().weight)
        assertTrue(found.chiSquared!! < 0.1)
    }

    @Test
    fun `a grey reference counts by its reflectance`() {
        val card = Reference(raw(0.18, 1.0, 1.0, 1.0), reflectance = 0.18)
        val (byCard, byWhite) = listOf(card, Reference(white.raw.values)).map { Standardiser.read(text, d55, it) }
        val strip = raw(0.3, 1.2, 1.0, 0.7)
        assertArrayEquals(byWhite.colourOf(strip).lab.values, byCard.colourOf(strip).lab.values, 1e-9)
    }

    @Test
    fun `pixels are the colours of exact signals, whatever the view`() {
        val exact = Reference(white.raw.values)
        val still = DoubleArray(3)
        // Surfaces of the library under D55, whose signals lie between the table's nodes.
        val known = listOf(ReferenceRatios(d55, null, 0.0, 0.0))
        val signals = SurfaceResponse.of(ColourCamera.parse(text), known, View()).signals.rows()
        val pixels = (Tables.library("general").filterIndexed { i, _ -> i % 14 == 0 } + Tables.library("skin"))
            .map { row -> DoubleArray(3) { 8000 * gains[it] * dot(signals[it], row) } }
        val all = pixels.flatten()
        for ((view, lamp) in listOf(View() to d55, View(Observer.CIE_1964, Adapted.D50) to null)) {
            val found = Standardiser.read(text, lamp, exact, view)
            val lab = found.standardise(all)
            val xyz = found.standardise(all, space = Space.XYZ)
            val differences = pixels.mapIndexed { i, each ->
                val one = found.colourOf(each, still)
                val own = xyz.copyOfRange(3 * i, 3 * i + 3)
                assertArrayEquals(one.xyz.values, own, 0.01 * one.xyz.values.maxOrNull()!!)
                Colour.difference(one.lab.values, lab.copyOfRange(3 * i, 3 * i + 3))
            }
            assertTrue(differences.average() < 0.06, "mean ${differences.average()}, ${differences.maxOrNull()}")
            val single = FloatArray(all.size) { all[it].toFloat() }
            found.standardise(single, single) // in place
            for (i in lab.indices) assertEquals(lab[i], single[i].toDouble(), 1e-3)
        }
    }

    @Test
    fun `a pixel that is none stays none, and below black is black`() {
        val found = Standardiser.read(text, d55, white)
        val lab = found.standardise(floatArrayOf(Float.NaN, Float.NaN, Float.NaN, -5f, -5f, -5f))
        assertTrue(lab.take(3).all { it.isNaN() })
        assertArrayEquals(FloatArray(3), lab.copyOfRange(3, 6), 1e-5f)
        assertThrows(InvalidArgument::class.java) { found.standardise(FloatArray(4)) }
        assertThrows(InvalidArgument::class.java) { found.standardise(DoubleArray(6), DoubleArray(3)) }
    }

    @Test
    fun `parts add up to the covariance, and noise is what noise does`() {
        val found = Standardiser.read(text, d55, white)
        val strip = raw(0.3, 1.2, 1.0, 0.7)
        val (still, noisy) = listOf(0.0, 40.0).map { found.colourOf(strip, DoubleArray(3) { _ -> it }) }
        for (colour in listOf(still, noisy)) {
            for (c in 0..2) {
                val parts = Part.values().sumOf { colour.deviation(it)[c] * colour.deviation(it)[c] }
                assertEquals(parts, colour.labCovariance[c, c], 1e-12)
            }
        }
        assertTrue(noisy.deviation(Part.NOISE)[0] > 3 * still.deviation(Part.NOISE)[0])
        assertTrue((0..2).all { noisy.deviation(Part.METAMERS)[it] > 0.9 * still.deviation(Part.METAMERS)[it] })
    }

    @Test
    fun `what tells the lamp tells it`() {
        val bulb = Lamp.read("A")
        val curves = GoldenResult.curves
        val lit = Reference(
            DoubleArray(3) { c ->
                fun seen(lamp: Lamp) = lamp.values.values.indices.sumOf { lamp.values[it] * curves[c][it] }
                8000 * gains[c] * seen(bulb) / seen(d55)
            },
        )
        val found = Standardiser.read(text, null, lit)
        assertEquals(listOf("daylight", "bulb", "white-led", "fluorescent"), found.lamps.map { it.name })
        assertEquals(1.0, found.lamps.sumOf { it.weight }, 1e-12)
        assertTrue(found.lamps[1].weight > 0.8)
        assertThrows(LampUnfit::class.java) {
            Standardiser.read(text, d55, lit)
        }.let { assertTrue(it.value!! > 18.4) }
        Standardiser.read(text, bulb, lit)
    }

    @Test
    fun `a colour that no surface has is refused`() {
        val found = Standardiser.read(text, d55, white)
        val error = assertThrows(ColourOutOfReach::class.java) { found.colourOf(raw(1.6, 1.0, 1.0, 1.0)) }
        assertEquals("colour_out_of_reach", error.code)
        assertEquals(4.0, error.threshold)
        assertTrue(error.value!! > 4 && "standard deviations" in error.message)
        assertThrows(InvalidArgument::class.java) { found.colourOf(doubleArrayOf(Double.NaN, 1.0, 1.0)) }
        assertThrows(InvalidArgument::class.java) { found.colourOf(white.raw.values, doubleArrayOf(-1.0, 0.0, 0.0)) }
        assertThrows(InvalidArgument::class.java) { found.colourOf(DoubleArray(4)) }
        assertThrows(InvalidArgument::class.java) { found.colourOf(white.raw.values, DoubleArray(2)) }
    }

    @Test
    fun `references that are none are refused`() {
        val raw = white.raw.toDoubleArray()
        for (wrong in listOf<() -> Any>(
            { Reference(raw, reflectance = 0.0) },
            { Reference(raw, reflectance = Double.NaN) },
            { Reference(raw, tolerance = -0.1) },
            { Reference(doubleArrayOf(1.0, 1.0)) },
            { Reference(raw, DoubleArray(2)) },
            { Reference(doubleArrayOf(1.0, 0.0, 1.0)) },
            { Reference(doubleArrayOf(1.0, Double.POSITIVE_INFINITY, 1.0)) },
            { Reference(raw, DoubleArray(3) { 500.0 }) },
        )) {
            assertThrows(InvalidArgument::class.java) { wrong() }
        }
        raw[0] = 0.0
        assertEquals(4400.0, white.raw[0])
    }

    @Test
    fun `texts that are no result are refused`() {
        val broken = listOf(
            "", "[1]", "{}", "null", text.dropLast(9),
            text.replace("\"curves\":", "\"curve\":"),
            text.replace("\"basis\":\"phones\"", "\"basis\":[]"),
            text.replace(Regex("\"channel_gain\":\\[[^,]*,"), "\"channel_gain\":["),
            text.replace("\"accepted\"", "\"refused\""),
            band("-0.5"),
            band("1e999"),
        )
        assertTrue(broken.none { it == text })
        for (each in broken) {
            assertThrows(InvalidArgument::class.java, { Standardiser.read(each, d55, white) }, each.take(80))
        }
    }

    /** The result with another first number of the red band. */
    private fun band(first: String): String {
        val place = Regex(""""std":\{"red":\[([^,]*)""").find(text)!!.groups[1]!!.range
        return text.replaceRange(place, first)
    }

    /** The excerpt of the result that a passport holds, under a lamp of this name. */
    private fun excerpt(lamp: String): String {
        val curves = listOf("red", "green", "blue").mapIndexed { c, name ->
            "\"$name\":${GoldenResult.curves[c].toList()}"
        }.joinToString(",", "{", "}")
        return """{"format":"camssf-result/1","camera":{"make":"golden","model":"phone"},"ssf":$curves,""" +
            """"channel_gain":[0.55,1,0.7],"shots":[{"lamp":{"name":"$lamp"},"patches":[]}]}"""
    }

    @Test
    fun `the excerpt of a passport serves where it names a lamp`() {
        val found = Standardiser.read(excerpt("D55"), d55, white)
        assertArrayEquals(doubleArrayOf(100.0, 0.0, 0.0), found.colourOf(white.raw.values).lab.values, 0.25)
        for (wrong in listOf("\"patches\":[]" to "\"patches\":[1]", "\"make\"" to "\"maker\"")) {
            val broken = excerpt("D55").replace(wrong.first, wrong.second)
            assertThrows(InvalidArgument::class.java) { Standardiser.read(broken, d55, white) }
        }
    }

    @Test
    fun `without what ties the channels a lamp must be named`() {
        val strange = excerpt("desk.csv")
        val error = assertThrows(InvalidArgument::class.java) { Standardiser.read(strange, null, white) }
        assertTrue("lamp is unknown" in error.message)
        assertNull(Standardiser.read(strange, d55, white).chiSquared)
    }

    @Test
    fun `a result of a light that was not named answers by its estimate, less surely`() {
        val power = d55.values.values
        val estimated = GoldenResult.unnamed(power to DoubleArray(power.size) { 0.2 * power[it] })
        val found = listOf(text, estimated).map { Standardiser.read(it, null, white) }
        assertEquals(found[0].lamps.map { it.name }, found[1].lamps.map { it.name })
        assertEquals(found[1].lamps, Standardiser.read(estimated, Lamp.auto(), white).lamps)
        val (named, unnamed) = found.map { it.colourOf(raw(0.3, 1.2, 1.0, 0.7)) }
        assertArrayEquals(named.lab.values, unnamed.lab.values, 1.0)
        val grown = List(3) { unnamed.labCovariance[it, it] / named.labCovariance[it, it] }
        assertTrue(grown.all { it > 1 } && grown[1] > 1.3, "$grown") // as in Python: 1.006, 1.45, 1.04
    }

    /** A class path as an app's that left ONNX Runtime out. */
    @Test
    fun `without ONNX Runtime the advice names it`() {
        val needed = listOf(
            Standardiser::class.java,
            Grid::class.java,
            org.camssf.model.Models::class.java,
            Unit::class.java,
        )
        val places = needed.map { it.protectionDomain.codeSource.location }.toTypedArray()
        URLClassLoader(places, ClassLoader.getPlatformClassLoader()).use { loader ->
            val (type, lamp, reference) = listOf(Standardiser::class, Lamp::class, Reference::class).map {
                loader.loadClass(it.java.name)
            }
            val read = type.getMethod("read", String::class.java, lamp, reference)
            val known = lamp.getMethod("read", String::class.java).invoke(null, "D55")
            val card = reference.getConstructor(DoubleArray::class.java).newInstance(white.raw.values)
            repeat(2) {
                val thrown =
                    assertThrows(InvocationTargetException::class.java) { read.invoke(null, text, known, card) }
                val error = thrown.targetException
                assertEquals("org.camssf.RuntimeUnfit", error.javaClass.name, error.toString())
                assertTrue("onnxruntime-android of version" in error.toString(), error.toString())
            }
        }
    }

    @Test
    fun `a calibration on this device sees its own chart in its colours`() {
        val file = File(root, "golden/dng/chart-turned-0.dng")
        val corners = Corners.of(22.44, 17.44, 156.56, 22.44, 162.56, 116.56, 16.44, 109.56)
        val chart = ChartTable.read("classic24")
        val lamp = Lamp.read("E")
        val found = SsfCalibrator.openBlocking().use {
            it.calibrateBlocking(Capture(Shot(PhotoSource.of(file), lamp, corners), chart)) as Recovered
        }
        val means = found.capture.shots[0].means
        val black = means.black.values
        fun patch(i: Int) = DoubleArray(3) { means.chart.mean[i, it] - black[it] }
        val reference = Reference(patch(18), reflectance = luminance(chart, 18))
        val own = Standardiser.of(found, lamp, reference)
        val read = Standardiser.read(found.toJson(), lamp, reference)
        for (i in listOf(0, 5, 12, 20)) {
            val colour = own.colourOf(patch(i))
            assertArrayEquals(colour.lab.values, read.colourOf(patch(i)).lab.values)
            val truth = 116 * Math.cbrt(luminance(chart, i)) - 16
            val off = abs(colour.lab[0] - truth) / sqrt(colour.labCovariance[0, 0])
            assertTrue(off < 4, "patch ${i + 1}: L* ${colour.lab[0]}, true $truth")
        }
        val mosaic = DngSource.of(file).use { DngReader.read(it) }
        val regions = RawRegion.measure(mosaic, listOf(Region(80, 50, 94, 64)))
        assertTrue(own.colourOf(regions.single()).lab[0] in 1.0..99.0)
    }

    /** Y of a patch under equal energy. */
    private fun luminance(chart: ChartTable, patch: Int): Double {
        val weights = Tables.observer(Observer.CIE_1931)[1]
        return (0 until Grid.SIZE).sumOf { chart.values[patch, it] * weights[it] } / weights.sum()
    }
}
