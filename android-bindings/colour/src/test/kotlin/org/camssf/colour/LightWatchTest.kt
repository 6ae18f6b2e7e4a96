package org.camssf.colour

import org.camssf.FramesDiffer
import org.camssf.Underexposed
import org.camssf.photo.Mosaic
import org.camssf.photo.PhysicalCamera
import org.camssf.photo.Region
import org.camssf.spectra.Lamp
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertNull
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Tag
import org.junit.jupiter.api.Test
import java.util.Random
import kotlin.math.abs
import kotlin.math.exp
import kotlin.math.sqrt

/** Live frames of a white beside a strip: the light's colour is watched, its level corrected. */
@Tag("R-COLOUR")
class LightWatchTest {
    private val text = GoldenResult.text
    private val whiteArea = Region(0, 0, 38, 28)
    private val stripArea = Region(0, 32, 38, 58)
    private val balance = doubleArrayOf(1.2, 1.0, 0.7)

    /** A frame in a light of which `red`, `blue` and `level` are parts of the calibration's. */
    private fun frame(
        red: Double = 1.0,
        blue: Double = 1.0,
        level: Double = 1.0,
        exposure: Double = 0.01,
        model: String = "phone",
        seed: Long = 1,
        noise: Double = 0.01,
    ): Mosaic {
        val random = Random(seed)
        val light = doubleArrayOf(level * red, level, level * blue)
        val origin = PaintedPhoto.origin(model = model, exposure = exposure, camera = PhysicalCamera("0", "S-1"))
        return PaintedPhoto.of(40, 60, origin = origin) { _, y, c ->
            light[c] * exposure / 0.01 * (if (y < 30) 1.0 else 0.3 * balance[c]) + noise * random.nextGaussian()
        }
    }

    private fun regions(of: Mosaic) = RawRegion.measure(of, listOf(whiteArea, stripArea))

    private fun watch(of: Mosaic = frame(), lamp: Lamp? = Lamp.read("D55")) =
        LightWatch(Standardiser.read(text, lamp, Reference(regions(of)[0])))

    private fun LightWatch.look(frame: Mosaic): LiveColours {
        val (white, strip) = regions(frame)
        return look(listOf(strip), white)
    }

    private val start = watch().look(frame()).colours.single()

    @Test
    fun `in the same light a region has its colour, and nothing is said`() {
        val found = watch().look(frame(seed = 2))
        assertEquals(emptyList<Any>(), found.guidance)
        assertTrue(found.chiSquared!! < WhiteRatios.CONTRADICTED)
        assertEquals(1.0, found.level!!, 0.003)
        val colour = found.colours.single()
        for (c in 0..2) {
            // Both frames have the noise of white and strip, and half of the rounding.
            val noise = sqrt(2.0) * colour.deviation(Part.NOISE)[c]
            assertTrue(abs(colour.lab[c] - start.lab[c]) < 5 * noise, "$c: ${colour.lab} ${start.lab}")
        }
    }

    @Test
    fun `another level of the light is corrected by the white, with any exposure`() {
        for ((level, exposure) in listOf(0.7 to 0.01, 1.3 to 0.01, 0.7 to 0.005)) {
            val found = watch().look(frame(level = level, exposure = exposure, seed = 3))
            assertEquals(emptyList<Any>(), found.guidance)
            assertEquals(level, found.level!!, 0.005)
            assertArrayEquals(start.lab.values, found.colours.single().lab.values, 1.0)
        }
    }

    @Test
    fun `without the white the level counts, and the guidance says that nothing was compared`() {
        val strip = regions(frame(level = 0.7))[1]
        val found = watch().look(listOf(strip))
        assertEquals("lamp_unfit.white_unseen", found.guidance.single().key)
        assertNull(found.chiSquared)
        assertNull(found.level)
        assertEquals(0.7 * start.xyz[1], found.colours.single().xyz[1], 0.01 * start.xyz[1])
    }

    @Test
    fun `another colour of the light is said in numbers, and no colour is given`() {
        val curves = GoldenResult.curves
        fun seen(lamp: Lamp, c: Int) = lamp.values.values.indices.sumOf { lamp.values[it] * curves[c][it] }
        for (name in listOf("D65", "D50", "A", "LED-B3")) {
            val (red, green, blue) = (0..2).map { seen(Lamp.read(name), it) / seen(Lamp.read("D55"), it) }
            val found = watch().look(frame(red / green, blue / green))
            assertEquals(0, found.colours.size, name)
            val said = found.guidance.single()
            assertEquals("lamp_unfit.light_changed", said.key)
            assertEquals(red / green - 1, said.arguments.getValue("red") as Double, 0.01)
            assertEquals(blue / green - 1, said.arguments.getValue("blue") as Double, 0.01)
            assertTrue(said.value!! > said.threshold!! && said.threshold == 18.4)
        }
    }

    @Test
    fun `an unnamed light that is not the calibration's is to be named`() {
        val own = watch(lamp = null).look(frame(seed = 4))
        assertEquals(emptyList<Any>(), own.guidance)
        val warm = frame(red = 1.4, blue = 0.6)
        val other = watch(warm, lamp = null).look(warm)
        val said = other.guidance.single()
        assertEquals("lamp_unfit.uncalibrated_light", said.key)
        assertEquals(0.4, said.arguments.getValue("red") as Double, 0.01)
        assertTrue("Name the lamp" in said.advice)
        assertEquals(1, other.colours.size)
        assertEquals(emptyList<Any>(), watch(warm, Lamp.read("bulb")).look(warm).guidance)
    }

    @Test
    fun `noise alone exceeds the bound as rarely as chance does`() {
        val random = Random(7)
        val raw = doubleArrayOf(4400.0, 8000.0, 5600.0)
        val (first, later) = doubleArrayOf(30.0, 40.0, 25.0) to doubleArrayOf(20.0, 10.0, 60.0)
        fun drawn(error: DoubleArray) =
            WhiteRatios(DoubleArray(3) { raw[it] + error[it] * random.nextGaussian() }, error, 0.0)
        val draws = 100_000
        val found = DoubleArray(draws) { drawn(later).since(drawn(first)).chiSquared }
        for (bound in listOf(1.0, 4.6, 9.2, WhiteRatios.CONTRADICTED)) {
            val wanted = draws * exp(-bound / 2) // of χ² with two degrees of freedom
            val count = found.count { it > bound }
            assertTrue(abs(count - wanted) < 4 * sqrt(wanted), "$count of $wanted above $bound")
        }
    }

    @Test
    fun `a change within the reference's tolerance is within what the colours state`() {
        val (white, strip) = regions(frame())
        val loose = LightWatch(Standardiser.read(text, Lamp.read("D55"), Reference(white, tolerance = 0.05)))
        val later = regions(frame(red = exp(0.05), seed = 2))
        assertEquals(1, loose.look(listOf(later[1]), later[0]).colours.size)
        val strict = LightWatch(Standardiser.read(text, Lamp.read("D55"), Reference(white, tolerance = 0.0)))
        assertEquals(0, strict.look(listOf(later[1]), later[0]).colours.size)
        assertEquals(1, strict.look(listOf(strip), white).colours.size)
    }

    @Test
    fun `a white in the dark is refused with advice`() {
        val error = assertThrows(Underexposed::class.java) { watch().look(frame(level = 1e-4, noise = 0.001)) }
        assertEquals("strip.dng: the white is too dark to compare its light.", error.message)
    }

    @Test
    fun `another camera's frame is refused`() {
        assertThrows(FramesDiffer::class.java) { watch().look(frame(model = "tablet")) }
    }
}
