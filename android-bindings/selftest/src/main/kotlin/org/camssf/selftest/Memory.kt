package org.camssf.selftest

import android.os.Debug
import android.system.Os
import android.system.OsConstants
import java.io.File
import java.io.IOException

/** Measures the app's use of memory, bytes. */
internal object Memory {
    /** Size of the kernel's pages: 4096 or 16384. */
    fun page(): Long = Os.sysconf(OsConstants._SC_PAGESIZE)

    /**
     * Java's heap and its limit; the native heap, which ONNX Runtime uses; and the peak of the process, which
     * includes memory shared with other apps.
     */
    fun now(): Map<String, Long> {
        val java = Runtime.getRuntime()
        return mapOf(
            "java" to java.totalMemory() - java.freeMemory(),
            "java_limit" to java.maxMemory(),
            "native" to Debug.getNativeHeapAllocatedSize(),
            "peak_resident" to peak(),
        )
    }

    /** Peak of the process from /proc/self/status; -1 if this cannot be read. */
    private fun peak(): Long {
        val lines = try {
            File("/proc/self/status").readLines()
        } catch (_: IOException) {
            emptyList()
        }
        val line = lines.firstOrNull { it.startsWith("VmHWM:") } ?: return -1
        return 1024 * line.filter { it.isDigit() }.toLong()
    }
}
