package org.camssf.recovery

import org.camssf.Grid
import org.camssf.Rules
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertSame
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import kotlin.math.exp
import kotlin.math.ln
import kotlin.math.sqrt

/** Which basis answers, and how answers are mixed. */
class ChoiceTest {
    private val table = ChartTable.read("classic24")
    private val lamp = Lamp.read("D55").sharedValues
    private val grid = Grid.wavelengths.values
    private val rho = DoubleArray(Grid.SIZE) { 0.9 - 1e-4 * it }

    /** A camera of three bells. */
    private fun bells(shift: Double) = DoubleArray(3 * Grid.SIZE) { at ->
        val u = (grid[at / 3] - listOf(600.0, 540.0, 455.0)[at % 3] - shift) / 35
        exp(-0.5 * u * u)
    }

    private fun known(tolerance: Double) = Known(
        Tensor(table.sharedValues, 24, Grid.SIZE),
        Tensor.full(tolerance, 24),
        Tensor(rho, Grid.SIZE),
        0.01,
        Tensor(lamp, 1, Grid.SIZE),
        Tensor.full(0.0, 1),
        Tensor(DoubleArray(0), 1, 0, Grid.SIZE),
    )

    private fun answer(basis: String, scale: Double, observation: Double, shift: Double, dim: Double = 1.0): Ssf {
        val values = bells(shift)
        val std = DoubleArray(values.size) { 0.01 * scale * (1 + it % 3) }
        val light = DoubleArray(lamp.size) { dim * lamp[it] }
        val curves = Ssf.Curves(values, std, DoubleArray(72) { shift }, null, DoubleArray(72), light)
        val steps = IntArray(1) { shift.toInt() }
        val proof = Ssf.Proof(DoubleArray(3) { shift / 10 + it }, DoubleArray(1) { shift }, steps, observation)
        return Ssf(curves, proof, DoubleArray(3) { 1.0 }, DoubleArray(3), 1.0, basis, Ssf.Family(scale))
    }

    /** Of phones and cameras at both scales, all believed alike. */
    private fun four(vararg observation: Double) = listOf(
        answer("phones", 1.0, observation[0], 10.0, 1.1),
        answer("phones", 2.0, observation[1], 12.0),
        answer("cameras", 1.0, observation[2], 2.0),
        answer("cameras", 2.0, observation[3], 0.0, 0.7),
    )

    private val even = List(4) { 0.0 }

    @Test
    fun `probabilities are those of evidence and belief`() {
        val beliefs = listOf(0.95, 0.05, 0.95, 0.05).map { ln(it) }
        val chosen = Choice.choose(known(0.03), four(800.0, 801.0, 799.0, 798.0), beliefs).choice
        val whole = listOf(0.95, 0.05 * exp(1.0), 0.95 * exp(-1.0), 0.05 * exp(-2.0))
        chosen.forEachIndexed { i, each -> assertEquals(whole[i] / whole.sum(), each.probability, 1e-12) }
        assertEquals(listOf("phones", "phones", "cameras", "cameras"), chosen.map { it.basis })
        assertEquals(listOf(800.0, 801.0, 799.0, 798.0), chosen.map { it.logEvidence })
    }

    /** The law of total variance, written out. */
    private fun mixture(of: List<Ssf>, weights: List<Double>): Pair<DoubleArray, DoubleArray> {
        fun peaked(values: DoubleArray, peaks: DoubleArray) = DoubleArray(values.size) {
            val c = it % 3
            values[it] / (0 until Grid.SIZE).maxOf { m -> peaks[3 * m + c] }
        }
        val curves = of.map { peaked(it.sharedValues, it.sharedValues) }
        val bands = of.map { peaked(it.sharedStd!!, it.sharedValues) }
        val mean = DoubleArray(3 * Grid.SIZE) { at -> weights.indices.sumOf { weights[it] * curves[it][at] } }
        val std = DoubleArray(mean.size) { at ->
            val second = weights.indices.sumOf {
                weights[it] * (bands[it][at] * bands[it][at] + curves[it][at] * curves[it][at])
            }
            sqrt(second - mean[at] * mean[at])
        }
        return mean to std
    }

    private fun checkMixed(found: Ssf, of: List<Ssf>, weights: List<Double>) {
        val (mean, std) = mixture(of, weights)
        val scale = DoubleArray(3) { c ->
            (0 until Grid.SIZE).sumOf { rho[it] * lamp[it] * mean[3 * it + c] } * Grid.STEP
        }
        for (at in mean.indices) {
            assertEquals(mean[at] / scale[at % 3], found.sharedValues[at], 1e-12 / scale[at % 3])
            assertEquals(std[at] / scale[at % 3], found.sharedStd!![at], 1e-7 / scale[at % 3])
        }
        val light = DoubleArray(lamp.size) { m -> of.indices.sumOf { weights[it] * of[it].sharedLamp[m] } }
        assertArrayEquals(light, found.sharedLamp, 1e-12 * light.max())
        for (c in 0..2) {
            val seen = DoubleArray(Grid.SIZE) { light[it] * found.sharedValues[3 * it + c] }
            val white = dot(rho, seen)
            for (i in listOf(0, 7, 23)) {
                assertEquals(dot(table.reflectance(i), seen) / white, found.sharedPredicted[3 * i + c], 1e-12)
            }
            assertEquals(of.maxOf { it.sharedGap[c] }, found.sharedGap[c])
        }
        assertEquals(of.maxOf { it.sharedLayersGap[0] }, found.sharedLayersGap[0])
        assertEquals(of.maxOf { it.sharedFinishSteps[0] }, found.sharedFinishSteps[0])
    }

    @Test
    fun `where none wins all are mixed, and the likeliest lends the rest`() {
        val answers = four(5.0, 3.0, 4.5, 2.0)
        val found = Choice.choose(known(0.03), answers, even)
        checkMixed(found, answers, found.choice.map { it.probability })
        assertEquals("phones" to 1.0, found.basis to found.priorScale)
        assertEquals(10.0, found.sharedCode[0])
        assertEquals(5.0, found.logEvidence)
    }

    @Test
    fun `a basis twenty times as probable answers alone, its widths mixed`() {
        val answers = four(0.0, 0.0, 5.0, 4.0)
        val found = Choice.choose(known(0.03), answers, even)
        val own = found.choice.drop(2).map { it.probability }
        assertTrue(own.sum() > 20.0 / 21.0)
        checkMixed(found, answers.drop(2), own.map { it / own.sum() })
        assertEquals("cameras", found.basis)
        // just short of it
        val near = Choice.choose(known(0.03), four(0.0, 0.0, ln(19.0), ln(19.0)), even)
        assertEquals(1.0 / 20.0, near.choice.take(2).sumOf { it.probability }, 1e-12)
        checkMixed(near, four(0.0, 0.0, ln(19.0), ln(19.0)), near.choice.map { it.probability })
        val clear = Choice.choose(known(0.03), four(0.0, 0.0, ln(20.1), ln(20.1)), even)
        checkMixed(clear, answers.drop(2), listOf(0.5, 0.5))
    }

    @Test
    fun `what weighs less than a millionth is left out`() {
        val answers = four(20.0, 4.0, 0.0, 0.0)
        val found = Choice.choose(known(0.03), answers, even)
        assertArrayEquals(answers[0].sharedValues, found.sharedValues)
        assertSame(answers[0].sharedStd, found.sharedStd)
        assertEquals(4, found.choice.size)
    }

    @Test
    fun `a maker's name is a belief`() {
        val clear = Rules.shipped.number("choice.maker")
        for (name in listOf("Apple", "Google", "motorola", "HUAWEI", "LG Electronics", "OnePlus")) {
            assertEquals(mapOf("phones" to clear), Choice.priorOdds(name, ""), name)
        }
        for (name in listOf("NIKON CORPORATION", "Canon", "OM Digital Solutions")) {
            assertEquals(mapOf("cameras" to clear), Choice.priorOdds(name, ""), name)
        }
        for (name in listOf("", "samsung", "SONY", "My Apple")) {
            assertEquals(emptyMap<String, Double>(), Choice.priorOdds(name, ""), name)
        }
        // Who makes both is told by the model.
        for ((make, model) in listOf("samsung" to "SM-G991B", "Sony" to "XQ-DQ72")) {
            assertEquals(mapOf("phones" to clear), Choice.priorOdds(make, model), model)
        }
        for ((make, model) in listOf("SAMSUNG" to "NX500", "SONY" to "ILCE-7M3")) {
            assertEquals(mapOf("cameras" to clear), Choice.priorOdds(make, model), model)
        }
    }

    @Test
    fun `a belief multiplies the odds, and the models answer as when asked alone`() {
        val camera = bells(0.0)
        val signals = DoubleArray(72) { at ->
            val seen = DoubleArray(Grid.SIZE) { lamp[it] * camera[3 * it + at % 3] }
            dot(table.reflectance(at / 3), seen) / dot(rho, seen)
        }
        val given = Observation(Tensor(signals, 1, 24, 3), Tensor.full(0.003, 1, 24, 3), known(0.03))
        val penalties = Penalties(null, null, null)
        val engines = Choice.FAMILIES.map { OnnxEngine.load(it) }
        try {
            fun choice(prior: Map<String, Double>) = Choice.recover(engines, given, null, penalties, prior).choice
            val even = choice(emptyMap())
            assertEquals(1.0, even.sumOf { it.probability }, 1e-12)
            even.forEachIndexed { i, each ->
                val alone = Recover.recover(engines[i], given, null, penalties)
                assertEquals(engines[i].basis, each.basis)
                assertEquals(alone.logEvidence, each.logEvidence)
                assertEquals(alone.logEvidence!!, Recover.logEvidence(engines[i], given, 1.0), 1e-9)
                assertEquals(emptyList<Hypothesis>(), alone.choice)
            }
            // Phones, with an RYYB sensor or not, against cameras.
            fun odds(of: List<Hypothesis>): Double {
                val (cameras, phones) = of.partition { it.basis == "cameras" }
                return phones.sumOf { it.probability } / cameras.sumOf { it.probability }
            }
            assertEquals(20.0 * odds(even), odds(choice(mapOf("phones" to 20.0))), 1e-9 * 20.0 * odds(even))
            // An RYYB sensor is believed in one phone of twenty.
            val yellow = exp(even[2].logEvidence - even[0].logEvidence) / 20.0
            assertEquals(yellow, even[2].probability / even[0].probability, 1e-9 * yellow)
        } finally {
            engines.forEach { it.close() }
        }
    }
}
