package org.camssf.photo

import org.camssf.Refusal
import org.camssf.UnsupportedRaw
import kotlin.math.floor
import kotlin.math.max

/** Computes the file's lens-shading correction, at a patch's centre or of many samples. */
internal object Shading {
    /**
     * Factors (4) for the positions of the CFA cell: the product of the gain maps that cover them.
     *
     * @throws UnsupportedRaw a gain map that cannot be applied.
     */
    fun of(photo: Facts, quad: DoubleArray): DoubleArray {
        val (x, y) = PatchSamples.centre(quad)
        val factors = DoubleArray(4) { 1.0 }
        check(photo)
        for (map in photo.corrections.gainMaps) {
            for (cell in 0..3) {
                val plane = plane(photo, map, cell)
                val inside = map.area.contains(floor(x + 0.5).toInt(), floor(y + 0.5).toInt())
                if (inside && covers(map, cell, plane)) {
                    factors[cell] *= gain(map, plane, down(map, y, photo), across(map, x, photo))
                }
            }
        }
        return factors
    }

    /**
     * Factors (rows, columns) of the samples in these rows and columns of the active area, row-major.
     *
     * @throws UnsupportedRaw a gain map that cannot be applied.
     */
    fun ofSamples(photo: Facts, rows: IntArray, columns: IntArray): DoubleArray {
        val factors = DoubleArray(rows.size * columns.size) { 1.0 }
        check(photo)
        for (map in photo.corrections.gainMaps) {
            val area = map.area
            val downs = Array(rows.size) { down(map, rows[it].toDouble(), photo) }
            val acrosses = Array(columns.size) { across(map, columns[it].toDouble(), photo) }
            for (cell in 0..3) {
                val plane = plane(photo, map, cell)
                if (!covers(map, cell, plane)) continue
                val right = columns.indices.filter { columns[it] % 2 == cell % 2 && columns[it] in area.columns }
                for (i in rows.indices) {
                    if (rows[i] % 2 != cell / 2 || rows[i] !in area.rows) continue
                    for (j in right) factors[i * columns.size + j] *= gain(map, plane, downs[i], acrosses[j])
                }
            }
        }
        return factors
    }

    /** @throws UnsupportedRaw a gain map that cannot be applied. */
    fun check(photo: Facts) {
        val map = photo.corrections.gainMaps.firstOrNull { it.list == 1 || max(it.rowPitch, it.columnPitch) > 2 }
        if (map != null) {
            throw Refusal.of(
                "unsupported_raw.shading_map", "file" to photo.name, "list" to map.list, "rows" to map.rowPitch,
                "columns" to map.columnPitch,
            )
        }
    }

    private val Region.rows get() = top until bottom
    private val Region.columns get() = left until right

    private fun plane(photo: Facts, map: GainMap, cell: Int): Int =
        if (map.list == 3) "RGB".indexOf(photo.sensor.cfa[cell]) else 0

    private fun covers(map: GainMap, cell: Int, plane: Int): Boolean =
        (map.rowPitch == 1 || (cell / 2 - map.area.top) % 2 == 0) &&
            (map.columnPitch == 1 || (cell % 2 - map.area.left) % 2 == 0) &&
            plane >= map.plane && plane < map.plane + map.planes

    /** A place along one axis of a map: the points around it, and the share of the later one. */
    private class Place(val before: Int, val after: Int, val share: Double)

    private fun down(map: GainMap, y: Double, photo: Facts): Place =
        place(((y + 0.5) / photo.height - map.originV) / map.spacingV, map.pointsV)

    private fun across(map: GainMap, x: Double, photo: Facts): Place =
        place(((x + 0.5) / photo.width - map.originH) / map.spacingH, map.pointsH)

    private fun place(at: Double, count: Int): Place {
        val before = when {
            !(at > 0.0) -> 0
            at >= count - 1 -> count - 1
            else -> at.toInt()
        }
        val share = if (at > 0 && at < count - 1) at - before else 0.0
        return Place(before, minOf(before + 1, count - 1), share)
    }

    /** Bilinear interpolation, along both columns first, then across; constant beyond the outer points. */
    private fun gain(map: GainMap, plane: Int, down: Place, across: Place): Double {
        val entry = minOf(plane, map.mapPlanes - 1)
        fun point(row: Int, column: Int): Double =
            map.net.sharedGains[(row * map.pointsH + column) * map.mapPlanes + entry].toDouble()
        fun along(column: Int): Double =
            point(down.before, column) * (1.0 - down.share) + point(down.after, column) * down.share
        return along(across.before) * (1.0 - across.share) + along(across.after) * across.share
    }
}
