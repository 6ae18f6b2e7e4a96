package org.camssf.selftest

import android.os.Debug
import android.system.Os
import android.system.OsConstants
import java.io.File
import java.io.IOException

/** What the app takes of the phone's memory, bytes. */
internal object Memory {
    /** The kernel's page: 4096 or 16384. */
    fun page(): Long = Os.sysconf(OsConstants._SC_PAGESIZE)

    /**
     * Java's heap and its limit, the native heap, where ONNX Runtime lives, and the process' peak, with what it shares
     * with every other app.
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

    /** Of the kernel's own books; -1 where they are shut. */
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
