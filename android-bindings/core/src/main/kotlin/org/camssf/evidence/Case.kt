package org.camssf.evidence

import org.camssf.curves.Ssf
import org.camssf.photo.MeasuredShot

/** T₄ with another lamp in place of a shot's own. */
internal class Rival(val shot: Int, val lamp: String, val weighted: Double)

/** The camera's white (3) under a light of power (681), as a file's colour matrix tells it. */
internal class Foretold(val light: DoubleArray, val white: DoubleArray)

/**
 * What a verdict weighs: k shots, the answer, the answer to each alone (none for one shot), the rivals, and for each shot
 * what its file foretells of its white.
 */
internal class Case(
    val told: Told,
    val shots: List<MeasuredShot>,
    val alone: List<Ssf>,
    val rivals: List<Rival>,
    val foretold: List<List<Foretold>>,
) {
    /** What is told of each shot alone, and the answer to it. */
    val single: List<Told> = shots.indices.map { j -> told.only(j, alone.getOrNull(j) ?: told.ssf) }

    /** Rules 2 and 3 of each shot alone; below three patches nothing is suspected. */
    fun each(): List<Surprise> = shots.mapIndexed { j, shot ->
        if (single[j].signals.used.count { it } < FEWEST) {
            Surprise(0.0, 0.0, FEWEST, emptyList())
        } else {
            single[j].surprise(shot.pose, shot.means.white == null)
        }
    }

    private companion object {
        const val FEWEST = 3
    }
}
