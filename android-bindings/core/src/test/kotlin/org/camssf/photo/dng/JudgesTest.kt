package org.camssf.photo.dng

import kotlinx.serialization.json.Json
import kotlinx.serialization.json.JsonObject
import kotlinx.serialization.json.jsonObject
import kotlinx.serialization.json.jsonPrimitive
import org.camssf.photo.Mosaic
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.DynamicTest
import org.junit.jupiter.api.DynamicTest.dynamicTest
import org.junit.jupiter.api.Tag
import org.junit.jupiter.api.Test
import org.junit.jupiter.api.TestFactory
import java.io.File
import java.nio.ByteBuffer
import java.nio.ByteOrder
import java.security.MessageDigest

/**
 * The samples against those of LibRaw and of tifffile with libjpeg-turbo, whose hashes lie in `dng/judges.json`.
 *
 * `python -m tools.kotlin_variants` writes that file anew, from [VariantFiles].
 */
@Tag("R-SAMPLES")
class JudgesTest {
    private val judged: JsonObject by lazy {
        val stream = checkNotNull(javaClass.getResourceAsStream("/dng/judges.json"))
        Json.parseToJsonElement(stream.use { String(it.readBytes()) }).jsonObject
    }

    private fun verdict(of: String, name: String, judge: String): String =
        judged.getValue(of).jsonObject.getValue(name).jsonObject.getValue(judge).jsonPrimitive.content

    /** LibRaw 0.22 refuses these or reads them otherwise, for a reason; everything else must agree. */
    private fun librawCannot(name: String): String? = when {
        name.startsWith("deflate") || name == "table-deflate" -> "it inflates floating-point samples only"
        name == "jpeg-strips" -> "it decodes the first strip alone"
        name == "strips-backwards" -> "it reads on from the first strip"
        name == "tile-larger-than-picture" -> "it breaks lines at the picture's width"
        name == "jpeg-markers" -> "it does not know T.81's fill bytes before markers"
        name.startsWith("jpeg-point-transform") -> "it does not undo the point transform"
        Regex("jpeg-predictor-[2-7]-restart").matches(name) -> "it predicts across restarts, against T.81"
        else -> null
    }

    private fun tifffileCannot(name: String): String? = when {
        name.startsWith("table") -> "it applies no LinearizationTable"
        name == "jpeg-category-16-dng-1.0" -> "it does not know DNG 1.0's category 16"
        else -> null
    }

    @Test
    fun everyVariantIsJudged() {
        assertEquals(Variants.all.map { "${it.name}.dng" }.toSet(), judged.getValue("variants").jsonObject.keys)
    }

    @TestFactory
    fun variants(): List<DynamicTest> = Variants.all.map { variant ->
        dynamicTest(variant.name) {
            val ours = digest(VariantsTest.read(variant))
            val agrees = listOf("libraw", "tifffile").filter {
                verdict("variants", "${variant.name}.dng", it) == ours
            }
            val expected = listOfNotNull(
                "libraw".takeIf { librawCannot(variant.name) == null },
                "tifffile".takeIf { tifffileCannot(variant.name) == null },
            )
            assertEquals(if (variant.name == "table-deflate") emptyList() else expected, agrees)
        }
    }

    @TestFactory
    fun realFiles(): List<DynamicTest> = listOf(
        Real("colorchart.dng", 1734, 1156, "RGGB", 2056.0, 15000.0),
        Real("blackmagic_ljpeg.dng", 1952, 1112, "GBRG", 256.0, 51080.0),
    ).map { real ->
        dynamicTest(real.name) {
            val file = File(System.getProperty("camssf.root"), "data/dng/${real.name}")
            val found = DngSource.of(file).use { DngReader.read(it) }
            assertEquals(verdict("real", real.name, "libraw"), digest(found))
            assertEquals(listOf(real.width, real.height), listOf(found.width, found.height))
            assertEquals(real.cfa, found.sensor.cfa)
            assertArrayEquals(DoubleArray(4) { real.black }, found.sensor.sharedBlack)
            assertEquals(real.white, found.sensor.white)
        }
    }

    /** A real file, with what LibRaw says of it. */
    private class Real(
        val name: String, val width: Int, val height: Int, val cfa: String, val black: Double, val white: Double,
    )

    private fun digest(mosaic: Mosaic): String {
        val bytes = ByteBuffer.allocate(2 * mosaic.samples.size).order(ByteOrder.LITTLE_ENDIAN)
        bytes.asShortBuffer().put(mosaic.samples)
        return MessageDigest.getInstance("SHA-256").digest(bytes.array()).joinToString("") { "%02x".format(it) }
    }
}
