package org.camssf.guide

import com.sun.management.ThreadMXBean
import org.camssf.finder.Picture
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import java.lang.management.ManagementFactory
import java.util.function.LongSupplier

/** What a preview costs in memory: its first frame, each later one, and a long row of them. */
class PreviewMemoryTest {
    /** Loads this project's classes anew, so that no other test has initialised them; reads each file once. */
    private class Anew(parent: ClassLoader, private val files: MutableMap<String, ByteArray>) : ClassLoader(parent) {
        override fun loadClass(name: String, resolve: Boolean): Class<*> = synchronized(getClassLoadingLock(name)) {
            if (!name.startsWith("org.camssf.")) return super.loadClass(name, resolve)
            findLoadedClass(name) ?: files.getOrPut(name) {
                getResourceAsStream(name.replace('.', '/') + ".class")!!.use { it.readBytes() }
            }.let { defineClass(name, it, 0, it.size) }
        }
    }

    @Test
    fun `the first frame with a chart makes little garbage`() {
        val files = HashMap<String, ByteArray>()
        // The first turn reads the classes' files, which is no part of a frame.
        val (_, bytes) = List(2) {
            val fresh = Anew(javaClass.classLoader, files).loadClass(FirstFrame::class.java.name)
            (fresh.getConstructor().newInstance() as LongSupplier).asLong
        }
        assertTrue(bytes in 1..2_000_000, "$bytes bytes")
    }

    private val frames = listOf(
        Drawn().rgb(),
        Drawn(seed = 2, rotation = 20.0).yuv(),
        Drawn(shiftX = 0.4).rgb(),
        Drawn(tilt = 30.0, exposure = 0.2).luma(),
        Drawn(shine = { u, v -> if (u in 1.8..2.2 && v in 0.8..1.2) 0.3 else 0.0 }).rgb(),
        Drawn(noise = 40.0, fill = 0.1).rgb(),
    )

    private fun look(guide: CaptureGuide, frames: List<Picture>, count: Int) =
        repeat(count) { guide.look(frames[it % frames.size], it * 33_000_000L) }

    @Test
    fun `later frames make little garbage`() {
        for ((i, frame) in frames.withIndex()) {
            val guide = CaptureGuide()
            look(guide, listOf(frame), 2)
            val bytes = allocated { look(guide, listOf(frame), 10) } / 10
            assertTrue(bytes < 50_000, "frame $i: $bytes bytes")
        }
    }

    @Test
    fun `a thousand frames leave nothing behind`() {
        val guide = CaptureGuide()
        look(guide, frames, 100)
        // The least of four, since the JVM keeps something at times.
        val grown = List(4) {
            val before = used()
            look(guide, frames, 250)
            used() - before
        }.min()
        assertTrue(grown < 25_000, "$grown bytes")
    }
}

private val memory = ManagementFactory.getThreadMXBean() as ThreadMXBean

private fun allocated(action: () -> Unit): Long {
    val me = Thread.currentThread().id
    val before = memory.getThreadAllocatedBytes(me)
    action()
    return memory.getThreadAllocatedBytes(me) - before
}

/** Bytes in use after garbage collections: what a class loader held goes with the second. */
private fun used(): Long {
    repeat(3) { System.gc() }
    return ManagementFactory.getMemoryMXBean().heapMemoryUsage.used
}

/** Bytes that the first frame of a guide allocates and does not keep. */
class FirstFrame : LongSupplier {
    override fun getAsLong(): Long {
        val planes = Drawn().planes()
        val kept = ArrayList<CaptureGuide>()
        val before = used()
        val bytes = allocated {
            kept += CaptureGuide()
            check(kept[0].look(Picture.rgb(planes[0], planes[1], planes[2], 640, 480), 0) is Guidance.Measured)
        }
        val garbage = bytes - (used() - before)
        check(kept.size + planes.size == 4) // both lived until here
        return garbage
    }
}
