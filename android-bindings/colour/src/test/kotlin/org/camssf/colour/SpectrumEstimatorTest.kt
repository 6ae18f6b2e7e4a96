package org.camssf.colour

import org.camssf.InvalidArgument
import org.camssf.LampUnfit
import org.camssf.photo.LensShading
import org.camssf.photo.Mosaic
import org.camssf.photo.Region
import org.camssf.spectra.Lamp
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertFalse
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test

/** The face of spectra; the golden stage `spectrum` holds its numbers. */
class SpectrumEstimatorTest {
    private val text = GoldenResult.text
    private val white = Reference(doubleArrayOf(4400.0, 8000.0, 5600.0), doubleArrayOf(4.0, 4.0, 4.0))
    private val light = PhotoLight(Lamp.read("D55"), white)
    private val strip = doubleArrayOf(1500.0, 2000.0, 1000.0)
    private val noise = DoubleArray(3) { 10.0 }

    @Test
    fun `a grey is flat, and half the light is half the spectrum`() {
        val estimator = SpectrumEstimator.read(text, listOf(light))
        val grey = estimator.spectrumOf(DoubleArray(3) { 0.2 * white.raw[it] }, DoubleArray(3))
        val nm = SurfaceSpectrum.wavelengths.values
        assertEquals(listOf(380.0, 720.0), listOf(nm.first(), nm.last()))
        for (i in nm.indices) if (nm[i] in 420.0..680.0) assertEquals(0.2, grey.reflectance[i], 0.01)
        assertEquals(116 * Math.cbrt(0.2) - 16, grey.lab[0], 0.1)
        val still = DoubleArray(3)
        val (whole, half) = listOf(1.0, 0.5).map { share ->
            SpectrumEstimator.read(text, listOf(PhotoLight(light.lamp, Reference(white.raw.values))))
                .spectrumOf(DoubleArray(3) { strip[it] * share }, still)
        }
        assertArrayEquals(whole.reflectance.values, DoubleArray(35) { 2 * half.reflectance[it] }, 1e-12)
        assertArrayEquals(whole.covariance.values, DoubleArray(35 * 35) { 4 * half.covariance.values[it] }, 1e-12)
        assertEquals(whole.distance, half.distance, 1e-9)
    }

    @Test
    fun `parts add up, and an index follows from the spectrum`() {
        val estimator = SpectrumEstimator.read(text, listOf(light), SurfacePrior.read("skin"))
        assertEquals("skin", estimator.prior.name)
        assertEquals(listOf("D55"), estimator.lamps.single().names)
        assertTrue(estimator.chiSquared!! < 1)
        val skin = estimator.spectrumOf(strip, noise)
        for (i in 0 until 35) {
            val parts = Part.values().sumOf { part -> skin.deviation(part)[i].let { it * it } }
            assertEquals(parts, skin.covariance[i, i], 1e-12)
            assertEquals(parts, skin.standardDeviation[i].let { it * it }, 1e-12)
        }
        assertTrue(skin.fromPhoto in 0.0..1.0)
        val melanin = skin.index(SkinIndex.MELANIN)
        val red = skin.reflectance.values.slice(27..32).map { -Math.log10(it) }.average()
        assertEquals(red, melanin.value, 0.01)
        assertTrue(melanin.standardDeviation > 0)
        assertEquals(0.0, SkinIndex.ERYTHEMA.weights.sum(), 1e-12)
        assertEquals(1.0, SkinIndex.MELANIN.weights.sum(), 1e-12)
    }

    @Test
    fun `a second light tells more, and a region is its signals`() {
        val bulb = PhotoLight(Lamp.read("A"), Reference(DoubleArray(3) { white.raw[it] * warmer(it) }))
        val estimator = SpectrumEstimator.read(text, listOf(light, bulb))
        assertEquals(listOf("D55", "A"), estimator.lamps.single().names)
        val area = Region(0, 0, 20, 20)
        val lit = DoubleArray(3) { strip[it] * warmer(it) }
        val sensor = Mosaic.Sensor("RGGB", DoubleArray(4), 4095.0)
        val photo = Mosaic(Mosaic.Origin("strip.dng"), 2, 2, Region(0, 0, 2, 2), ShortArray(4), sensor)
        val source = SignalSource(photo.facts, LensShading.AS_STORED)
        val both = estimator.spectrumOf(RawRegion(area, strip, noise, source), RawRegion(area, lit, noise, source))
        assertEquals(estimator.spectrumOf(strip + lit, noise + noise).reflectance, both.reflectance)
        val grey = DoubleArray(3) { 0.2 * white.raw[it] }
        val warm = DoubleArray(3) { grey[it] * warmer(it) }
        val one = SpectrumEstimator.read(text, listOf(light)).spectrumOf(grey, noise)
        assertTrue(estimator.spectrumOf(grey + warm, noise + noise).fromPhoto > one.fromPhoto)
    }

    /** The raw signal of a white under A over that under D55. */
    private fun warmer(channel: Int): Double {
        val curve = GoldenResult.curves[channel]
        val (bulb, day) = listOf("A", "D55").map { name ->
            Lamp.read(name).values.values.let { power -> power.indices.sumOf { power[it] * curve[it] } }
        }
        return bulb / day
    }

    @Test
    fun `signals of no surface are outside of the prior`() {
        val estimator = SpectrumEstimator.read(text, listOf(light), SurfacePrior.read("skin"))
        assertFalse(estimator.spectrumOf(strip, noise).outsidePrior)
        val green = doubleArrayOf(100.0, 4000.0, 100.0)
        assertTrue(estimator.spectrumOf(green, noise).let { it.outsidePrior && it.distance > 4 })
    }

    @Test
    fun `what is no photo, no surface or no prior is refused`() {
        val estimator = SpectrumEstimator.read(text, listOf(light))
        for (wrong in listOf<() -> Any>(
            { SpectrumEstimator.read(text, emptyList()) },
            { SpectrumEstimator.read(text, List(3) { light }) },
            { SurfacePrior.read("fur") },
            { estimator.spectrumOf(strip + strip, noise + noise) },
            { estimator.spectrumOf(strip, DoubleArray(2)) },
            { estimator.spectrumOf(doubleArrayOf(Double.NaN, 1.0, 1.0), noise) },
            { estimator.spectrumOf(strip, doubleArrayOf(-1.0, 0.0, 0.0)) },
        )) {
            assertThrows(InvalidArgument::class.java) { wrong() }
        }
        val bulb = PhotoLight(Lamp.read("A"), white)
        assertThrows(LampUnfit::class.java) { SpectrumEstimator.read(text, listOf(bulb)) }
    }

    @Test
    fun `the shipped priors hold their surfaces`() {
        val (general, skin) = listOf("general", "skin").map { SurfacePrior.read(it) }
        assertEquals(760 + 97, general.shape("shapes")[0])
        assertEquals(97, skin.shape("shapes")[0])
        for (shape in general.arrays.getValue("shapes").rows()) assertEquals(1.0, shape.average(), 1e-12)
        assertEquals(5, skin.shape("changes")[0])
        assertTrue(general.arrays.getValue("changes").values.all { it == 0.0 })
        assertTrue(general.arrays.getValue("variances").values.all { it > 0 })
        assertEquals(Math.log(8.0), general.arrays.getValue("log_weights").values.last(), 1e-15)
    }

    private fun SurfacePrior.shape(name: String): IntArray = arrays.getValue(name).shape
}
