package org.camssf.packaging

import kotlinx.validation.api.dump
import kotlinx.validation.api.filterOutNonPublic
import kotlinx.validation.api.loadApiFromJvmClasses
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.DynamicTest
import org.junit.jupiter.api.DynamicTest.dynamicTest
import org.junit.jupiter.api.Tag
import org.junit.jupiter.api.TestFactory
import java.io.File
import java.util.jar.JarFile

/**
 * What apps compile against, line by line in NAME/api/NAME.api: a change that nobody meant makes this test fail.
 * After a change that was meant: `mvn -f android-bindings verify -Dapi.write`.
 */
@Tag("R-ANDROID")
class ApiTest {
    @TestFactory
    fun `the public API is the one that was checked in`(): List<DynamicTest> = Artifacts.OF_CODE.map { name ->
        dynamicTest(name) {
            val found = JarFile(Artifacts.jar(name)).use { jar ->
                StringBuilder().also { jar.loadApiFromJvmClasses().filterOutNonPublic().dump(it) }.toString()
            }
            val file = File(Artifacts.FOLDER, "$name/api/$name.api")
            if (System.getProperty("api.write") != null) {
                file.parentFile.mkdirs()
                file.writeText(found)
            }
            val known = if (file.exists()) file.readText() else ""
            assertEquals(known, found, "run verify -Dapi.write, and look at the difference")
            assertEquals(emptyList<String>(), found.lines().filter { "onnxruntime" in it || "serialization" in it })
            assertEquals(emptyList<String>(), unfriendly(found))
        }
    }

    /**
     * What an app would stumble over: a class with properties that prints as an address, a data class of a type that
     * will grow, several constructors of an exception, a getter that gives or copies an array, and what Java
     * writes as `INSTANCE`, `Unit` or a `Pair`.
     */
    private fun unfriendly(api: String): List<String> = api.split("\n\n").flatMap { block ->
        val lines = block.trim().lines()
        val head = lines[0]
        val plain = listOf("Enum", "Exception", "Companion", "interface", "abstract").none { it in head }
        val single = "INSTANCE" in block
        val silent = plain && !single && lines.any { PROPERTY in it } && lines.none { "fun toString ()" in it }
        val frozen = "fun component1 ()" in block && GEOMETRY.none { head.startsWith("public final class $it ") }
        val many = lines.count { "public fun <init>" in it } > 1 && THROWN.any { it in head }
        val foreign = lines.filter { line ->
            // but what Java cannot see
            " synthetic " !in line && (
                "kotlin/Pair" in line || "kotlin/jvm/functions/Function1" in line ||
                    (single && " fun " in line && " static " !in line)
                )
        }
        // Only Mosaic hands over an array that it holds; elsewhere such a property would copy at each read.
        val copies = lines.filter { OF_ARRAY in it && !(head.startsWith(MOSAIC) && "getSamples" in it) }
        listOfNotNull(
            "$head no toString".takeIf { silent },
            "$head a data class".takeIf { frozen },
            "$head several constructors".takeIf { many },
        ) + (foreign + copies).map { "$head $it" }
    }

    private companion object {
        const val PROPERTY = "public final fun get"
        val OF_ARRAY = Regex("""fun (get|copy)\w+ \(\)\[""")
        const val MOSAIC = "public final class org/camssf/photo/Mosaic {"

        /** Data classes whose fields cannot become more: two coordinates, four corners. */
        val GEOMETRY = listOf("Point", "Corners").map { "org/camssf/photo/$it" }

        val THROWN = listOf("CalibrationException", "Misuse", "Refusal", "RawError", "ChartError", "CaptureError")
    }
}
