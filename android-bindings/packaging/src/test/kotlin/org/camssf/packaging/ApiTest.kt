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
    fun `the public API is the one that was checked in`(): List<DynamicTest> = Artifacts.SHIPPED.map { name ->
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
        }
    }
}
