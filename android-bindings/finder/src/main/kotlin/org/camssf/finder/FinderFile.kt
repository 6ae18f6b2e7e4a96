package org.camssf.finder

import org.camssf.Shipped
import org.camssf.json.JsonText
import org.camssf.json.Members
import org.camssf.json.list
import org.camssf.json.members
import org.camssf.json.number
import org.camssf.json.numbers
import org.camssf.json.part
import org.camssf.json.text
import org.camssf.json.whole

/**
 * The limits of the search and the colours of the charts, from finder.json, which Python also reads. The file says
 * what each limit means, and in what unit.
 */
internal object FinderFile {
    private val file: Members by lazy {
        members(JsonText.parse(Shipped.text("finder.json"))).also {
            check(it.text("format") == "camssf-finder/1") { "finder.json is of another version" }
        }
    }

    /** The limits. */
    val limits: Limits by lazy { Limits(file.part("limits")) }

    /** Edge of a patch in pitches, and the patches' colours, of the chart of this layout. */
    fun kind(layout: String): Members = file.part("kinds").part(layout)

    /** The limits by their names in the file. */
    class Limits internal constructor(private val json: Members) {
        val longest = whole("longest")
        val smallest = whole("smallest")
        val largestCode = whole("largest_code")
        val passes = json.part("passes").list("value").map { pass ->
            numbers(pass).let { values -> IntArray(values.size) { values[it].toInt() } }
        }
        val mostBlobs = whole("most_blobs")
        val smallestArea = whole("smallest_area")
        val largestShare = whole("largest_share")
        val full = numbers("full")
        val overlap = number("overlap")
        val sameSize = number("same_size")
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
        val mostLattices = whole("most_lattices")
        val floor = number("floor")
        val spots = numbers("spots")
        val seen = number("seen")
        val stray = number("stray")
        val strayMedians = number("stray_medians")
        val apart = number("apart")
        val ring = number("ring")
        val accept = number("accept")
        val acceptLuma = number("accept_luma")

        private fun whole(name: String) = json.part(name).whole("value")

        private fun number(name: String) = json.part(name).number("value")

        private fun numbers(name: String) = json.part(name).numbers("value")
    }
}
