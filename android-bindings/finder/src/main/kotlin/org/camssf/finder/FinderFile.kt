package org.camssf.finder

import kotlinx.serialization.json.Json
import kotlinx.serialization.json.JsonArray
import kotlinx.serialization.json.JsonObject
import kotlinx.serialization.json.double
import kotlinx.serialization.json.int
import kotlinx.serialization.json.jsonArray
import kotlinx.serialization.json.jsonObject
import kotlinx.serialization.json.jsonPrimitive
import org.camssf.InvalidArgument
import org.camssf.model.Models

/**
 * The limits of the search and the colours of the charts, from finder.json, which Python also reads. The file says
 * what each limit means, and in what unit.
 */
internal object FinderFile {
    private val file: JsonObject by lazy {
        val text = try {
            Models.read("finder.json").decodeToString()
        } catch (error: IllegalStateException) {
            throw InvalidArgument(error.message.orEmpty(), "Add camssf-model unchanged.", cause = error)
        }
        Json.parseToJsonElement(text).jsonObject.also {
            check(it.getValue("format").jsonPrimitive.content == "camssf-finder/1") {
                "finder.json is of another version"
            }
        }
    }

    /** The limits. */
    val limits: Limits by lazy { Limits(file.getValue("limits").jsonObject) }

    /** Edge of a patch in pitches, and the patches' colours, of the chart of this layout. */
    fun kind(layout: String): JsonObject = file.getValue("kinds").jsonObject.getValue(layout).jsonObject

    /** The limits by their names in the file. */
    class Limits internal constructor(private val json: JsonObject) {
        val longest = whole("longest")
        val smallest = whole("smallest")
        val passes = entry("passes").jsonArray.map { pass ->
            pass.jsonArray.map { it.jsonPrimitive.int }.toIntArray()
        }
        val mostBlobs = whole("most_blobs")
        val smallestArea = whole("smallest_area")
        val largestShare = whole("largest_share")
        val full = numbers("full")
        val longestShape = number("longest_shape")
        val neighbour = numbers("neighbour")
        val mostNeighbours = whole("most_neighbours")
        val alike = number("alike")
        val lengths = number("lengths")
        val cosine = number("cosine")
        val step = number("step")
        val fewest = whole("fewest")
        val place = numbers("place")
        val sizes = numbers("sizes")
        val widest = whole("widest")
        val far = whole("far")
        val bridge = whole("bridge")
        val mostGrids = whole("most_grids")
        val floor = number("floor")
        val spots = numbers("spots")
        val seen = number("seen")
        val stray = number("stray")
        val ring = number("ring")
        val accept = number("accept")
        val acceptLuma = number("accept_luma")

        private fun entry(name: String) = json.getValue(name).jsonObject.getValue("value")

        private fun whole(name: String) = entry(name).jsonPrimitive.int

        private fun number(name: String) = entry(name).jsonPrimitive.double

        private fun numbers(name: String) = (entry(name) as JsonArray).map { it.jsonPrimitive.double }.toDoubleArray()
    }
}
