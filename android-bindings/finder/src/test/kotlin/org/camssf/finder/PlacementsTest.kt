package org.camssf.finder

import org.camssf.photo.Agreement
import org.camssf.photo.Homography
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertNull
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import kotlin.math.ceil

/** The best placement of a chart on a lattice, held to a search of all of them. */
class PlacementsTest {
    private val limits = FinderFile.limits
    private val kind = ChartKind.CLASSIC_24
    private val orientation = Orientation(Blobs())

    /** Places of the patches, and their agreement; null where they cannot be the chart. */
    private inner class Tried(codes: Codes, lattice: BlobLattice, u: Int, v: Int, turns: Int, val mirrored: Boolean) {
        val places = List(24) {
            var step = (if (mirrored) -(it % 6) else it % 6) to it / 6
            repeat(turns) { step = -step.second to step.first }
            u + step.first to v + step.second
        }

        private val blobs = (0 until lattice.size).map { lattice.u[it] to lattice.v[it] }
        private val own = places.toSet()
        private val seen = blobs.count { it in own }
        private val around = blobs.count { (p, q) ->
            (p to q) !in own &&
                p in places.minOf { it.first } - 1..places.maxOf { it.first } + 1 &&
                q in places.minOf { it.second } - 1..places.maxOf { it.second } + 1
        }

        val score: Double? =
            if (seen < ceil(limits.seen * 24) ||
                around > limits.ring * 24
            ) {
                null
            } else {
                agreement(codes, lattice.map, places)
            }
    }

    /** Agreement of the colours at these places; null if one is not in view. */
    private fun agreement(codes: Codes, map: Homography, places: List<Pair<Int, Int>>): Double? {
        val colours = DoubleArray(72) { limits.floor }
        for ((k, place) in places.withIndex()) {
            for (du in limits.spots) {
                for (dv in limits.spots) {
                    val x = Math.rint(map.x(place.first + du, place.second + dv)).toInt()
                    val y = Math.rint(map.y(place.first + du, place.second + dv)).toInt()
                    if (x !in 0 until codes.width || y !in 0 until codes.height) return null
                    for (c in 0..2) {
                        colours[3 * k + c] +=
                            codes.values[(c * codes.height + y) * codes.width + x] / 25.0
                    }
                }
            }
        }
        return Agreement.of(colours, kind.shape.colours)
    }

    /** The best of all placements whose patches a lattice in places -1 to 7 can have. */
    private fun searched(codes: Codes, lattice: BlobLattice): Tried? = (-6..12).flatMap { u ->
        (-6..12).flatMap { v ->
            (0..7).map { Tried(codes, lattice, u, v, it / 2, it % 2 == 1) }
        }
    }.filter { it.score != null }.maxByOrNull { it.score!! }

    @Test
    fun `the placement is the best of all`() {
        val map = Homography(doubleArrayOf(22.0, 1.0, 120.0, -1.5, 21.0, 90.0, 0.002, -0.004, 1.0))
        val pictures = listOf(
            Painter(300, 240).chart(185.0, 130.0, 22.0).noise(9),
            Painter(300, 240).chart(165.0, 165.0, 22.0, 90.0, mirrored = true).noise(9),
            Painter(300, 240).keys(23).noise(40),
            Painter(170, 150).chart(100.0, 80.0, 22.0, 180.0),
        )
        var state = 1L
        var placed = 0
        for (picture in pictures) {
            val codes = Codes().also { it.read(picture.picture()) }
            // Tenths of the places in a block of 6 × 4, and of those around it, that hold blobs.
            for ((inside, outside) in listOf(10 to 0, 9 to 2, 7 to 1, 6 to 3, 4 to 1)) {
                val blobs = (-1..7).flatMap { u -> (-1..6).map { u to it } }.filter { (u, v) ->
                    state = state * 6364136223846793005L + 1442695040888963407L
                    (state ushr 33) % 10 < if (u in 0..5 && v in 0..3) inside else outside
                }
                val lattice = BlobLattice(
                    map,
                    IntArray(blobs.size) { blobs[it].first },
                    IntArray(blobs.size) { blobs[it].second },
                    IntArray(blobs.size) { it },
                )
                val best = searched(codes, lattice)
                val own = orientation.orient(codes, lattice, kind)
                if (best == null) assertNull(own) else placed++
                assertEquals(best?.score ?: 0.0, own?.score ?: 0.0, 2e-9)
                assertEquals(best?.mirrored, own?.mirrored)
                assertEquals(best?.places, own?.let { List(24) { k -> it.u[k] to it.v[k] } })
            }
        }
        assertTrue(placed in 4..16, "$placed")
    }
}
