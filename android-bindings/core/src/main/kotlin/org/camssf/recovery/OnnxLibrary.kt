package org.camssf.recovery

import ai.onnxruntime.OrtEnvironment
import ai.onnxruntime.OrtLoggingLevel
import ai.onnxruntime.OrtSession
import org.camssf.RuntimeUnfit
import java.io.File

/**
 * Loads ONNX Runtime without telemetry; no other class loads it.
 *
 * From 1.29.0 on it sends usage data to its maker, on phones and desktops, unless the process's environment contains
 * ORT_DISABLE_TELEMETRY=1 before it is loaded.
 */
internal object OnnxLibrary {
    private const val SWITCH = "ORT_DISABLE_TELEMETRY"
    private const val LAST_MAJOR = 1

    /** The version that camssf is tested with. */
    const val VERSION = "1.28.0"
    private const val LAST_MINOR = 28

    /**
     * The process's environment of ONNX Runtime.
     *
     * @throws RuntimeUnfit the version found would send usage data.
     */
    fun environment(): OrtEnvironment {
        // The desktop's jar states its version before anything is loaded; the Android artefact only afterwards.
        val jar = OrtEnvironment::class.java.`package`
        if (jar?.implementationTitle == "onnxruntime") jar.implementationVersion?.let { check(it, switch()) }
        val environment = OrtEnvironment.getEnvironment()
        // Stops the telemetry that this call can stop: Windows' event log, in any version.
        environment.setTelemetry(false)
        tidy
        check(environment.version, switch())
        return environment
    }

    /** The options of the Python package, so that the numbers are the same; they must outlive their session. */
    fun options(): OrtSession.SessionOptions {
        val options = OrtSession.SessionOptions()
        try {
            options.setIntraOpNumThreads(1)
            options.setInterOpNumThreads(1)
            options.setExecutionMode(OrtSession.SessionOptions.ExecutionMode.SEQUENTIAL)
            // No optimisation: the graph that runs is the one that was checked, and it loads faster.
            options.setOptimizationLevel(OrtSession.SessionOptions.OptLevel.NO_OPT)
            options.setSessionLogLevel(OrtLoggingLevel.ORT_LOGGING_LEVEL_ERROR)
            options.addConfigEntry("session.intra_op.allow_spinning", "0")
            options.addConfigEntry("mlas.disable_kleidiai", "1")
        } catch (error: Throwable) {
            options.close()
            throw error
        }
        return options
    }

    private fun switch(): String? = System.getenv(SWITCH)

    /**
     * Checks that this version of ONNX Runtime sends no usage data.
     *
     * @param switch value of ORT_DISABLE_TELEMETRY in the process's environment.
     * @throws RuntimeUnfit it would send usage data.
     */
    internal fun check(version: String, switch: String?) {
        if (switch == "1" || silent(version)) return
        throw RuntimeUnfit(
            "ONNX Runtime $version reports its use to its maker, and camssf does not run with it.",
            "Another dependency has raised it: make the build take $VERSION, in Gradle with " +
                "implementation(\"com.microsoft.onnxruntime:onnxruntime-android\") " +
                "{ version { strictly(\"$VERSION\") } } (on a desktop onnxruntime); or set $SWITCH=1 in the " +
                "process's environment before ONNX Runtime is loaded, on Android with android.system.Os.setenv.",
        )
    }

    /** Whether a version is known to have no telemetry; false if it cannot be parsed. */
    private fun silent(version: String): Boolean {
        val parts = version.split(".").take(2).map { it.toIntOrNull() ?: return false }
        val (major, minor) = if (parts.size == 2) parts else return false
        return major < LAST_MAJOR || (major == LAST_MAJOR && minor <= LAST_MINOR)
    }

    /**
     * On a desktop ONNX Runtime unpacks its libraries into a temporary folder. At exit it tries to delete the folder
     * before the files in it, so an empty folder would remain; this deletes it. On a phone there is no such folder.
     */
    private val tidy: Unit by lazy {
        try {
            val type = Class.forName("ai.onnxruntime.OnnxRuntime", true, OrtEnvironment::class.java.classLoader)
            val field = type.getDeclaredField("tempDirectory").apply { isAccessible = true }
            val folder = field.get(null)?.let { File(it.toString()) }
            if (folder != null) Runtime.getRuntime().addShutdownHook(Thread { folder.deleteRecursively() })
        } catch (_: ReflectiveOperationException) {
            // Another version has another internal structure: the empty folder remains.
        } catch (_: RuntimeException) {
            // The process is already ending, or does not permit this.
        }
    }
}

/**
 * Runs what loads ONNX Runtime.
 *
 * @throws RuntimeUnfit it is missing.
 */
internal inline fun <T> withOnnxRuntime(work: () -> T): T = try {
    work()
} catch (error: LinkageError) {
    throw RuntimeUnfit(
        "ONNX Runtime is missing or cannot load its native library (${error.message}).",
        "Add com.microsoft.onnxruntime:onnxruntime-android of version ${OnnxLibrary.VERSION}, with the " +
            "native library of the device's ABI; on a desktop onnxruntime of the same version.",
        cause = error,
    )
}
