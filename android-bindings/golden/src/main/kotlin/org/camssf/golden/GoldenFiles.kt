package org.camssf.golden

import java.io.File

/** The folder golden/ of the repository, wherever it lies: a folder, an app's assets, a jar. */
public fun interface GoldenFiles {
    /** The content of a file by its path in golden/, "manifest.json" for example. */
    public fun read(path: String): ByteArray

    public companion object {
        /** A folder on disk. */
        @JvmStatic
        public fun of(folder: File): GoldenFiles = GoldenFiles { File(folder, it).readBytes() }

        /** Resources of the class path under `prefix`, "golden/" for example. */
        @JvmStatic
        public fun resources(prefix: String): GoldenFiles = GoldenFiles { path ->
            val stream = GoldenFiles::class.java.classLoader?.getResourceAsStream(prefix + path)
            checkNotNull(stream) { "there is no resource $prefix$path" }.use { it.readBytes() }
        }
    }
}
