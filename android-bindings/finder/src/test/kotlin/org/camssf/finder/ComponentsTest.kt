package org.camssf.finder

import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Test

/** Connected pixels, held to a search from pixel to pixel. */
class ComponentsTest {
    private val components = Components()

    /** Number, Σx, Σy, Σx², Σxy, Σy² of each component, by its first pixel in reading order. */
    private fun listed(picture: List<String>): List<List<Long>> {
        components.clear()
        for ((y, row) in picture.withIndex()) {
            components.row(y)
            var x = 0
            while (x < row.length) {
                val start = x
                while (x < row.length && row[x] == '#') x++
                if (x > start) components.run(start, x - 1)
                x++
            }
        }
        val found = ArrayList<List<Long>>()
        components.each { found += components.moments.slice(6 * it until 6 * it + 6) }
        return found
    }

    private fun searched(picture: List<String>): List<List<Long>> {
        val seen = HashSet<Pair<Int, Int>>()
        fun bright(x: Int, y: Int) = y in picture.indices && x in picture[y].indices && picture[y][x] == '#'
        val found = ArrayList<List<Long>>()
        for (y in picture.indices) {
            for (x in picture[y].indices) {
                if (!bright(x, y) || x to y in seen) continue
                val open = arrayListOf(x to y)
                val own = ArrayList<Pair<Long, Long>>()
                seen += x to y
                while (open.isNotEmpty()) {
                    val (a, b) = open.removeAt(open.size - 1)
                    own += a.toLong() to b.toLong()
                    for (next in listOf(a + 1 to b, a - 1 to b, a to b + 1, a to b - 1)) {
                        if (bright(next.first, next.second) && seen.add(next)) open += next
                    }
                }
                found += listOf(
                    own.size.toLong(), own.sumOf { it.first }, own.sumOf { it.second },
                    own.sumOf { it.first * it.first }, own.sumOf { it.first * it.second },
                    own.sumOf { it.second * it.second },
                )
            }
        }
        return found
    }

    private val pictures = listOf(
        listOf("##..", "..##"), // corners do not connect
        listOf("#..#..#", "#..#..#", "#######"), // three that meet below
        listOf("#######", "#.#.#.#", "#.#.#.#"),
        listOf(".....", "####.", "...#.", ".#.#.", ".#.#.", ".###."),
        // A spiral and its inside.
        listOf("#######", "#.....#", "#.###.#", "#.#.#.#", "#.#...#", "#.#####", "#......"),
        listOf("#.#.#.#.#", "##.###.##", ".#..#..#.", "#########"),
        listOf("....##", "..###.", "##....", "...#..", "..##.."),
        listOf("", "###", "", "###"),
        List(60) { y -> String(CharArray(61) { if ((it + y) % 2 == 0) '#' else '.' }) }, // 1830 runs
        List(50) { y -> String(CharArray(97) { if ((7 * it * it + 5 * y * it + 3 * y) % 11 < 6) '#' else '.' }) },
    )

    @Test
    fun `sums of connected pixels, in whatever shape they meet`() {
        for (picture in pictures) assertEquals(searched(picture), listed(picture))
        // Once more, in what is left of the others.
        for (picture in pictures.reversed()) assertEquals(searched(picture), listed(picture))
    }
}
