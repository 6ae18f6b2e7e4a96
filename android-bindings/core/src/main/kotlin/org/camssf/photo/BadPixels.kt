package org.camssf.photo

import org.camssf.Rows
import org.camssf.frozen

/**
 * Samples that the file declares as bad (DNG opcodes 4 and 5).
 *
 * @property list the opcode list that contains it: 1 refers to the stored picture, 2 to the active area.
 * @property constant opcode 4: every sample with exactly this value is bad; null for opcode 5.
 * @param points opcode 5: (n, 2) row and column of single samples; empty for opcode 4; copied.
 * @param areas opcode 5: rectangles; copied.
 */
public class BadPixels(
    public val list: Int,
    public val constant: Int?,
    points: IntArray,
    areas: List<Region>,
) {
    /** Opcode 5: (n, 2) row and column of single samples; empty for opcode 4. */
    public val points: Rows = Rows(DoubleArray(points.size) { points[it].toDouble() }, points.size / 2, 2)

    /** Opcode 5: rectangles. */
    public val areas: List<Region> = areas.frozen()

    override fun toString(): String =
        "BadPixels(list=$list, constant=$constant, ${this.points.size / 2} points, ${areas.size} areas)"
}
