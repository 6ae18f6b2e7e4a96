package org.camssf.photo

import org.camssf.Refusal
import kotlin.math.floor
import kotlin.math.max

/** Computes the file's lens-shading correction at a patch's centre. */
internal object Shading {
    /** Factors (4) for the positions of the CFA cell: the product of the gain maps that cover them. */
    fun of(photo: Facts, quad: DoubleArray): DoubleArray {
        val (x, y) = PatchSamples.centre(quad)
        val factors = DoubleArray(4) { 1.0 }
        for (map in photo.corrections.gainMaps) {
            if (map.list == 1 || max(map.rowPitch, map.columnPitch) > 2) {
                throw Refusal.of(
                    "unsupported_raw.shading_map", "file" to photo.name, "list" to map.list, "rows" to map.rowPitch,
                    "columns" to map.columnPitch,
                )
            }
            for (cell in 0..3) {
                val plane = if (map.list == 3) "RGB".indexOf(photo.sensor.cfa[cell]) else 0
                if (covers(map, x, y, cell, plane)) factors[cell] *= at(map, x, y, photo, plane)
            }
        }
        return factors
    }

    private fun covers(map: GainMap, x: Double, y: Double, cell: Int, plane: Int): Boolean =
        map.area.contains(floor(x + 0.5).toInt(), floor(y + 0.5).toInt()) &&
            (map.rowPitch == 1 || (cell / 2 - map.area.top) % 2 == 0) &&
            (map.columnPitch == 1 || (cell % 2 - map.area.left) % 2 == 0) &&
            plane >= map.plane && plane < map.plane + map.planes

    /** Bilinear interpolation, along both columns first, then across; constant beyond the outer points. */
    private fun at(map: GainMap, x: Double, y: Double, photo: Facts, plane: Int): Double {
        val v = ((y + 0.5) / photo.height - map.originV) / map.spacingV
        val h = ((x + 0.5) / photo.width - map.originH) / map.spacingH
        val i = place(v, map.pointsV)
        val j = place(h, map.pointsH)
        val p = if (v > 0 && v < map.pointsV - 1) v - i else 0.0
        val q = if (h > 0 && h < map.pointsH - 1) h - j else 0.0
        val below = minOf(i + 1, map.pointsV - 1)
        val right = minOf(j + 1, map.pointsH - 1)
        val entry = minOf(plane, map.mapPlanes - 1)
        fun gain(row: Int, column: Int): Double =
            map.net.sharedGains[(row * map.pointsH + column) * map.mapPlanes + entry].toDouble()
        val first = gain(i, j) * (1.0 - p) + gain(below, j) * p
        val second = gain(i, right) * (1.0 - p) + gain(below, right) * p
        return first * (1.0 - q) + second * q
    }

    private fun place(v: Double, count: Int): Int = when {
        !(v > 0.0) -> 0
        v >= count - 1 -> count - 1
        else -> v.toInt()
    }
}
