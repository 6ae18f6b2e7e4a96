package org.camssf.recovery

import ai.onnxruntime.OrtEnvironment
import org.camssf.InvalidArgument
import java.io.File

/**
 * The one place that loads ONNX Runtime: of a version that has nothing to report with, or switched off.
 *
 * From 1.29.0 on it reports its use to its maker, on a phone as on a desktop, unless the process's environment says
 * ORT_DISABLE_TELEMETRY=1 before it is loaded.
 */
internal object OnnxLibrary {
    private const val SWITCH = "ORT_DISABLE_TELEMETRY"
    private const val LAST_MAJOR = 1
    private const val LAST_MINOR = 28

    /** @throws InvalidArgument if the version found would report. */
    fun environment(): OrtEnvironment {
        // The desktop's jar tells its version before anything is loaded; the phone's artefact only afterwards.
        val jar = OrtEnvironment::class.java.`package`
        if (jar?.implementationTitle == "onnxruntime") jar.implementationVersion?.let { check(it, switch()) }
        val environment = OrtEnvironment.getEnvironment()
        // Ends what can be ended so: Windows' event log, of any version.
        environment.setTelemetry(false)
        tidy
        check(environment.version, switch())
        return environment
    }

    private fun switch(): String? = System.getenv(SWITCH)

    /** @param switch what the process's environment says. */
    internal fun check(version: String, switch: String?) {
        if (switch == "1" || silent(version)) return
        throw InvalidArgument(
            "ONNX Runtime $version reports its use to its maker, and camssf does not run with it.",
            "Take version 1.28.0 of onnxruntime-android (on a desktop onnxruntime); or set $SWITCH=1 in the " +
                "process's environment before ONNX Runtime is loaded, on Android with android.system.Os.setenv.",
        )
    }

    /** A version that cannot be read is not taken for one that is silent. */
    private fun silent(version: String): Boolean {
        val parts = version.split(".").take(2).map { it.toIntOrNull() ?: return false }
        val (major, minor) = if (parts.size == 2) parts else return false
        return major < LAST_MAJOR || (major == LAST_MAJOR && minor <= LAST_MINOR)
    }

    /**
     * On a desktop ONNX Runtime unpacks its libraries into a temporary folder, and would remove the folder at exit
     * before the files in it, which leaves it there, empty. On a phone there is no such folder.
     */
    private val tidy: Unit by lazy {
        try {
            val type = Class.forName("ai.onnxruntime.OnnxRuntime", true, OrtEnvironment::class.java.classLoader)
            val field = type.getDeclaredField("tempDirectory").apply { isAccessible = true }
            val folder = field.get(null)?.let { File(it.toString()) }
            if (folder != null) Runtime.getRuntime().addShutdownHook(Thread { folder.deleteRecursively() })
        } catch (_: ReflectiveOperationException) {
            // Another version's insides: the empty folder stays.
        } catch (_: RuntimeException) {
            // The process is ending already, or forbids to look.
        }
    }
}
