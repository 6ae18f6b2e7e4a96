package org.camssf.photo.dng

import java.io.File

/** Writes every variant into the folder that is its argument, for judges outside the JVM. */
internal object VariantFiles {
    @JvmStatic
    fun main(arguments: Array<String>) {
        val folder = File(arguments[0]).apply { mkdirs() }
        for (variant in Variants.all) File(folder, "${variant.name}.dng").writeBytes(variant.bytes)
        println("${Variants.all.size} files")
    }
}
