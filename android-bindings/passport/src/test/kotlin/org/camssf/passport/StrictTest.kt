package org.camssf.passport

import kotlinx.serialization.json.Json
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.DynamicTest
import org.junit.jupiter.api.DynamicTest.dynamicTest
import org.junit.jupiter.api.TestFactory

/**
 * Why passports have a parser of their own: these texts are no JSON, or mean two things. Python refuses them, and the
 * library that core reads its own files with takes them.
 */
class StrictTest {
    @TestFactory
    fun `what Python refuses and kotlinx takes is refused`(): List<DynamicTest> = listOf(
        """{"unit": "mine", "unit": "yours"}""",
        """{"unit": mine}""",
        """{"number": NaN}""",
        """{"number": 012}""",
        "{\"line\": \"one\ntwo\"}",
    ).map { text ->
        dynamicTest(text) {
            Json.parseToJsonElement(text)
            assertThrows(UnsoundException::class.java) { Sound.parse(text) }
        }
    }
}
