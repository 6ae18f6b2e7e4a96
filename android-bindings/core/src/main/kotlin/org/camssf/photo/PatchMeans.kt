package org.camssf.photo

import org.camssf.ChartNotFound
import org.camssf.FramesDiffer
import org.camssf.InvalidArgument
import org.camssf.UnsupportedRaw
import org.camssf.short
import kotlin.math.abs
import kotlin.math.floor
import kotlin.math.max
import kotlin.math.sqrt

/**
 * One frame's statistics in the central part of each of n patches. Arrays are row-major, columns R, G, B.
 *
 * @property mean (n, 3) DN, black level still in it; green is the mean of its two positions' means.
 * @property standardError (n, 3) DN of that mean, from the samples themselves.
 * @property count (n, 3) samples that entered.
 * @property clipped (n, 3) share of samples at or above the white level, 0 to 1.
 * @property dead (n, 3) share of samples rejected as dust or hot pixels, 0 to 1.
 * @property gradient (n, 3) relative change of the signal from edge to edge of the measured part, 1.
 * @property greens (n, 2) mean of the green on the red's rows and on the blue's rows, DN.
 */
public class FrameMeans internal constructor(
    public val mean: DoubleArray,
    public val standardError: DoubleArray,
    public val count: LongArray,
    public val clipped: DoubleArray,
    public val dead: DoubleArray,
    public val gradient: DoubleArray,
    public val greens: DoubleArray,
)

/**
 * What is done about the lens shading that a photo's file describes.
 *
 * @property word the same in Python and JSON.
 */
public enum class LensShading(public val word: String) {
    /** Nothing: the samples are taken as they are. A white frame corrects the shading. */
    AS_STORED("as-stored"),

    /** What lies above black is multiplied by the gain maps in the chart photo's file. */
    APPLY("apply"),
    ;

    public companion object {
        /**
         * The one of that word.
         *
         * @throws InvalidArgument another word.
         */
        @JvmStatic
        public fun of(word: String): LensShading = values().firstOrNull { it.word == word } ?: throw InvalidArgument(
            "Lens shading '$word' is unknown.",
            "Say ${values().joinToString(" or ") { it.word }}.",
        )
    }
}

/**
 * One shot: the same samples of the chart, white and dark frames.
 *
 * @property chart statistics of the chart photo.
 * @property white of the white frame, or null.
 * @property dark of the dark frame, or null.
 * @property black (3) the file's black level of R, G, B, DN.
 * @property saturation the white level, DN.
 */
public class PatchMeans internal constructor(
    public val chart: FrameMeans,
    public val white: FrameMeans?,
    public val dark: FrameMeans?,
    public val black: DoubleArray,
    public val saturation: Double,
) {
    public companion object {
        /**
         * Measures the same samples of every patch in all frames of one shot, by the numbered rule of Python's
         * `camssf.photo.patches`: sums of whole numbers, so both give the same to the last bit.
         *
         * @param chart the photo of the chart; its region must hold the patches, and so must the other frames'.
         * @param pose where the chart lies in it.
         * @param white the white frame, taken like the chart photo; null if there is none.
         * @param dark the dark frame, likewise.
         * @throws InvalidArgument lens shading shall be applied and the file holds none.
         * @throws UnsupportedRaw gain maps that camssf does not apply.
         * @throws FramesDiffer size, CFA, camera, levels, exposure or ISO of a frame differ from the chart photo's.
         * @throws ChartNotFound a patch leaves the photo, or holds fewer than 16 samples of a colour.
         */
        @JvmStatic
        @JvmOverloads
        public fun measure(
            chart: Mosaic,
            pose: ChartPose,
            white: Mosaic? = null,
            dark: Mosaic? = null,
            lensShading: LensShading = LensShading.AS_STORED,
        ): PatchMeans {
            if (lensShading == LensShading.APPLY && chart.gainMaps.isEmpty()) {
                throw InvalidArgument(
                    "${chart.name} holds no lens-shading map to apply.",
                    "Leave the samples as stored, or take a white frame.",
                )
            }
            if (white != null) Alike.check(chart, white, "white")
            if (dark != null) Alike.check(chart, dark, "dark")
            val frames = listOfNotNull(chart, white, dark)
            val cells = cells(chart.cfa)
            val black = DoubleArray(4) { chart.black[cells[it]] }
            val joints = frames.map { Joint(pose.quads.size / 8, black, chart.white) }
            for (patch in 0 until pose.quads.size / 8) {
                val quad = pose.quads.copyOfRange(8 * patch, 8 * patch + 8)
                val shading = if (lensShading == LensShading.APPLY) Shading.of(chart, quad) else null
                for ((position, cell) in cells.withIndex()) {
                    val found = position(frames, quad, cell, patch + 1)
                    val gain = shading?.get(cell) ?: 1.0
                    for ((joint, sample) in joints.zip(found)) joint.put(patch, position, sample, gain)
                }
            }
            val means = joints.map { it.means() }
            return PatchMeans(
                means[0],
                if (white != null) means[1] else null,
                if (dark != null) means.last() else null,
                doubleArrayOf(black[0], (black[1] + black[2]) / 2, black[3]),
                chart.white,
            )
        }

        /** Part of each patch edge that is measured. */
        private const val SHRINK = 0.5

        /** Samples further from the median than this many MAD (plus FLOOR) are dust or hot pixels. */
        private const val REJECT = 6

        /** DN that are always allowed: whole numbers have a MAD of zero where there is no noise. */
        private const val FLOOR = 2

        /** Samples that each position of the CFA cell must have in every patch. */
        private const val FEWEST = 16

        /** Index in the 2 × 2 cell of R, the green on R's rows, the green on B's rows, B. */
        private fun cells(cfa: String): List<Int> {
            val red = cfa.indexOf('R')
            val blue = cfa.indexOf('B')
            return listOf(red, red xor 1, blue xor 1, blue)
        }

        internal fun centre(quad: DoubleArray): DoubleArray =
            DoubleArray(2) { ((quad[it] + quad[2 + it]) + (quad[4 + it] + quad[6 + it])) * 0.25 }

        /** Statistics of one position of the CFA cell in one patch, for each frame: rules 1 to 5. */
        private fun position(frames: List<Mosaic>, quad: DoubleArray, cell: Int, patch: Int): List<Sample> {
            val places = select(quad, cell, frames[0].width, frames[0].height, patch)
            val n = places.size / 2
            if (n < FEWEST) throw tooSmall(frames[0], patch, n)
            val values = frames.map { frame -> IntArray(n) { frame[places[2 * it], places[2 * it + 1]] } }
            val kept = values.map { kept(it) }
            val joint = indicesOf(n) { i -> kept.all { it[i] } }
            if (joint.size < FEWEST) throw tooSmall(frames[0], patch, joint.size)
            val left = joint.minOf { places[2 * it] / 2 }
            val top = joint.minOf { places[2 * it + 1] / 2 }
            val x = IntArray(joint.size) { places[2 * joint[it]] / 2 - left }
            val y = IntArray(joint.size) { places[2 * joint[it] + 1] / 2 - top }
            return frames.indices.map { f ->
                val v = IntArray(joint.size) { values[f][joint[it]] }
                val clipped = values[f].count { it >= frames[f].white }
                mean(v, x, y, clipped, kept[f].count { !it }, n)
            }
        }

        /** Columns and rows, in turn, of the cell's samples in the shrunk quad. */
        private fun select(quad: DoubleArray, cell: Int, width: Int, height: Int, patch: Int): IntArray {
            val centre = centre(quad)
            val moved = DoubleArray(8) { 16 * (centre[it % 2] + SHRINK * (quad[it] - centre[it % 2])) }
            val limit = doubleArrayOf(16.0 * (width - 1), 16.0 * (height - 1))
            if (!moved.indices.all { moved[it] >= 0 && moved[it] <= limit[it % 2] }) { // NaN is none
                throw ChartNotFound(
                    "Patch $patch leaves the photo.",
                    "Take the photo with the whole chart in view, or correct the corners.",
                )
            }
            val corners = LongArray(8) { floor(moved[it] + 0.5).toLong() }
            val low = LongArray(2) { axis -> ((0..3).minOf { corners[2 * it + axis] } + 15) / 16 }
            val high = LongArray(2) { axis -> (0..3).maxOf { corners[2 * it + axis] } / 16 }
            val found = IntArray((2 * ((high[0] - low[0]) / 2 + 1) * ((high[1] - low[1]) / 2 + 1)).toInt())
            var size = 0
            var row = low[1] + (cell / 2 + low[1]) % 2
            while (row <= high[1]) {
                var column = low[0] + (cell % 2 + low[0]) % 2
                while (column <= high[0]) {
                    if (inside(corners, column, row)) {
                        found[size++] = column.toInt()
                        found[size++] = row.toInt()
                    }
                    column += 2
                }
                row += 2
            }
            return found.copyOf(size)
        }

        private inline fun indicesOf(n: Int, holds: (Int) -> Boolean): IntArray {
            val found = IntArray(n)
            var size = 0
            for (i in 0 until n) if (holds(i)) found[size++] = i
            return found.copyOf(size)
        }

        private fun inside(corners: LongArray, column: Long, row: Long): Boolean = (0..3).all { a ->
            val b = (a + 1) % 4
            (corners[2 * b] - corners[2 * a]) * (16 * row - corners[2 * a + 1]) >=
                (corners[2 * b + 1] - corners[2 * a + 1]) * (16 * column - corners[2 * a])
        }

        private fun tooSmall(frame: Mosaic, patch: Int, count: Int) = ChartNotFound(
            "${frame.name}: patch $patch holds only $count good samples of a colour, $FEWEST are needed.",
            "Go closer so that the chart fills the frame, and wipe dust off chart and lens.",
            count.toDouble(),
            FEWEST.toDouble(),
        )

        /** The two values in the middle, found by counting: a patch's values lie close together. */
        private fun twiceMedian(values: IntArray): Int {
            val least = values.min()
            val counts = IntArray(values.max() - least + 1)
            for (value in values) counts[value - least]++
            var below = 0
            var lower = -1
            for (at in counts.indices) {
                below += counts[at]
                if (lower < 0 && below > (values.size - 1) / 2) lower = at
                if (below > values.size / 2) return lower + at + 2 * least
            }
            error("no value")
        }

        /** False for dust and hot pixels: rule 3. */
        private fun kept(values: IntArray): BooleanArray {
            val middle = twiceMedian(values)
            val deviation = IntArray(values.size) { abs(2 * values[it] - middle) }
            val limit = REJECT * twiceMedian(deviation) + 4 * FLOOR
            return BooleanArray(values.size) { 2 * deviation[it] <= limit }
        }

        /** Mean, standard error about the plane, and change from edge to edge: rule 5. */
        private fun mean(v: IntArray, x: IntArray, y: IntArray, clipped: Int, rejected: Int, all: Int): Sample {
            val n = v.size
            var total = 0L
            for (value in v) total += value
            val level = total / n
            val sums = Array(4) { LongArray(4) } // over 1, X, Y, e: whole numbers, exact in any order
            for (i in 0 until n) {
                val e = v[i] - level
                val right = x[i].toLong()
                val down = y[i].toLong()
                sums[0][1] += right
                sums[0][2] += down
                sums[0][3] += e
                sums[1][1] += right * right
                sums[1][2] += right * down
                sums[1][3] += right * e
                sums[2][2] += down * down
                sums[2][3] += down * e
                sums[3][3] += e * e
            }
            fun c(a: Int, b: Int): Double = sums[a][b] - sums[0][a].toDouble() * sums[0][b] / n
            val determinant = c(1, 1) * c(2, 2) - c(1, 2) * c(1, 2)
            var a = 0.0
            var b = 0.0
            if (determinant > 0) {
                a = (c(2, 2) * c(1, 3) - c(1, 2) * c(2, 3)) / determinant
                b = (c(1, 1) * c(2, 3) - c(1, 2) * c(1, 3)) / determinant
            }
            val variance = max(0.0, c(3, 3) - a * c(1, 3) - b * c(2, 3)) / (n - 3) + 1.0 / 12
            return Sample(
                total.toDouble() / n,
                sqrt(variance / n),
                n,
                abs(a) * x.max() + abs(b) * y.max(),
                clipped,
                rejected,
                all,
            )
        }
    }
}

/** One frame, one position of the CFA cell, one patch. */
private class Sample(
    val mean: Double,
    val error: Double,
    val count: Int,
    val change: Double,
    val clipped: Int,
    val rejected: Int,
    val all: Int,
)

/** Positions of the cell → colours, the two greens joined: rules 6 and 7. */
private class Joint(private val n: Int, private val black: DoubleArray, private val white: Double) {
    private val samples = arrayOfNulls<Sample>(4 * n)
    private val gains = DoubleArray(4 * n)

    fun put(patch: Int, position: Int, sample: Sample, gain: Double) {
        samples[4 * patch + position] = sample
        gains[4 * patch + position] = gain
    }

    private fun sample(i: Int): Sample = samples[i]!!

    private fun mean(i: Int): Double {
        val plain = sample(i).mean
        return if (gains[i] != 1.0) black[i % 4] + gains[i] * (plain - black[i % 4]) else plain
    }

    private fun gradient(i: Int): Double {
        val scale = white - black[i % 4] // 1 % of the range: dark frames
        return sample(i).change / max(abs(sample(i).mean - black[i % 4]), 0.01 * scale)
    }

    private fun error(i: Int): Double = gains[i] * sample(i).error

    private fun colours(of: (Int) -> Double, green: (Double, Double) -> Double): DoubleArray = DoubleArray(3 * n) {
        val patch = 4 * (it / 3)
        when (it % 3) {
            0 -> of(patch)
            1 -> green(of(patch + 1), of(patch + 2))
            else -> of(patch + 3)
        }
    }

    private fun average(of: (Int) -> Double): DoubleArray = colours(of) { a, b -> (a + b) / 2 }

    private fun total(of: (Sample) -> Int): DoubleArray = colours({ of(sample(it)).toDouble() }) { a, b -> a + b }

    fun means(): FrameMeans {
        val all = total { it.all }
        fun share(of: (Sample) -> Int) = total(of).also { for (i in it.indices) it[i] /= all[i] }
        val count = total { it.count }
        return FrameMeans(
            average(::mean),
            colours(::error) { a, b -> sqrt(a * a + b * b) / 2 },
            LongArray(3 * n) { count[it].toLong() },
            share { it.clipped },
            share { it.rejected },
            average(::gradient),
            DoubleArray(2 * n) { mean(4 * (it / 2) + 1 + it % 2) },
        )
    }
}

/** The file's own lens-shading correction at a patch's centre. */
private object Shading {
    /** Factors (4) for the positions of the CFA cell: the product of the gain maps that cover them. */
    fun of(photo: Mosaic, quad: DoubleArray): DoubleArray {
        val (x, y) = PatchMeans.centre(quad)
        val factors = DoubleArray(4) { 1.0 }
        for (map in photo.gainMaps) {
            if (map.list == 1 || max(map.rowPitch, map.columnPitch) > 2) {
                throw UnsupportedRaw(
                    "${photo.name} holds a lens-shading map that camssf does not apply (opcode list ${map.list}, " +
                        "every ${map.rowPitch} rows and ${map.columnPitch} columns).",
                    "Leave the samples as stored, and take a white frame.",
                )
            }
            for (cell in 0..3) {
                val plane = if (map.list == 3) "RGB".indexOf(photo.cfa[cell]) else 0
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

    /** Bilinear, down both columns first, then across; constant beyond the net's ends. */
    private fun at(map: GainMap, x: Double, y: Double, photo: Mosaic, plane: Int): Double {
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
            map.gains[(row * map.pointsH + column) * map.mapPlanes + entry].toDouble()
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

/** Whether frames of one shot were taken alike. */
private object Alike {
    /** Relative difference up to which two exposures are the same: files round them. */
    private const val SAME = 0.01

    /** Refuses a frame that was not taken with the chart photo's camera and settings. */
    fun check(chart: Mosaic, frame: Mosaic, word: String) {
        val differ = ArrayList<String>()
        if (frame.width != chart.width || frame.height != chart.height) {
            differ += "size ${frame.width} × ${frame.height} against ${chart.width} × ${chart.height}"
        }
        if (frame.cfa != chart.cfa) differ += "CFA pattern ${frame.cfa} against ${chart.cfa}"
        for ((name, theirs, ours) in listOf(
            Triple("make", frame.make, chart.make),
            Triple("model", frame.model, chart.model),
        )) {
            if (theirs.isNotEmpty() && ours.isNotEmpty() && theirs != ours) {
                differ += "camera $name '$theirs' against '$ours'"
            }
        }
        if (frame.white != chart.white) {
            differ += "white level ${short(frame.white)} against ${short(chart.white)} DN"
        } else if ((0..3).any { abs(frame.black[it] - chart.black[it]) > 0.005 * chart.white }) {
            differ += "black level ${short(frame.black.average())} against ${short(chart.black.average())} DN"
        }
        compare("exposure", frame.exposure, chart.exposure, " s")?.let { differ += it }
        compare("iso", frame.iso, chart.iso, "")?.let { differ += it }
        if (differ.isNotEmpty()) {
            throw FramesDiffer(
                "The $word frame ${frame.name} differs from the chart photo ${chart.name}: ${differ.joinToString(
                    "; ",
                )}.",
                "Take chart, white and dark frame with one camera in manual mode: same exposure time, ISO, aperture.",
            )
        }
    }

    private fun compare(name: String, theirs: Double?, ours: Double?, unit: String): String? {
        if (theirs == null || ours == null || abs(theirs - ours) <= SAME * max(theirs, ours)) return null
        return "$name ${short(theirs)}$unit against ${short(ours)}$unit"
    }
}
