package org.camssf

import org.camssf.photo.Capture
import org.camssf.photo.PhotoSource
import org.camssf.photo.Shot
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertFalse
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import java.io.File
import java.util.Collections
import java.util.concurrent.CountDownLatch
import java.util.concurrent.TimeUnit
import java.util.concurrent.atomic.AtomicReference
import java.util.logging.Handler
import java.util.logging.LogRecord
import kotlin.concurrent.thread

/** What `close` promises, what a logger hears, and what becomes of a heap that is too small. */
class ClosingTest {
    private val photo = File(System.getProperty("camssf.root"), "golden/dng/chart-turned-0.dng")
    private val chart = ChartTable.read("classic24")

    private fun capture(source: PhotoSource = PhotoSource.of(photo)) =
        Capture(Shot(source, Lamp.read("E"), chartCorners), chart)

    @Test
    fun `close ends a run with its own error, and waits until it has ended`() {
        val reading = CountDownLatch(1)
        val go = CountDownLatch(1)
        val source = PhotoSource { region ->
            reading.countDown()
            go.await()
            PhotoSource.of(photo).read(region)
        }
        val calibrator = opened("phones")
        val ended = AtomicReference<Throwable>()
        val run = thread {
            ended.set(runCatching { calibrator.calibrateBlocking(capture(source)) }.exceptionOrNull())
        }
        reading.await()
        val closing = thread { calibrator.close() }
        closing.join(200)
        assertTrue(closing.isAlive, "close does not wait")
        go.countDown()
        closing.join(120_000)
        run.join(120_000)
        assertFalse(closing.isAlive || run.isAlive)
        assertEquals(CalibratorClosed::class.java, ended.get()?.javaClass)
        assertThrows(CalibratorClosed::class.java) { calibrator.calibrateBlocking(capture()) }
    }

    @Test
    fun `a listener may close, and its run ends`() {
        val calibrator = opened("phones")
        val stages = ArrayList<Stage>()
        val closing = CalibrationOptions.Builder().progress { progress ->
            stages += progress.stage
            if (progress.stage == Stage.SOLVING) calibrator.close()
        }
        assertThrows(CalibratorClosed::class.java) { calibrator.calibrateBlocking(capture(), closing.build()) }
        assertEquals(Stage.SOLVING, stages.last())
        calibrator.close()
    }

    @Test
    fun `one that waits behind another run is ended, too`() {
        val calibrator = opened("phones")
        val started = CountDownLatch(3)
        val errors = List(3) { AtomicReference<Throwable>() }
        val runs = errors.map { error ->
            thread {
                started.countDown()
                error.set(
                    runCatching { while (true) calibrator.calibrateBlocking(capture()) }.exceptionOrNull(),
                )
            }
        }
        assertTrue(started.await(2, TimeUnit.MINUTES))
        Thread.sleep(100)
        calibrator.close()
        runs.forEach { it.join(120_000) }
        assertEquals(List(3) { CalibratorClosed::class.java }, errors.map { it.get()?.javaClass })
    }

    @Test
    fun `a logger hears each stage and what came of it`() {
        val lines = ArrayList<String>()
        SsfCalibrator.Builder().basis("phones").logger { lines += it }.openBlocking().use { calibrator ->
            calibrator.calibrateBlocking(capture())
            assertTrue(lines.any { Regex("reading the photo, shot 1: \\d+ ms").matches(it) }, lines.toString())
            assertTrue(lines.last().startsWith("accepted") || lines.last().startsWith("doubtful"), lines.last())
            lines.clear()
            calibrator.calibrateBlocking(capture { throw Refusal.of("unreadable_raw.missing", "file" to "a.dng") })
            assertEquals("refused, unreadable_raw", lines.last())
            assertTrue(lines.none { File.separator + "golden" in it })
        }
    }

    @Test
    fun `one that nobody closed is released, and the log says so`() {
        val (own, common) = List(2) { Collections.synchronizedList(ArrayList<String>()) }
        val handler = object : Handler() {
            override fun publish(record: LogRecord) {
                common += record.message
            }

            override fun flush() = Unit

            override fun close() = Unit
        }
        val log = java.util.logging.Logger.getLogger("org.camssf")
        log.addHandler(handler)
        log.useParentHandlers = false
        fun leave(logger: Logger?) {
            val calibrator = SsfCalibrator.Builder().basis("phones").logger(logger).openBlocking()
            assertTrue(calibrator.calibrateBlocking(capture()) is Recovered)
        }

        /** Holds the calibrator that writes to it, as a screen of an app may. */
        class Screen : Logger {
            var calibrator: SsfCalibrator? = null

            override fun log(line: String) {
                own += line
            }
        }

        fun leaveWithItsLogger() {
            val screen = Screen()
            screen.calibrator = SsfCalibrator.Builder().basis("phones").logger(screen).openBlocking()
        }
        SsfCalibrator.Builder().basis("phones").logger { own += it }.openBlocking().close() // says nothing
        val kept = listOf(Logger { own += it })
        leave(kept[0])
        leave(null)
        leaveWithItsLogger()
        val until = System.nanoTime() + 60_000_000_000
        fun said(lines: List<String>) = lines.toList().count { "was not closed" in it }
        while (said(own) + said(common) < 3 && System.nanoTime() < until) {
            System.gc()
            Thread.sleep(50)
        }
        log.removeHandler(handler)
        log.useParentHandlers = true
        assertEquals(listOf(1, 2), listOf(said(own), said(common)), "${kept.size} logger is still there")
    }

    @Test
    fun `a heap that is too small is a refusal with advice`() {
        opened("phones").use { calibrator ->
            val source = PhotoSource { throw OutOfMemoryError("Java heap space") }
            val found = calibrator.calibrateBlocking(capture(source)) as Refused
            assertEquals("out_of_memory", found.error.code)
            assertEquals(listOf("out_of_memory"), found.verdict.reasons.map { it.code })
            assertTrue("12 megapixels" in found.error.advice && "largeHeap" in found.error.advice)
            assertThrows(OutOfMemory::class.java) { calibrator.measureBlocking(capture(source).shots[0], chart) }
            assertTrue(calibrator.calibrateBlocking(capture()) is Recovered) // and the next run stands
        }
    }
}
