package org.camssf

import org.camssf.photo.Capture
import org.camssf.photo.ChartPose
import org.camssf.photo.ColourMatrix
import org.camssf.photo.Corners
import org.camssf.photo.LensShading
import org.camssf.photo.PhotoSource
import org.camssf.photo.Shot
import org.camssf.photo.dng.DngReader
import org.camssf.photo.dng.DngSource
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import java.io.File
import java.lang.reflect.Modifier

/** Whatever a caller writes into what he was given, nothing that camssf holds changes. */
class UnchangedTest {
    private val photo = File(System.getProperty("camssf.root"), "golden/dng/chart-turned-0.dng")
    private val seen = HashSet<Any>()
    private val changed = ArrayList<String>()
    private var lists = 0

    private fun getters(type: Class<*>) = type.methods.filter {
        it.parameterCount == 0 && it.name.startsWith("get") && '$' !in it.name &&
            !Modifier.isStatic(it.modifiers) &&
            it.declaringClass.name.startsWith("org.camssf.")
    }

    /** Everything that public getters lead to is overwritten; what they give afterwards is compared. */
    private fun vandalise(of: Any, path: String) {
        if (of is Enum<*> || of is Throwable || !seen.add(System.identityHashCode(of))) return
        for (getter in getters(of.javaClass)) {
            fun get(): Any? = getter.invoke(of)
            val name = "$path.${getter.name}"
            if (name.endsWith("getSamples")) continue // documented: handed over, not copied
            if (get()?.javaClass?.isArray == true) changed += "$name is an array"
            val before = content(get())
            if (get() is Collection<*> && get() !== get()) changed += "$name copies"
            overwrite(get())
            if (content(get()) != before) changed += name
            when (val value = get()) {
                is List<*> -> value.filterNotNull().forEach { if (ours(it)) vandalise(it, name) }
                null -> Unit
                else -> if (ours(value)) vandalise(value, name)
            }
        }
    }

    private fun ours(value: Any) = value.javaClass.name.startsWith("org.camssf.")

    private fun content(value: Any?): String = when (value) {
        is List<*> -> value.joinToString(prefix = "${value.size}: ") {
            if (it != null &&
                ours(it)
            ) {
                ""
            } else {
                content(it)
            }
        }

        else -> "$value".substringBefore('@')
    }

    /** Writes into a list, also into one in a list. */
    private fun overwrite(value: Any?) {
        if (value !is List<*>) return
        lists++
        value.forEach { if (it != null && !ours(it)) overwrite(it) }
        @Suppress("UNCHECKED_CAST")
        runCatching { (value as MutableList<Any?>).add(null) }
    }

    @Test
    fun `a result is what it was`() {
        SsfCalibrator.openBlocking().use { calibrator ->
            val lamp = Lamp.read("daylight") // one with a mode
            val numbers = chartCorners.toArray()
            val shots = arrayListOf(Shot(PhotoSource.of(photo), lamp, Corners.of(*numbers)))
            val capture = Capture(shots, ChartTable.read("classic24"))
            numbers.fill(0.0)
            shots.clear()
            val found = calibrator.calibrateBlocking(capture)
            val text = found.toJson()
            vandalise(found, "found")
            vandalise(capture, "capture")
            assertEquals(emptyList<String>(), changed)
            assertTrue(seen.size >= 30 && lists >= 6, "${seen.size} objects, $lists lists")
            assertEquals(text, found.toJson())
            assertEquals(text, calibrator.calibrateBlocking(capture).toJson())
        }
    }

    @Test
    fun `a mosaic and a pose are what they were`() {
        val mosaics = listOf("metadata", "metadata-phone", "opcodes", "patches-mapped").map { name ->
            DngSource.of(File(photo.parentFile, "$name.dng")).use { DngReader.read(it) }
        }
        val corrections = mosaics.map { it.corrections }
        assertTrue(corrections.any { it.gainMaps.isNotEmpty() } && corrections.any { it.badPixels.isNotEmpty() })
        mosaics.forEachIndexed { i, mosaic -> vandalise(mosaic, "mosaic $i") }
        val given = doubleArrayOf(0.5, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
        val matrix = ColourMatrix.of(21, given)!!
        given.fill(0.0)
        assertEquals(1.0, matrix.values[2, 2])
        vandalise(matrix, "colour matrix")
        assertTrue(seen.size >= 20 && lists >= 20, "${seen.size} objects, $lists lists")
        val chart = DngSource.of(photo).use { DngReader.read(it) }
        vandalise(ChartPose.refine(chart, chartCorners, ChartTable.read("classic24")), "pose")
        assertEquals(emptyList<String>(), changed)
        assertEquals(LensShading.AS_STORED, LensShading.of("as-stored"))
    }
}
