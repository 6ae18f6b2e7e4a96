package org.camssf.guide

import org.camssf.finder.Candidate
import org.camssf.photo.Corners
import kotlin.math.hypot

/** Measures how fast the chart's corners move over the last tenth of a second. */
internal class Motion {
    private class Past(val time: Long, val corners: Corners)

    private val past = ArrayDeque<Past>()

    fun forget() = past.clear()

    /**
     * Speed of the fastest corner, pitches per second; null in the first frame and after a pause.
     *
     * @param time ns, from any clock.
     * @param pitch px.
     */
    fun speed(candidate: Candidate, time: Long, pitch: Double): Double? {
        while (past.isNotEmpty() && seconds(past.first().time, time).let { it > Limits.PAUSE || it <= 0 }) {
            past.removeFirst()
        }
        while (past.size > 1 && seconds(past[1].time, time) >= Limits.SPAN) past.removeFirst()
        val before = past.firstOrNull()
        past.addLast(Past(time, candidate.corners))
        if (before == null) return null
        val far = before.corners.points.zip(candidate.corners.points) { a, b -> hypot(b.x - a.x, b.y - a.y) }.max()
        return far / pitch / seconds(before.time, time)
    }

    private fun seconds(from: Long, to: Long) = (to - from) / 1e9
}
