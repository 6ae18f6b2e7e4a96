package org.camssf.packaging

import java.io.File

/** The files that this build ships. */
internal object Artifacts {
    /** Modules that apps take: jars, and camera2 an AAR around its jar. */
    val SHIPPED = listOf(
        "model", "model-gaussian", "core", "colour", "finder", "camera2", "camerax", "passport", "testing",
    )

    /** Those with classes: one is a model alone. */
    val OF_CODE = SHIPPED - "model-gaussian"

    /** The folder android-bindings. */
    val FOLDER = File(System.getProperty("camssf.root"), "android-bindings")

    val CLASS_PATH: List<File> = System.getProperty("java.class.path").split(File.pathSeparator).map(::File)

    /** The jar of a module, as Maven hands it to its neighbours. */
    fun jar(module: String): File {
        val name = "camssf-$module-${System.getProperty("camssf.version")}.jar"
        return CLASS_PATH.single { it.name == name }
    }
}
