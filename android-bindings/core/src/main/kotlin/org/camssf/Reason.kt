package org.camssf

/**
 * Why a result is not accepted.
 *
 * @property code the error code, the same in Python and JSON.
 * @property message what is wrong.
 * @property advice what to do next.
 * @property value the number that decided, or null.
 * @property threshold the bound that it broke, or null.
 * @property key of the message in messages.json, by which an app finds its own text; empty if there is none.
 * @property arguments values of the message's placeholders: each a String, a Long or a Double. Not modifiable.
 */
public class Reason internal constructor(
    public val code: String,
    public val message: String,
    public val advice: String,
    public val value: Double?,
    public val threshold: Double?,
    internal val fatal: Boolean = false,
    public val key: String = "",
    public val arguments: Map<String, Any> = emptyMap(),
) {
    /**
     * A text of the app, in its own language, with the placeholders that the English text of this [key] has, filled in
     * as there: `{share:percent1}` is a share as per cent with one decimal.
     *
     * @throws NoSuchElementException it has a placeholder that is not among the [arguments].
     */
    public fun inWords(template: String): String = Messages.fill(template, arguments)

    /** The same where the result is refused. */
    internal fun refusing(): Reason = Reason(code, message, advice, value, threshold, true, key, arguments)

    private fun parts() = listOf(code, message, advice, value, threshold, key, arguments)

    override fun equals(other: Any?): Boolean = other is Reason && parts() == other.parts()

    override fun hashCode(): Int = parts().hashCode()

    /** Code, message and advice. */
    override fun toString(): String = "$code: $message $advice"
}
