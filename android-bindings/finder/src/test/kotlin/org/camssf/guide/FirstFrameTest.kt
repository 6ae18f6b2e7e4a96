package org.camssf.guide

import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import java.lang.management.ManagementFactory
import java.util.function.LongSupplier

/** The first frame with a chart, when nothing has been computed yet, as when an app opens its preview. */
class FirstFrameTest {
    /** Loads this project's classes anew, so that no other test has initialised them. */
    private class Anew(parent: ClassLoader) : ClassLoader(parent) {
        override fun loadClass(name: String, resolve: Boolean): Class<*> = synchronized(getClassLoadingLock(name)) {
            if (!name.startsWith("org.camssf.")) return super.loadClass(name, resolve)
            findLoadedClass(name) ?: getResourceAsStream(name.replace('.', '/') + ".class")!!.use { it.readBytes() }
                .let { defineClass(name, it, 0, it.size) }
        }
    }

    @Test
    fun `the first frame with a chart allocates little`() {
        val fresh = Anew(javaClass.classLoader).loadClass(FirstFrame::class.java.name)
        val bytes = (fresh.getConstructor().newInstance() as LongSupplier).asLong
        assertTrue(bytes in 1..8_000_000, "$bytes bytes")
    }
}

/** Bytes that this thread allocates for one frame. */
class FirstFrame : LongSupplier {
    override fun getAsLong(): Long {
        val clock = ManagementFactory.getThreadMXBean() as com.sun.management.ThreadMXBean
        val me = Thread.currentThread().id
        val picture = Drawn().rgb()
        val found = Drawn().found()
        val before = clock.getThreadAllocatedBytes(me)
        val guidance = CaptureGuide().take(picture, found, 0)
        check(guidance is Guidance.Measured) { "$guidance" }
        return clock.getThreadAllocatedBytes(me) - before
    }
}
