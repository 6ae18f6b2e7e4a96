package org.camssf.photo

import org.camssf.Rows

/**
 * A lens-shading map (DNG opcode 9): gains on a grid over one or more planes or CFA positions.
 *
 * It applies to the samples (y, x) with `y = top, top + rowPitch, ... < bottom` and
 * `x = left, left + columnPitch, ... < right`, after black subtraction; the gain is interpolated between the points.
 *
 * @property list the opcode list that contains it: 1 acts before linearisation, on the stored picture; 2 on the
 *   mosaic's active area; 3 on the demosaiced picture.
 * @property area the samples it applies to.
 * @property plane first plane; a mosaic has plane 0, list 3 has R, G, B.
 * @property planes number of planes.
 * @property rowPitch step between rows.
 * @property columnPitch step between columns.
 * @property net the points and their gains.
 */
public class GainMap(
    public val list: Int,
    public val area: Region,
    public val plane: Int,
    public val planes: Int,
    public val rowPitch: Int,
    public val columnPitch: Int,
    public val net: Net,
) {
    /**
     * The points of a gain map and their gains.
     *
     * @property pointsV rows of the grid.
     * @property pointsH columns of the grid.
     * @property spacingV distance between the grid's rows, as a fraction of the picture's height.
     * @property spacingH distance between the grid's columns, as a fraction of the picture's width.
     * @property originV position of the first row, as a fraction of the picture's height.
     * @property originH position of the first column, as a fraction of the picture's width.
     * @property mapPlanes gains per point; plane i uses entry min(i, mapPlanes - 1).
     * @param gains (pointsV, pointsH, mapPlanes) row-major; copied.
     */
    public class Net(
        public val pointsV: Int,
        public val pointsH: Int,
        public val spacingV: Double,
        public val spacingH: Double,
        public val originV: Double,
        public val originH: Double,
        public val mapPlanes: Int,
        gains: FloatArray,
    ) {
        internal val sharedGains: FloatArray = gains.copyOf()

        override fun toString(): String = "Net($pointsV × $pointsH points, $mapPlanes planes)"

        /** (pointsV, pointsH, mapPlanes). */
        public val gains: Rows
            get() = Rows(DoubleArray(sharedGains.size) { sharedGains[it].toDouble() }, pointsV, pointsH, mapPlanes)
    }

    /** Rows of the grid. */
    public val pointsV: Int get() = net.pointsV

    /** Columns of the grid. */
    public val pointsH: Int get() = net.pointsH

    /** Distance between the grid's rows, as a fraction of the picture's height. */
    public val spacingV: Double get() = net.spacingV

    /** Distance between the grid's columns, as a fraction of the picture's width. */
    public val spacingH: Double get() = net.spacingH

    /** Position of the first row, as a fraction of the picture's height. */
    public val originV: Double get() = net.originV

    /** Position of the first column, as a fraction of the picture's width. */
    public val originH: Double get() = net.originH

    /** Gains per point. */
    public val mapPlanes: Int get() = net.mapPlanes

    /** (pointsV, pointsH, mapPlanes). */
    public val gains: Rows get() = net.gains

    override fun toString(): String =
        "GainMap(list=$list, plane=$plane, $area, ${net.pointsV} × ${net.pointsH} points)"
}
