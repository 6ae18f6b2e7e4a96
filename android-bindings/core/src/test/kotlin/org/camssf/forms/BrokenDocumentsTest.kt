package org.camssf.forms

import org.camssf.InvalidArgument
import org.camssf.chartCorners
import org.camssf.json.JsonText
import org.camssf.opened
import org.camssf.photo.DocumentForm
import org.camssf.photo.PhotoSource
import org.camssf.photo.Shot
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertNotEquals
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.DynamicTest
import org.junit.jupiter.api.DynamicTest.dynamicTest
import org.junit.jupiter.api.Test
import org.junit.jupiter.api.TestFactory
import java.io.File

/** tests/documents/broken_documents.json: Kotlin refuses what Python refuses, with the same place and words. */
class BrokenDocumentsTest {
    private val root = File(System.getProperty("camssf.root"))
    private val text by lazy {
        val shot = Shot(PhotoSource.of(File(root, "golden/dng/chart-turned-0.dng")), Lamp.read("E"), chartCorners)
        val chart = ChartTable.read("classic24")
        opened("phones").use {
            it.solveBlocking(listOf(it.measureBlocking(shot, chart)), chart).toJson()
        }
    }

    /** The keys of a place, as a.b[2]; of a list numbers. */
    private fun keys(path: String): List<Any> =
        Regex("[^.\\[\\]]+").findAll(path).map { it.value.toIntOrNull() ?: it.value }.toList()

    private fun entry(holder: Any?, key: Any): Any? =
        if (key is Int) (holder as List<*>)[key] else (holder as Map<*, *>)[key]

    private fun value(document: Any?, path: String): Any? = keys(path).fold(document, ::entry)

    @Suppress("UNCHECKED_CAST")
    private fun change(document: Any?, path: String, to: (Any?) -> Any?) {
        val keys = keys(path)
        val key = keys.last()
        when (val holder = keys.dropLast(1).fold(document, ::entry)) {
            is MutableList<*> -> (holder as MutableList<Any?>)[key as Int] = to(holder[key])
            else -> (holder as MutableMap<String, Any?>)[key as String] = to(holder[key])
        }
    }

    /** The text of a broken document; Python's tests/documents/test_forms.py says what the file's words mean. */
    private fun broken(case: Map<*, *>): String {
        case["whole"]?.let { return it as String }
        val document = JsonText.parse(text)
        if ("sealed" !in case) (document as MutableMap<*, *>).remove("sha256")
        val (drop, cut, set) = listOf("drop", "cut", "set").map { case[it] as String? }
        if (drop != null) {
            val keys = keys(drop)
            (keys.dropLast(1).fold(document, ::entry) as MutableMap<*, *>).remove(keys.last())
        } else if (cut != null) {
            (value(document, cut) as MutableList<*>).removeAt((value(document, cut) as List<*>).size - 1)
        } else {
            val to = if ("to" in case) case["to"] else RAW
            change(document, set!!) {
                if (to is String && to.startsWith("@") &&
                    to != RAW
                ) {
                    copied(document, to)
                } else {
                    to
                }
            }
        }
        val raw = (case["raw"] as String?).orEmpty().repeat((case["times"] as Long? ?: 1).toInt())
        return JsonText.write(document).replace("\"$RAW\"", raw)
    }

    private fun copied(document: Any?, words: String): Any? {
        val (path, half) = (words.drop(1) + "/").split("/")
        val found = value(document, path)
        return if (half.isEmpty()) found else (found as List<*>).map { (it as Number).toDouble() / 2 }
    }

    @TestFactory
    fun `a broken document is refused with its place`(): List<DynamicTest> {
        val cases = JsonText.parse(File(root, "tests/documents/broken_documents.json").readText()) as List<*>
        assertTrue(cases.size > 80)
        return cases.map { it as Map<*, *> }.map { case ->
            dynamicTest(case["name"] as String) {
                val error = assertThrows(InvalidArgument::class.java) { DocumentForm.read(broken(case), "it") }
                val place = case["place"] as String
                val start = if (place.isEmpty()) "it is not valid JSON" else "it: $place "
                assertTrue(error.message.startsWith(start), error.message)
                assertTrue((case["says"] as String?).orEmpty() in error.message, error.message)
            }
        }
    }

    @Test
    fun `the base is sound with and without its hash, in any order and spelling`() {
        val whole = DocumentForm.read(text, "it")
        assertEquals("phones", whole.answer!!.text("basis"))
        val document = JsonText.parse(text) as Map<*, *>
        val turned = JsonText.write(document.entries.reversed().associate { it.key to it.value })
        DocumentForm.read(turned.replace(":1.0,", ": 1,\n").replace("[1.0,", "[\t10e-1 ,"), "it")
        DocumentForm.read(JsonText.write(document - "sha256"), "it")
        assertNotEquals(text, turned)
    }

    private companion object {
        const val RAW = "@RAW@"
    }
}
