package org.camssf.golden

import org.junit.jupiter.api.AfterAll
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.DynamicTest
import org.junit.jupiter.api.DynamicTest.dynamicTest
import org.junit.jupiter.api.Tag
import org.junit.jupiter.api.TestFactory
import java.io.File

/** Every golden case as a test of its own, or those of the stages in the property `camssf.stages`, between commas. */
@Tag("R-PARITY")
class GoldenTest {
    @TestFactory
    fun cases(): List<DynamicTest> = names.map { name ->
        dynamicTest(name) {
            val outcome = runner.run(name)
            outcomes += outcome
            assertTrue(outcome.faults.isEmpty(), outcome.faults.joinToString("\n"))
        }
    }

    companion object {
        private val runner = GoldenRunner(GoldenFiles.of(File(System.getProperty("camssf.root"), "golden")))
        private val stages = System.getProperty("camssf.stages")?.split(',')
        private val names by lazy {
            runner.names().filter { stages == null || it.substringBefore('/') in stages }
        }
        private val outcomes = ArrayList<Outcome>()

        @AfterAll
        @JvmStatic
        fun sumUp() {
            runner.close()
            println(GoldenRunner.summary(outcomes))
        }
    }
}
