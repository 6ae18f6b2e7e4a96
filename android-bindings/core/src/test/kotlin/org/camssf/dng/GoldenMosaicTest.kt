package org.camssf.dng

import kotlinx.serialization.json.Json
import kotlinx.serialization.json.JsonArray
import kotlinx.serialization.json.JsonElement
import kotlinx.serialization.json.JsonNull
import kotlinx.serialization.json.JsonObject
import kotlinx.serialization.json.JsonPrimitive
import kotlinx.serialization.json.double
import kotlinx.serialization.json.jsonArray
import kotlinx.serialization.json.jsonObject
import kotlinx.serialization.json.jsonPrimitive
import org.camssf.CalibrationException
import org.camssf.DngReader
import org.camssf.DngSource
import org.camssf.GainMap
import org.camssf.Mosaic
import org.camssf.Region
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.DynamicTest
import org.junit.jupiter.api.DynamicTest.dynamicTest
import org.junit.jupiter.api.TestFactory
import java.io.File
import java.nio.ByteBuffer
import java.nio.ByteOrder
import java.security.MessageDigest
import kotlin.math.abs

/** The golden cases of stage `mosaic`: the files that Python reads too, and all that must be found in them. */
class GoldenMosaicTest {
    private val golden = File(System.getProperty("camssf.root"), "golden")

    @TestFactory
    fun cases(): List<DynamicTest> {
        val files = File(golden, "cases/mosaic").listFiles { file -> file.name.endsWith(".json") }.orEmpty().sorted()
        assertTrue(files.size > 50, "${files.size} golden cases")
        return files.map { file ->
            dynamicTest(file.name) { run(Json.parseToJsonElement(file.readText()).jsonObject) }
        }
    }

    private fun run(case: JsonObject) {
        val name = case.getValue("inputs").jsonObject.getValue("dng").jsonPrimitive.content
        val source = DngSource.of(File(golden, "dng/$name"))
        val expect = case.getValue("expect").jsonPrimitive.content
        if (expect != "success") {
            val error = runCatching { source.use { DngReader.read(it) } }.exceptionOrNull()
            assertEquals(expect, (error as? CalibrationException)?.code)
            return
        }
        val found = outputs(source.use { DngReader.read(it) })
        val outputs = case.getValue("outputs").jsonObject
        assertEquals(outputs.keys, found.keys)
        for ((key, expected) in outputs) same(key, expected, found.getValue(key))
    }

    /** Equal as JSON; numbers as doubles, black to 1e-15 of itself. */
    private fun same(key: String, expected: JsonElement, found: JsonElement) {
        when (expected) {
            is JsonArray -> {
                assertEquals(expected.size, found.jsonArray.size, key)
                for ((a, b) in expected.zip(found.jsonArray)) same(key, a, b)
            }

            is JsonObject -> {
                assertEquals(expected.keys, found.jsonObject.keys, key)
                for ((name, value) in expected) same("$key.$name", value, found.jsonObject.getValue(name))
            }

            is JsonNull -> assertEquals(expected, found, key)

            is JsonPrimitive -> if (expected.isString) {
                assertEquals(expected.content, found.jsonPrimitive.content, key)
            } else {
                val (a, b) = expected.double to found.jsonPrimitive.double
                assertTrue(abs(a - b) <= if (key == "black") 1e-15 * abs(a) else 0.0, "$key: $b instead of $a")
            }
        }
    }

    private fun outputs(mosaic: Mosaic): Map<String, JsonElement> = mapOf(
        "sha256" to JsonPrimitive(mosaic.sha256),
        "width" to JsonPrimitive(mosaic.width),
        "height" to JsonPrimitive(mosaic.height),
        "samples_sha256" to JsonPrimitive(digest(mosaic.samples)),
        "cfa" to JsonPrimitive(mosaic.cfa),
        "black" to numbers(mosaic.black),
        "white" to JsonPrimitive(mosaic.white),
        "make" to JsonPrimitive(mosaic.make),
        "model" to JsonPrimitive(mosaic.model),
        "exposure" to JsonPrimitive(mosaic.exposure),
        "iso" to JsonPrimitive(mosaic.iso),
        "orientation" to JsonPrimitive(mosaic.orientation),
        "color_matrix1" to numbers(mosaic.colorMatrix1),
        "color_matrix2" to numbers(mosaic.colorMatrix2),
        "as_shot_neutral" to numbers(mosaic.asShotNeutral),
        "gain_maps" to JsonArray(mosaic.gainMaps.map { gainMap(it) }),
        "as_shot_white_xy" to numbers(mosaic.asShotWhiteXY),
        "noise_profile" to numbers(mosaic.noiseProfile),
        "masked_areas" to JsonArray(mosaic.maskedAreas.map { area(it) }),
        "bad_pixels" to JsonArray(
            mosaic.badPixels.map { bad ->
                val points = bad.points.toList().chunked(2).map { pair -> JsonArray(pair.map { JsonPrimitive(it) }) }
                JsonObject(
                    mapOf(
                        "list" to JsonPrimitive(bad.list),
                        "constant" to JsonPrimitive(bad.constant),
                        "points" to JsonArray(points),
                        "areas" to JsonArray(bad.areas.map { area(it) }),
                    ),
                )
            },
        ),
    )

    private fun gainMap(map: GainMap) = JsonObject(
        mapOf(
            "list" to JsonPrimitive(map.list),
            "area" to area(map.area),
            "plane" to JsonPrimitive(map.plane),
            "planes" to JsonPrimitive(map.planes),
            "row_pitch" to JsonPrimitive(map.rowPitch),
            "column_pitch" to JsonPrimitive(map.columnPitch),
            "spacing" to numbers(doubleArrayOf(map.spacingV, map.spacingH)),
            "origin" to numbers(doubleArrayOf(map.originV, map.originH)),
            "gains" to JsonArray(
                map.gains.toList().chunked(map.mapPlanes).chunked(map.pointsH).map { row ->
                    JsonArray(row.map { point -> JsonArray(point.map { JsonPrimitive(it.toDouble()) }) })
                },
            ),
        ),
    )

    private fun area(region: Region) =
        JsonArray(listOf(region.top, region.left, region.bottom, region.right).map { JsonPrimitive(it) })

    private fun numbers(values: DoubleArray?): JsonElement =
        if (values == null) JsonNull else JsonArray(values.map { JsonPrimitive(it) })

    private fun digest(samples: ShortArray): String {
        val bytes = ByteBuffer.allocate(2 * samples.size).order(ByteOrder.LITTLE_ENDIAN)
        bytes.asShortBuffer().put(samples)
        return MessageDigest.getInstance("SHA-256").digest(bytes.array()).joinToString("") { "%02x".format(it) }
    }
}
