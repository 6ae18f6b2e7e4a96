package org.camssf.finder

import org.camssf.photo.Corners
import org.camssf.photo.Homography
import org.camssf.photo.Point
import org.camssf.spectra.ChartTable
import kotlin.math.min

/**
 * Finds the chart in a small picture: its corners, orientation and confidence.
 *
 * Python's `camssf.photo.find` has the same algorithm; docs/finder.md describes it. A finder reuses its buffers from
 * picture to picture, so use one finder per thread, not the main one. It holds nothing that must be closed.
 *
 * ```kotlin
 * fun corners(luma: ByteBuffer, width: Int, height: Int): Corners? =
 *     ChartFinder().find(Picture.luma(Plane(luma, width), width, height)).candidate?.corners
 * ```
 */
public class ChartFinder private constructor(private val kinds: List<ChartKind>) {
    /** A finder of the shipped charts. */
    public constructor() : this(listOf(ChartKind.CLASSIC_24, ChartKind.SG_140))

    /** A finder of this chart alone, which may have a layout of the user's own. */
    public constructor(chart: ChartTable) : this(listOf(ChartKind.of(chart)))

    private val limits = FinderFile.limits
    private val whole = Codes()
    private val half = Codes()
    private val blobs = Blobs()
    private val lattices = Lattices(blobs)
    private val orientation = Orientation(blobs)

    /**
     * Finds charts in the picture; if there is none, in the picture at half its size.
     *
     * @param picture of any size; if its longer side exceeds 960 px, it is first reduced by whole-number blocks. It
     *   is read before this returns.
     * @return the charts, best first, and remarks about the search.
     */
    public fun find(picture: Picture): Found {
        whole.read(picture)
        var candidates = look(whole)
        if (candidates.isEmpty() && min(whole.width, whole.height) >= 2 * limits.smallest) {
            half.halve(whole)
            candidates = look(half)
        }
        val findings = LinkedHashSet<Finding>()
        if (candidates.isEmpty()) findings += Finding.NONE
        if (candidates.isNotEmpty() && candidates[0].mirrored) findings += Finding.MIRRORED
        if (candidates.size > 1) findings += Finding.TWO_CHARTS
        return Found(candidates, findings)
    }

    private fun look(codes: Codes): List<Candidate> {
        blobs.find(codes)
        val accept = if (codes.channels == 3) limits.accept else limits.acceptLuma
        val candidates = ArrayList<Candidate>()
        for (lattice in lattices.find().take(limits.mostLattices)) {
            var best: Placement? = null
            for (kind in kinds) {
                val placement = orientation.orient(codes, lattice, kind) ?: continue
                if (placement.score >= accept && placement.score > (best?.score ?: -2.0)) best = placement
            }
            if (best == null) continue
            val (map, seen) = orientation.fit(lattice, best) ?: continue
            candidates += candidate(codes, map, best, seen)
        }
        return apart(candidates.sortedBy { -it.confidence })
    }

    private fun candidate(codes: Codes, map: Homography, placement: Placement, seen: Int): Candidate {
        val kind = placement.kind
        val left = -kind.shape.sideX / 2
        val top = -kind.shape.sideY / 2
        val right = kind.columns - 1 - left
        val bottom = kind.rows - 1 - top

        fun point(u: Double, v: Double): Point =
            Point(codes.toSource(map.x(u, v), 0), codes.toSource(map.y(u, v), 1))
        return Candidate(
            Corners(point(left, top), point(right, top), point(right, bottom), point(left, bottom)),
            kind,
            placement.mirrored,
            min(placement.score, 1.0),
            List(kind.columns * kind.rows) {
                point((it % kind.columns).toDouble(), (it / kind.columns).toDouble())
            },
            seen,
        )
    }

    /** Drops candidates that overlap a better one. */
    private fun apart(candidates: List<Candidate>): List<Candidate> {
        val kept = ArrayList<Candidate>()
        for (candidate in candidates) if (kept.none { overlap(candidate, it) }) kept += candidate
        return kept
    }

    /** True if a patch of one is too near to a patch of the other. */
    private fun overlap(a: Candidate, b: Candidate): Boolean {
        val stepX = b.patches[1].x - b.patches[0].x
        val stepY = b.patches[1].y - b.patches[0].y
        val near = limits.apart * limits.apart * (stepX * stepX + stepY * stepY)
        return a.patches.any { p ->
            b.patches.any { q -> (p.x - q.x) * (p.x - q.x) + (p.y - q.y) * (p.y - q.y) < near }
        }
    }
}
