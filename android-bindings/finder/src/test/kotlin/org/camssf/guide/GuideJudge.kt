package org.camssf.guide

import org.camssf.finder.Candidate
import org.camssf.finder.ChartFinder
import org.camssf.finder.ChartKind
import org.camssf.finder.Found
import org.camssf.finder.Picture
import org.camssf.finder.Plane
import org.camssf.photo.Corners
import org.camssf.photo.Homography
import org.camssf.photo.Point
import java.io.File
import java.lang.management.ManagementFactory

/**
 * Guides through sequences of frames as they are asked for: `python -m benchmarks guide` draws and judges them. A line in:
 * width, height, frames, frames a second, eight numbers of the chart's corners for each frame, a file of I420 frames. A
 * line out: a JSON list of what was said after each frame.
 */
object GuideJudge {
    @JvmStatic
    fun main(arguments: Array<String>) {
        val focal = arguments[0].toDouble()
        val search = arguments[1] == "search"
        while (true) println(answer((readlnOrNull() ?: return).split(" ", limit = 5), focal, search))
    }

    private fun answer(asked: List<String>, focal: Double, search: Boolean): String {
        val (width, height, count) = asked.take(3).map { it.toInt() }
        val rate = asked[3].toDouble()
        val words = asked[4].split(" ", limit = 8 * count + 1)
        val numbers = words.take(8 * count).map { it.toDouble() }
        val bytes = File(words.last()).readBytes()
        val guide = CaptureGuide(focal)
        val finder = ChartFinder()
        val size = width * height * 3 / 2
        val said = (0 until count).map { frame ->
            val picture = picture(bytes.copyOfRange(frame * size, (frame + 1) * size), width, height)
            val corners = numbers.subList(8 * frame, 8 * frame + 8).toDoubleArray()
            val stated = Found(listOf(candidate(corners)), emptySet())
            val before = allocated()
            val start = THREADS.currentThreadCpuTime
            val found = if (search) finder.find(picture) else stated
            val guidance = guide.take(picture, found, (1e9 * frame / rate).toLong())
            val time = (THREADS.currentThreadCpuTime - start) / 1e6 // this thread's alone
            val garbage = allocated() - before
            val said = """"advice": "${guidance.advice}", "amount": ${guidance.amount}"""
            """{$said, "milliseconds": $time, "bytes": $garbage}"""
        }
        return said.joinToString(", ", "[", "]")
    }

    private fun picture(bytes: ByteArray, width: Int, height: Int): Picture {
        val y = width * height
        val half = width / 2
        fun colour(from: Int) = Plane(bytes.copyOfRange(from, from + half * (height / 2)), half)
        return Picture.yuv(Plane(bytes, width), colour(y), colour(y + y / 4), width, height)
    }

    /** The true corners' candidate, of a Classic's gap. */
    private fun candidate(numbers: DoubleArray): Candidate {
        val map = Homography.of(doubleArrayOf(-0.44, -0.44, 5.44, -0.44, 5.44, 3.44, -0.44, 3.44), numbers)!!
        val patches = List(24) { i -> (i % 6.0 to i / 6 + 0.0).let { (u, v) -> Point(map.x(u, v), map.y(u, v)) } }
        return Candidate(Corners.of(*numbers), ChartKind.CLASSIC_24, false, 0.95, patches, 24)
    }

    private fun allocated(): Long =
        (THREADS as com.sun.management.ThreadMXBean).getThreadAllocatedBytes(Thread.currentThread().id)

    private val THREADS = ManagementFactory.getThreadMXBean()
}
