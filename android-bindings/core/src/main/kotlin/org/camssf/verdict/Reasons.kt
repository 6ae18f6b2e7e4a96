package org.camssf.verdict

import org.camssf.Messages
import org.camssf.Reason
import org.camssf.Refusal
import org.camssf.Rules

/** Creates reasons with the limits of rules.json and the texts of messages.json. */
internal object Reasons {
    /**
     * Creates the reason of that name.
     *
     * @param name in rules.json.
     * @param value the number that decided; null if none did alone.
     * @param words values of the placeholders of its message and advice.
     * @param fatal whether the number passed the limit that refuses.
     * @param threshold the bound that was broken, if it is not the rule's own limit.
     */
    fun because(
        name: String,
        value: Double?,
        words: Map<String, Any>,
        fatal: Boolean = false,
        threshold: Double? = null,
    ): Reason {
        val ground = Rules.shipped.ground(name)
        val limit = if (fatal) ground.limits.last() else ground.limits.first()
        val bound = threshold ?: value?.let { Rules.shipped.number("verdict.$limit") }
        return Messages.reason(ground.message, words, value, bound, fatal)
    }

    /** The error that a refused verdict raises: that of its first fatal reason. */
    fun refusal(verdict: Verdict): Refusal = Refusal.of(verdict.reasons.first { it.fatal })
}
