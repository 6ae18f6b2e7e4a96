package org.camssf.passport

import kotlinx.serialization.json.Json
import org.camssf.json.JsonText
import org.camssf.json.NotJson
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.DynamicTest
import org.junit.jupiter.api.DynamicTest.dynamicTest
import org.junit.jupiter.api.TestFactory

/**
 * Texts that are no JSON, or mean two things: as Python, the parser refuses them; kotlinx takes them.
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
            assertThrows(NotJson::class.java) { JsonText.parse(text) }
        }
    }
}
