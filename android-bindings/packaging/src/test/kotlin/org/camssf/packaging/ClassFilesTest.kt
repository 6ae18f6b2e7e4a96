package org.camssf.packaging

import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.DynamicTest
import org.junit.jupiter.api.DynamicTest.dynamicTest
import org.junit.jupiter.api.Tag
import org.junit.jupiter.api.TestFactory
import org.objectweb.asm.AnnotationVisitor
import org.objectweb.asm.ClassReader
import org.objectweb.asm.ClassVisitor
import org.objectweb.asm.Opcodes
import org.objectweb.asm.commons.ClassRemapper
import org.objectweb.asm.commons.Remapper
import java.util.zip.ZipFile

/** What Android's tools need of a class file; the API level is animal-sniffer's part. */
@Tag("R-ANDROID")
class ClassFilesTest {
    @TestFactory
    fun `Java 8 class files without desktop classes`(): List<DynamicTest> = Artifacts.OF_CODE.map { name ->
        dynamicTest(name) {
            var count = 0
            ZipFile(Artifacts.jar(name)).use { jar ->
                for (entry in jar.entries().toList().filter { it.name.endsWith(".class") }) {
                    count++
                    val content = jar.getInputStream(entry).readBytes()
                    val version = (content[6].toInt() and 0xff shl 8) or (content[7].toInt() and 0xff)
                    assertEquals(52, version, entry.name)
                    val foreign = mentioned(content).filter { type -> DESKTOP.any { type.startsWith(it) } }
                    assertEquals(emptyList<String>(), foreign, entry.name)
                }
            }
            assertTrue(count > 0)
        }
    }

    /** A compiler reads the metadata of the version after its own: that of Kotlin 2.1 those of 2.2 (docs/jvm.md). */
    @TestFactory
    fun `every class speaks the Kotlin that the docs name`(): List<DynamicTest> = Artifacts.OF_CODE.map { name ->
        dynamicTest(name) {
            val found = HashSet<String>()
            ZipFile(Artifacts.jar(name)).use { jar ->
                for (entry in jar.entries().toList().filter { it.name.endsWith(".class") }) {
                    found += languages(jar.getInputStream(entry).readBytes())
                }
            }
            assertEquals(setOf("2.2"), found)
        }
    }

    /** The version of the Kotlin metadata in a class file, if it has any. */
    private fun languages(content: ByteArray): Set<String> {
        val found = HashSet<String>()
        val metadata = object : AnnotationVisitor(Opcodes.ASM9) {
            override fun visit(name: String, value: Any) {
                if (name == "mv") found += (value as IntArray).take(2).joinToString(".")
            }
        }
        val visitor = object : ClassVisitor(Opcodes.ASM9) {
            override fun visitAnnotation(descriptor: String, visible: Boolean) =
                metadata.takeIf { descriptor == "Lkotlin/Metadata;" }
        }
        ClassReader(content).accept(visitor, ClassReader.SKIP_CODE)
        return found
    }

    /** Internal names of all classes that a class file refers to. */
    private fun mentioned(content: ByteArray): Set<String> {
        val found = HashSet<String>()
        val collect = object : Remapper() {
            override fun map(name: String): String = name.also { found += it }
        }
        ClassReader(content).accept(ClassRemapper(object : ClassVisitor(Opcodes.ASM9) {}, collect), 0)
        return found
    }

    private companion object {
        val DESKTOP = listOf("javax/imageio/", "java/awt/", "java/beans/", "javax/swing/", "java/nio/file/", "sun/")
    }
}
