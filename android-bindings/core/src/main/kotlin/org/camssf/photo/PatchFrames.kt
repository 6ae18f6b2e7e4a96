package org.camssf.photo

import org.camssf.ChartNotFound
import org.camssf.checkInterrupt

/**
 * Measures the patches of all frames of a shot in groups; only the samples of one group are in memory.
 *
 * @param frames the chart photo first; all have the same size.
 * @param quads corners (4, 2) of each patch, px.
 * @param together number of samples of all frames in memory at a time; a single patch may exceed it.
 */
internal class PatchFrames(
    private val frames: List<Reading>,
    private val quads: List<DoubleArray>,
    private val together: Long = TOGETHER,
) {
    private val chart = frames[0].facts
    private val cells = PatchSamples.cells(chart.sensor.cfa)
    private val white = frames.map { it.facts.sensor.white }

    /**
     * One patch: the places and samples of each position of the CFA cell. `samples` is empty until each frame is
     * read.
     */
    private inner class Patch(val number: Int) {
        val places = cells.map { PatchSamples.select(quads[number], it, chart.width, chart.height, number + 1) }
        val samples = ArrayList<List<ShortArray>>()
        val size: Long = places.sumOf { it.size.toLong() } * frames.size
        val box: Region? = places.mapNotNull { it.box }.reduceOrNull(::union)
    }

    /**
     * Calls `each` with a patch number from 0, a position of the CFA cell, and each frame's statistics; gives the
     * chart photo's samples to `noise`.
     */
    fun each(noise: NeighbourNoise? = null, each: (Int, Int, List<PatchSample>) -> Unit) {
        // The error names the first patch that fails in chart order, independent of the reading order.
        val failures = arrayOfNulls<ChartNotFound>(quads.size)
        val patches = quads.indices.mapNotNull { i ->
            checkInterrupt()
            try {
                Patch(i)
            } catch (error: ChartNotFound) {
                failures[i] = error
                null
            }
        }
        for (group in groups(patches)) {
            read(group)
            for (patch in group) {
                try {
                    patch.places.forEachIndexed { position, places ->
                        checkInterrupt()
                        val samples = patch.samples.map { it[position] }
                        val found = PatchSample.of(chart.name, white, places, samples, patch.number + 1)
                        each(patch.number, position, found)
                    }
                    val values = patch.samples[0].map { own -> IntArray(own.size) { own[it].toInt() and 0xffff } }
                    noise?.put(patch.number, patch.places, values, values.map { PatchSample.kept(it) })
                } catch (error: ChartNotFound) {
                    failures[patch.number] = error
                }
                patch.samples.clear()
            }
        }
        failures.firstOrNull { it != null }?.let { throw it }
    }

    /** Groups of patches that are read together, sorted from the photo's top down. */
    private fun groups(patches: List<Patch>): List<List<Patch>> {
        val found = ArrayList<MutableList<Patch>>()
        var room = 0L
        for (patch in patches.sortedBy { it.box?.top ?: 0 }) {
            if (found.isEmpty() || patch.size > room) {
                found += ArrayList<Patch>()
                room = together
            }
            found.last() += patch
            room -= patch.size
        }
        return found
    }

    private fun read(group: List<Patch>) {
        val box = group.mapNotNull { it.box }.reduceOrNull(::union)
        for (frame in frames) {
            val gathered = group.map { patch -> patch.places.map { ShortArray(it.size) } }
            if (box != null) {
                frame.scan(box) { y, x, count, samples, at ->
                    for (i in group.indices) {
                        val own = group[i].box ?: continue
                        if (y < own.top || y >= own.bottom || x >= own.right || x + count <= own.left) continue
                        val places = group[i].places
                        for (p in places.indices) places[p].take(y, x, samples, at, count, gathered[i][p])
                    }
                }
                frame.release()
            }
            for (i in group.indices) group[i].samples += gathered[i]
        }
    }

    private companion object {
        /** Samples; 16 MB. */
        const val TOGETHER = 8L shl 20

        fun union(one: Region, other: Region) = Region(
            minOf(one.left, other.left), minOf(one.top, other.top),
            maxOf(one.right, other.right), maxOf(one.bottom, other.bottom),
        )
    }
}
