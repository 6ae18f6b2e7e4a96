package org.camssf.verdict

import org.camssf.Grid
import org.camssf.Reason
import org.camssf.Rules
import org.camssf.photo.ChartPose
import org.camssf.photo.FrameMeans
import org.camssf.photo.LensShading
import org.camssf.photo.MeasuredShot
import org.camssf.photo.PatchMeans
import org.camssf.photo.Photo
import org.camssf.photo.Signals
import org.camssf.recovery.FamilyTest
import org.camssf.recovery.Hypothesis
import org.camssf.recovery.OnnxEngine
import org.camssf.recovery.Ssf
import org.camssf.recovery.UnfamiliarCamera
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import org.junit.jupiter.api.AfterEach
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertNull
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import kotlin.math.exp
import kotlin.math.sqrt

/** A sound capture of a camera of three bells, and what makes it doubtful. */
class JudgeTest {
    private val engine = OnnxEngine.load("phones")

    @AfterEach
    fun close() = engine.close()

    private val table = ChartTable.read("classic24")
    private val lamp = Lamp.read("D55")
    private val n = 24
    private val white = DoubleArray(Grid.SIZE) { 1.0 }
    private var asked = 0

    private val curves = DoubleArray(3 * Grid.SIZE) {
        val u = (Grid.wavelengths[it / 3] - listOf(600.0, 540.0, 455.0)[it % 3]) / 35
        exp(-0.5 * u * u)
    }

    /** A frame of shares of a white of 10000 DN above black, 400 samples a patch, with the noise of light. */
    private fun frame(share: DoubleArray): FrameMeans {
        val level = DoubleArray(3 * n) { 500.0 + 10000.0 * share[it] }
        val error = DoubleArray(3 * n) { sqrt((4.0 + 10000.0 * share[it]) / 400) }
        val greens = DoubleArray(2 * n) { level[3 * (it / 2) + 1] }
        val none = DoubleArray(3 * n)
        return FrameMeans(level, error, LongArray(3 * n) { 400 }, none, none, none, greens)
    }

    /** @param off what every signal is multiplied by in one patch of two. */
    private fun judged(
        off: Double,
        choice: List<Hypothesis>,
        family: String?,
        vararg rivals: Rival,
        test: FamilyTest? = null,
    ): Verdict {
        val predicted = DoubleArray(3 * n) { at ->
            val seen = DoubleArray(Grid.SIZE) { lamp.sharedValues[it] * curves[3 * it + at % 3] }
            val reflectance = table.reflectance(at / 3)
            seen.indices.sumOf { reflectance[it] * seen[it] } / seen.sum()
        }
        val y = DoubleArray(3 * n) { predicted[it] * if (it / 3 % 2 == 0) off else 1.0 }
        val (chart, flat, dark) = listOf(y, DoubleArray(3 * n) { 1.0 }, DoubleArray(3 * n)).map { frame(it) }
        val error = DoubleArray(3 * n) { 0.003 }
        val used = BooleanArray(n) { true }
        val signals = Signals(1, n, y, error, chart.sharedMean, flat.sharedMean, dark.sharedMean, used, emptyList())
        val std = DoubleArray(3 * Grid.SIZE) { 0.01 }
        val ssf = Ssf(
            Ssf.Curves(curves, std, DoubleArray(72) { 0.1 }, null, predicted, lamp.sharedValues),
            Ssf.Proof(DoubleArray(3), DoubleArray(1), IntArray(1), 0.0),
            DoubleArray(3) { 1.0 },
            DoubleArray(3),
            1.0,
            "phones",
        ).chosen(choice).let { own -> test?.let { own.withFamilyTest(it, 0.0) } ?: own }
        val square = doubleArrayOf(-1.0, -1.0, 1.0, -1.0, 1.0, 1.0, -1.0, 1.0)
        val quads = DoubleArray(8 * n) { square[it % 8] + 10.0 * if (it % 2 == 0) it / 8 % 6 else it / 8 / 6 }
        val pose = ChartPose("classic24", square, quads, 0, "by hand", 1.0, emptyList())
        val photo = Photo("a", 60, 40, 1, null, null, false, "a", "b", "")
        val means = PatchMeans(chart, flat, dark, DoubleArray(3) { 500.0 }, 16000.0)
        val shot = MeasuredShot(lamp, photo, photo, photo, pose, means, LensShading.AS_STORED)
        val inputs = VerdictInputs(engine, signals, table, listOf(lamp), ssf, white, 0.01)
        val case = Case(inputs, listOf(shot), emptyList(), listOf(emptyList()), family) {
            asked++
            rivals.toList()
        }
        return Judge.judge(case)
    }

    private fun weights(phones: Double) =
        listOf(Hypothesis("phones", 0.0, phones), Hypothesis("cameras", 0.0, 1.0 - phones))

    @Test
    fun `a sound capture is accepted, and its rivals were asked for`() {
        val found = judged(1.0, weights(1.0), "phones", Rival(0, "A", -3.0))
        assertEquals(emptyList<String>(), found.reasons.map { it.message })
        assertEquals(Status.ACCEPTED to 1, found.outcome to asked)
    }

    @Test
    fun `rivals of a capture that is refused already are weighed, but not judged`() {
        val found = judged(1.4, emptyList(), null, Rival(0, "A", -30.0))
        assertEquals(Status.REFUSED to 1, found.outcome to asked)
        assertTrue(found.checks.none { it.name == "rival" })
    }

    @Test
    fun `a rival out of the question refuses what was sound`() {
        val found = judged(1.0, emptyList(), null, Rival(0, "A", 30.0))
        assertEquals(Status.REFUSED to listOf("lamp_unfit"), found.outcome to found.reasons.map { it.code })
        assertEquals("lamp_unfit", Reasons.refusal(found).code)
    }

    @Test
    fun `a camera of no family makes it doubtful`() {
        val test = FamilyTest(0.2, 1.1, 0.05, 0.8)
        val (length, lamp) = judged(1.0, weights(1.0), null, test = test).reasons
        assertEquals(listOf("camera_unusual", "camera_unusual"), listOf(length.code, lamp.code))
        assertEquals(listOf(0.2, 0.05, 1.1, 0.8), listOf(length.value, length.threshold, lamp.value, lamp.threshold))
        assertTrue("the measured phones" in length.message, length.message)
        assertTrue("tinted glass" in lamp.advice, lamp.advice)
        val usual = FamilyTest(0.04, 0.7, 0.05, 0.8)
        assertEquals(emptyList<Reason>(), judged(1.0, weights(1.0), null, test = usual).reasons)
        assertEquals(emptyList<Reason>(), judged(1.0, emptyList(), "phones").reasons)
    }

    @Test
    fun `in an unnamed light the signals must say phone, whoever made it`() {
        val maker = Rules.shipped.number("choice.maker")
        for ((family, odds) in listOf("phones" to maker, "cameras" to 1 / maker, null to 1.0)) {
            fun said(phone: Double): Pair<Boolean, Double?>? {
                val ratio = phone / (1.0 - phone) * odds
                return Light.unnamed(weights(ratio / (1.0 + ratio)), family).singleOrNull()?.let {
                    it.fatal to it.value
                }
            }
            assertNull(said(0.78))
            assertEquals(false to 0.76, said(0.76)!!.let { it.first to Math.round(it.second!! * 1e9) / 1e9 })
            assertEquals(true to 0.19, said(0.19)!!.let { it.first to Math.round(it.second!! * 1e9) / 1e9 })
        }
        val choice = listOf(Hypothesis("phones", 0.0, 1.0, listOf("bulb")))
        assertEquals(emptyList<Reason>(), Light.unnamed(choice, null))
        val doubtful = Light.unnamed(weights(0.5), null).single()
        assertEquals("lamp_unfit" to 0.77, doubtful.code to doubtful.threshold)
        assertTrue("%" !in doubtful.message && "--lamp" !in doubtful.advice, doubtful.advice)
    }

    @Test
    fun `the length of the code is a normal number under the prior`() {
        // Ten directions fully known, none of the others: the square root of χ² of ten degrees of freedom.
        val covariance = DoubleArray(72 * 72) { if (it / 72 == it % 72 && it / 72 >= 10) 1.0 else 0.0 }
        fun of(square: Double, covariance: DoubleArray?): Double? {
            val code = DoubleArray(72).also { it[40] = sqrt(square) }
            val std = DoubleArray(3 * Grid.SIZE) { 0.01 }
            val own = Ssf.Curves(curves, std, code, covariance, DoubleArray(72), lamp.sharedValues)
            val proof = Ssf.Proof(DoubleArray(3), DoubleArray(1), IntArray(1), 0.0)
            return UnfamiliarCamera.codeLength(Ssf(own, proof, DoubleArray(3), DoubleArray(3), 1.0, "phones"))
        }
        // Upper quantiles of χ² of 10 and of the normal distribution, from tables.
        for ((square, normal) in listOf(9.342 to 0.0, 21.161 to 2.0537, 29.588 to 3.0902)) {
            assertEquals(normal, of(square, covariance)!!, 0.03)
        }
        assertNull(of(10.0, null))
        assertNull(of(10.0, DoubleArray(72 * 72) { if (it / 72 == it % 72) 1.0 else 0.0 }))
    }

    @Test
    fun `so does a camera of the other family than its maker's`() {
        val choice = weights(0.98)
        val found = judged(1.0, choice, "cameras").reasons.single()
        assertEquals("camera_unusual" to 0.98, found.code to found.value)
        for (family in listOf("phones", null)) {
            assertEquals(emptyList<Reason>(), judged(1.0, choice, family).reasons)
        }
    }

    @Test
    fun `verdicts and reasons print and compare`() {
        fun reason(change: Int = -1) = Reason(
            if (change == 0) "other" else "glare",
            if (change == 1) "Other." else "Something shines.",
            if (change == 2) "Other." else "Turn the chart.",
            if (change == 3) null else 2.0,
            if (change == 4) null else 1.0,
        )
        assertEquals("glare: Something shines. Turn the chart.", "${reason()}")
        assertEquals(reason(), reason())
        assertEquals(reason().hashCode(), reason().hashCode())
        assertTrue((0..4).none { reason(it) == reason() || reason(it).hashCode() == reason().hashCode() })
        val doubtful = Verdict(Status.DOUBTFUL, listOf(reason(), reason(0)))
        assertEquals("doubtful: glare, other", "$doubtful")
        assertEquals("accepted", "${Verdict(Status.ACCEPTED, emptyList())}")
        assertEquals(doubtful, Verdict(Status.DOUBTFUL, listOf(reason(), reason(0))))
        assertEquals(31 * Status.DOUBTFUL.hashCode() + doubtful.reasons.hashCode(), doubtful.hashCode())
        val others = listOf(Verdict(Status.REFUSED, doubtful.reasons), Verdict(Status.DOUBTFUL, listOf(reason())), "")
        assertTrue(others.none { doubtful == it })
    }
}
