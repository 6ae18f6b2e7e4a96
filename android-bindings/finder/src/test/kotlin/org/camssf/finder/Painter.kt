package org.camssf.finder

import kotlinx.serialization.json.Json
import kotlinx.serialization.json.double
import kotlinx.serialization.json.jsonArray
import kotlinx.serialization.json.jsonObject
import kotlinx.serialization.json.jsonPrimitive
import org.camssf.model.Models
import kotlin.math.cos
import kotlin.math.pow
import kotlin.math.round
import kotlin.math.roundToInt
import kotlin.math.sin

/** A picture with charts, 8 bits as on a display. */
internal class Painter(val width: Int = 640, val height: Int = 480) {
    val planes = List(3) { ByteArray(width * height) { 110 } }

    fun picture(): Picture {
        val (red, green, blue) = planes.map { Plane(it, width) }
        return Picture.rgb(red, green, blue, width, height)
    }

    fun set(x: Int, y: Int, red: Int, green: Int, blue: Int) {
        planes[0][y * width + x] = red.toByte()
        planes[1][y * width + x] = green.toByte()
        planes[2][y * width + x] = blue.toByte()
    }

    /** Keys of many greys, the whole picture full: as many blobs as there can be. */
    fun keys(pitch: Int): Painter {
        for (y in 0 until height) {
            for (x in 0 until width) {
                val key = x % pitch < pitch - 3 && y % pitch < pitch - 3
                val level = if (key) 90 + 13 * ((5 * (x / pitch) + 3 * (y / pitch)) % 11) else 30
                set(x, y, level, level, level)
            }
        }
        return this
    }

    /** Whole numbers that look like noise, the same in every run. */
    fun noise(size: Int): Painter {
        var state = 1L
        for (plane in planes) {
            for (i in plane.indices) {
                state = (state * 6364136223846793005L + 1442695040888963407L)
                val level = (plane[i].toInt() and 0xff) + ((state ushr 33) % (2 * size + 1)).toInt() - size
                plane[i] = level.coerceIn(0, 255).toByte()
            }
        }
        return this
    }

    /** A chart about (x, y), its patches `pitch` px apart, turned by degrees clockwise. */
    fun chart(x: Double, y: Double, pitch: Double, turn: Double = 0.0, mirrored: Boolean = false): Painter {
        val c = cos(Math.toRadians(turn))
        val s = sin(Math.toRadians(turn))
        for (row in 0 until height) {
            for (column in 0 until width) {
                val across = ((column - x) * c + (row - y) * s) / pitch
                val u = (if (mirrored) -across else across) + 2.5
                val v = ((row - y) * c - (column - x) * s) / pitch + 1.5
                if (u < -0.7 || u > 5.7 || v < -0.7 || v > 3.7) continue
                val i = round(u).coerceIn(0.0, 5.0)
                val j = round(v).coerceIn(0.0, 3.0)
                if (Math.abs(u - i) < 0.44 && Math.abs(v - j) < 0.44) {
                    val k = (6 * j + i).toInt()
                    set(column, row, shown(COLOURS[k][0]), shown(COLOURS[k][1]), shown(COLOURS[k][2]))
                } else {
                    set(column, row, 45, 45, 45)
                }
            }
        }
        return this
    }

    private fun shown(light: Double): Int = (255 * light.pow(1 / 2.2)).roundToInt()

    private companion object {
        val COLOURS: List<List<Double>> =
            Json.parseToJsonElement(Models.read("finder.json").decodeToString()).jsonObject.getValue("kinds")
                .jsonObject.getValue("classic24").jsonObject.getValue("colours").jsonArray
                .map { row -> row.jsonArray.map { it.jsonPrimitive.double } }
    }
}
