package org.camssf.photo

/** Which patches of which shots count. */
internal class PatchMask(private val shots: Int, private val patches: Int, private val flags: BooleanArray) {
    constructor(shots: Int, patches: Int, flag: (Int, Int) -> Boolean) :
        this(shots, patches, BooleanArray(shots * patches) { flag(it / patches, it % patches) })

    operator fun get(shot: Int, patch: Int): Boolean = flags[shot * patches + patch]

    /** 0-based patches that count in at least one shot. */
    val selected: IntArray get() = (0 until patches).filter { i -> (0 until shots).any { this[it, i] } }.toIntArray()

    /** The same patches, of one shot alone. */
    fun ofShot(shot: Int): PatchMask = PatchMask(shots, patches) { j, i -> j == shot && this[j, i] }

    /** The same patches but some, in all shots. */
    fun without(some: Collection<Int>): PatchMask = PatchMask(shots, patches) { j, i -> this[j, i] && i !in some }
}

/**
 * A number for each shot, patch and channel.
 *
 * @property values (k, n, 3) row-major; shared, not copied.
 */
internal class PatchTable(private val shots: Int, private val patches: Int, val values: DoubleArray) {
    constructor(shots: Int, patches: Int, value: (Int, Int, Int) -> Double) :
        this(shots, patches, DoubleArray(3 * shots * patches) { value(it / (3 * patches), it / 3 % patches, it % 3) })

    private fun at(shot: Int, patch: Int, channel: Int) = 3 * (shot * patches + patch) + channel

    operator fun get(shot: Int, patch: Int, channel: Int): Double = values[at(shot, patch, channel)]

    operator fun set(shot: Int, patch: Int, channel: Int, value: Double) {
        values[at(shot, patch, channel)] = value
    }

    /** Whether all three numbers of a patch are finite. */
    fun isFinite(shot: Int, patch: Int): Boolean = (0..2).all { this[shot, patch, it].isFinite() }

    /** The rows of the selected patches (t): (k, t, 3), row-major. */
    fun rows(selected: IntArray): DoubleArray =
        PatchTable(shots, selected.size) { j, i, c -> this[j, selected[i], c] }.values
}
