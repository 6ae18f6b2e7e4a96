package org.camssf

import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import java.io.File

/** The rooms, read from their imports: what each may know. Python's are in pyproject.toml (import-linter). */
class LayersTest {
    private val folder = File(System.getProperty("camssf.root"), "android-bindings/core/src/main/kotlin/org/camssf")
    private val files = folder.walk().filter { it.extension == "kt" }.toList()

    private fun room(file: File): String {
        val place = file.relativeTo(folder).path.replace(File.separatorChar, '/')
        if ('/' in place) return place.substringBefore('/')
        return if (file.nameWithoutExtension in GROUND) "ground" else "face"
    }

    /** Names that the ground floor's files declare. */
    private val ground = files.filter { room(it) == "ground" }.flatMap { file ->
        val word = "(?:public |internal |sealed |inline |enum )*(?:class|object|interface|fun|typealias)"
        val declared = Regex("""^$word (?:<T> )?(?:[\w<>]+\.)?(\w+)""")
        file.readLines().mapNotNull { declared.find(it)?.groupValues?.get(1) }
    }.toSet()

    /** Rooms that a file names, in an import or in full; "model" is the shipped data. */
    private fun known(file: File): Set<String> =
        file.readLines().filterNot { it.startsWith("package ") || it.trim().startsWith("*") || it.startsWith("/**") }
            .flatMap { line -> Regex("""org\.camssf\.(\w+)((?:\.\w+)*)""").findAll(line).map { it.groupValues[1] } }
            .map {
                if (it in ALLOWED || it == "model") {
                    it
                } else if (it in ground) {
                    "ground"
                } else {
                    "face"
                }
            }
            .toSet() - "model"

    @Test
    fun `a room knows only what lies below it`() {
        for (file in files) {
            val others = known(file) - room(file)
            val above = others - ALLOWED.getValue(room(file))
            assertEquals(emptySet<String>(), above, "${file.name} of ${room(file)} reaches up or sideways")
        }
    }

    @Test
    fun `the rooms are a ladder, and photo and recovery do not know each other`() {
        val order = ALLOWED.keys.toList()
        for ((room, below) in ALLOWED) assertTrue(below.all { order.indexOf(it) < order.indexOf(room) }, room)
        assertTrue("recovery" !in ALLOWED.getValue("photo") && "photo" !in ALLOWED.getValue("recovery"))
    }

    @Test
    fun `files stand where their package says, are all in a room, and none is long`() {
        assertEquals(ALLOWED.keys, files.map(::room).toSet())
        for (file in files) {
            val below = file.parentFile.relativeTo(folder).path.replace(File.separatorChar, '.')
            val wanted = listOf("org.camssf", below).filter { it.isNotEmpty() }.joinToString(".")
            val lines = file.readLines()
            assertEquals("package $wanted", lines.first { it.startsWith("package ") }, file.name)
            assertTrue(lines.size <= LONGEST, "${file.name} has ${lines.size} lines")
            assertTrue(lines.none { it.startsWith("import ") && it.endsWith(".*") }, file.name)
        }
    }

    private companion object {
        const val LONGEST = 450
        val GROUND = setOf(
            "Camssf", "Channel", "Curve", "Errors", "Grid", "Interrupts", "LeastSquares", "Messages", "Nodes",
            "Numbers", "ProgressReporter", "Reason", "Rows", "Rules", "Shipped", "Stage",
        )
        val ALLOWED = linkedMapOf(
            "json" to emptySet(),
            "ground" to setOf("json"),
            "forms" to setOf("json", "ground"),
            "spectra" to setOf("json", "ground", "forms"),
            "photo" to setOf("json", "ground", "forms", "spectra"),
            "recovery" to setOf("json", "ground", "spectra"),
            "fit" to setOf("json", "ground", "spectra", "photo", "recovery"),
            "verdict" to setOf("json", "ground", "spectra", "photo", "recovery", "fit"),
            "documents" to setOf("json", "ground", "forms", "spectra", "photo", "recovery", "fit", "verdict"),
            "face" to setOf("json", "ground", "forms", "spectra", "photo", "recovery", "fit", "verdict", "documents"),
        )
    }
}
