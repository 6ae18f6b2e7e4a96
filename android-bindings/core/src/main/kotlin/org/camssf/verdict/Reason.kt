package org.camssf.verdict

/**
 * Why a result is not accepted.
 *
 * @property code the error code, the same in Python and JSON.
 * @property message what is wrong.
 * @property advice what to do next.
 * @property value the number that decided, or null.
 * @property threshold the bound that it broke, or null.
 */
public class Reason internal constructor(
    public val code: String,
    public val message: String,
    public val advice: String,
    public val value: Double?,
    public val threshold: Double?,
    internal val fatal: Boolean = false,
) {
    private fun parts() = listOf(code, message, advice, value, threshold)

    override fun equals(other: Any?): Boolean = other is Reason && parts() == other.parts()

    override fun hashCode(): Int = parts().hashCode()

    /** Code, message and advice. */
    override fun toString(): String = "$code: $message $advice"
}
