package org.camssf.recovery

/** An array of any rank, row-major; an empty shape is a single number. */
internal class Tensor(val values: DoubleArray, vararg val shape: Int) {
    init {
        require(shape.fold(1L) { size, side -> size * side } == values.size.toLong()) {
            "${values.size} numbers are no ${shape.joinToString(" × ")}"
        }
    }

    val rank: Int get() = shape.size

    fun hasShape(vararg other: Int): Boolean = shape.contentEquals(other)

    override fun toString(): String = shape.joinToString(", ", "(", ")")

    companion object {
        fun scalar(value: Double): Tensor = Tensor(doubleArrayOf(value))

        fun full(value: Double, vararg shape: Int): Tensor = Tensor(DoubleArray(shape.product()) { value }, *shape)

        /** Tensors of one shape along a new first axis. */
        fun stack(parts: List<Tensor>): Tensor {
            val size = parts[0].values.size
            val values = DoubleArray(parts.size * size)
            parts.forEachIndexed { i, part -> part.values.copyInto(values, i * size) }
            return Tensor(values, parts.size, *parts[0].shape)
        }

        private fun IntArray.product(): Int = fold(1) { size, side -> size * side }
    }
}
