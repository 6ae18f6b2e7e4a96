package org.camssf

import org.camssf.photo.Capture
import org.camssf.photo.Corners
import org.camssf.photo.PhotoSource
import org.camssf.photo.Region
import org.camssf.photo.Shot
import org.camssf.photo.dng.DngReader
import org.camssf.photo.dng.DngSource
import org.camssf.recovery.Frames
import org.camssf.recovery.Known
import org.camssf.recovery.ModelInputs
import org.camssf.recovery.OnnxEngine
import org.camssf.recovery.Tensor
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertFalse
import org.junit.jupiter.api.Assertions.assertSame
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import java.io.File
import java.io.IOException
import java.io.InputStream
import java.io.InterruptedIOException
import java.lang.reflect.InvocationTargetException
import java.net.SocketTimeoutException
import java.net.URLClassLoader
import kotlin.coroutines.Continuation
import kotlin.coroutines.EmptyCoroutineContext

/** What goes wrong around a calibration comes out as what it is. */
class FailuresTest {
    private val photo = File(System.getProperty("camssf.root"), "golden/dng/chart-turned-0.dng")
    private val chart = ChartTable.read("classic24")

    private fun Corners.moved(by: Double): Corners =
        Corners.of(*toArray().map { it + by }.toDoubleArray())

    private fun shot(frame: PhotoSource, at: Corners = chartCorners) = Shot(frame, Lamp.read("E"), at)

    private fun stream(thrown: IOException) = object : InputStream() {
        override fun read(): Int = throw thrown
    }

    private fun refusal(calibrator: SsfCalibrator, frame: PhotoSource): CalibrationException =
        (calibrator.calibrateBlocking(Capture(shot(frame), chart)) as Refused).error

    @Test
    fun `an interrupt during reading is an interrupt`() {
        val frames = listOf(
            PhotoSource { region ->
                // closes the channel
                Thread.currentThread().interrupt()
                PhotoSource.of(photo).read(region)
            },
            PhotoSource.dng {
                val source = DngSource.of(photo)
                object : DngSource by source {
                    override fun read(at: Long, into: ByteArray, offset: Int, length: Int) {
                        if (at > 0) Thread.currentThread().interrupt()
                        source.read(at, into, offset, length)
                    }
                }
            },
            PhotoSource.dng { DngSource.of(stream(InterruptedIOException()), "stream.dng") },
            PhotoSource { region ->
                // a reader that looks for no interrupt: the next step does
                val found = PhotoSource.of(photo).read(region)
                Thread.currentThread().interrupt()
                found
            },
        )
        SsfCalibrator.openBlocking().use { calibrator ->
            for (frame in frames) {
                val calls = listOf<() -> Any>(
                    { calibrator.calibrateBlocking(Capture(shot(frame), chart)) },
                    { calibrator.measureBlocking(shot(frame), chart) },
                )
                for (call in calls) {
                    try {
                        assertThrows(InterruptedException::class.java) { call() }
                        assertFalse(Thread.currentThread().isInterrupted)
                    } finally {
                        Thread.interrupted()
                    }
                }
            }
            val slow =
                refusal(calibrator, PhotoSource.dng { DngSource.of(stream(SocketTimeoutException()), "cloud.dng") })
            assertEquals("unreadable_raw", slow.code)
        }
    }

    @Test
    fun `what a provider throws is an unreadable photo`() {
        SsfCalibrator.openBlocking().use { calibrator ->
            val provider = listOf(SecurityException("no permission"), IOException("no file"), NullPointerException())
            for (thrown in provider) {
                val error = refusal(calibrator, PhotoSource.dng { throw thrown })
                assertEquals("unreadable_raw", error.code)
                assertSame(thrown, error.cause)
                assertTrue((thrown.message ?: "NullPointer") in error.message && error.advice.isNotEmpty())
            }
            val own = Refusal.of("unsupported_raw.big_tiff", "file" to "a.dng")
            assertSame(own, refusal(calibrator, PhotoSource.dng { throw own }))
            val stop = java.util.concurrent.CancellationException("enough")
            val thrown = assertThrows(stop.javaClass) { refusal(calibrator, PhotoSource.dng { throw stop }) }
            assertSame(stop, thrown)
            val closing = PhotoSource.dng {
                val source = DngSource.of(photo)
                object : DngSource by source {
                    override fun close() {
                        source.close()
                        throw IOException("gone")
                    }
                }
            }
            assertEquals("unreadable_raw", refusal(calibrator, closing).code)
        }
    }

    @Test
    fun `whatever the app's own source throws is a refusal with its cause`() {
        opened("phones").use { calibrator ->
            val faults = listOf(IllegalStateException("no camera"), IOException("gone"), ClassCastException())
            for (thrown in faults) {
                val sources = listOf(
                    PhotoSource { throw thrown },
                    PhotoSource.dng {
                        object : DngSource by DngSource.of(photo) {
                            override fun read(at: Long, into: ByteArray, offset: Int, length: Int) = throw thrown
                        }
                    },
                )
                for (source in sources) {
                    val error = refusal(calibrator, source)
                    assertEquals(UnreadableRaw::class.java to thrown, error.javaClass to error.cause)
                    val white = Shot(PhotoSource.of(photo), Lamp.read("E"), chartCorners, white = source)
                    assertSame(thrown, (calibrator.calibrateBlocking(Capture(white, chart)) as Refused).error.cause)
                }
            }
            val closed = CalibratorClosed()
            assertSame(closed, refusal(calibrator, PhotoSource { throw closed }).cause) // of another calibrator
        }
    }

    @Test
    fun `after close nothing works`() {
        val calibrator = SsfCalibrator.openBlocking()
        val capture =
            Capture(shot(PhotoSource { throw Refusal.of("unreadable_raw.missing", "file" to "a.dng") }), chart)
        calibrator.close()
        calibrator.close()
        val next = Continuation<CalibrationResult>(EmptyCoroutineContext) { }
        val suspending: suspend () -> CalibrationResult = { calibrator.calibrate(capture) }

        @Suppress("UNCHECKED_CAST")
        val calls = listOf<() -> Any?>(
            { calibrator.calibrateBlocking(capture) },
            { calibrator.measureBlocking(shot(PhotoSource.of(photo)), chart) },
            { calibrator.solveBlocking(emptyList(), chart) },
            { (suspending as (Continuation<CalibrationResult>) -> Any?)(next) },
        )
        for (call in calls) {
            val error = assertThrows(IllegalStateException::class.java) { call() }
            assertTrue("was closed" in error.message!!)
        }
    }

    @Test
    fun `a corner outside the photo, near or far`() {
        SsfCalibrator.openBlocking().use { calibrator ->
            val said = listOf(170.0, 5000.0).map { by ->
                val moved = chartCorners.moved(by)
                assertThrows(InvalidArgument::class.java) {
                    calibrator.calibrateBlocking(Capture(shot(PhotoSource.of(photo), moved), chart))
                }.toString()
            } + assertThrows(InvalidArgument::class.java) {
                calibrator.measureBlocking(shot(PhotoSource.of(photo), chartCorners.moved(-20.0)), chart)
            }.toString()
            assertEquals(1, said.toSet().size, said.toString())
            assertTrue("outside chart-turned-0.dng" in said[0] && "preview" in said[0], said[0])
            assertFalse("Region" in said[0])
        }
    }

    @Test
    fun `memory that is not there`() {
        val source = object : DngSource by DngSource.of(photo) {
            override fun read(at: Long, into: ByteArray, offset: Int, length: Int): Unit = throw OutOfMemoryError()
        }
        assertTrue("part" in assertThrows(OutOfMemory::class.java) { DngReader.read(source) }.advice)
        val part = assertThrows(OutOfMemory::class.java) { DngReader.read(source, Region(0, 0, 9, 9)) }
        assertTrue("largeHeap" in part.advice && "part" !in part.advice, part.advice)
    }

    @Test
    fun `the engine's errors are typed`() {
        assertThrows(InvalidArgument::class.java) { OnnxEngine.open("cameras", "x.onnx", ByteArray(10)) }
        OnnxEngine.load("cameras").use { engine ->
            val one = Tensor.scalar(1.0)
            val known = Known(one, one, one, 1.0, one, one, Tensor.full(0.0, 1, 1, 681))
            val inputs = ModelInputs("cameras", Frames(one, one, one), one, known, 1.0, 1.0, true)
            val error = assertThrows(InvalidArgument::class.java) { engine.run(listOf(inputs)) }
            assertTrue(error.cause is ai.onnxruntime.OrtException, error.toString())
        }
    }

    /** A class path as an app's that left ONNX Runtime out. */
    @Test
    fun `without ONNX Runtime the advice names it`() {
        val needed = listOf(
            SsfCalibrator::class.java,
            org.camssf.model.Models::class.java,
            Unit::class.java,
            kotlinx.coroutines.Job::class.java,
            kotlinx.serialization.json.Json::class.java,
            kotlinx.serialization.KSerializer::class.java,
        )
        val places = needed.map { it.protectionDomain.codeSource.location }.distinct().toTypedArray()
        assertTrue(places.none { "onnxruntime" in it.path })
        URLClassLoader(places, ClassLoader.getPlatformClassLoader()).use { loader ->
            val type = loader.loadClass("org.camssf.SsfCalibrator")
            assertEquals(listOf("auto", "phones", "cameras", "ryyb", "gaussian"), type.getField("BASES").get(null))
            val companion = type.getField("Companion").get(null)
            repeat(2) {
                val open = companion.javaClass.getMethod("openBlocking")
                val thrown = assertThrows(InvocationTargetException::class.java) { open.invoke(companion) }
                val error = thrown.targetException
                assertEquals("org.camssf.RuntimeUnfit", error.javaClass.name, error.toString())
                assertTrue("onnxruntime-android of version 1.28.0" in error.toString(), error.toString())
            }
        }
    }
}
