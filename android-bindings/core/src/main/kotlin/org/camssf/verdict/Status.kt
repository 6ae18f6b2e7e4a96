package org.camssf.verdict

import org.camssf.Reason
import org.camssf.frozen

/**
 * How far an answer can be trusted.
 *
 * @property word the name in Python and JSON.
 */
public enum class Status(public val word: String) {
    /** Every limit holds. */
    ACCEPTED("accepted"),

    /** The curves are usable; the reasons state the doubts. */
    DOUBTFUL("doubtful"),

    /** There are no curves. */
    REFUSED("refused"),
    ;

    internal companion object {
        /** Refused if any reason is fatal, doubtful if there are other reasons, else accepted. */
        fun of(reasons: List<Reason>): Status = when {
            reasons.any { it.fatal } -> REFUSED
            reasons.isEmpty() -> ACCEPTED
            else -> DOUBTFUL
        }
    }
}

/**
 * The judgement of an answer. Safe to pass between threads.
 *
 * @property outcome accepted, doubtful or refused.
 * @property checks every number that was compared, whether its limit holds or not; empty if an earlier stage refused.
 */
public class Verdict internal constructor(
    public val outcome: Status,
    reasons: List<Reason>,
    internal val checks: List<Check> = emptyList(),
) {
    /** Empty only when accepted. */
    public val reasons: List<Reason> = reasons.frozen()

    override fun equals(other: Any?): Boolean =
        other is Verdict && outcome == other.outcome && reasons == other.reasons

    override fun hashCode(): Int = 31 * outcome.hashCode() + reasons.hashCode()

    /** The outcome and the codes of its reasons: "doubtful: glare, blurred". */
    override fun toString(): String =
        outcome.word + if (reasons.isEmpty()) "" else reasons.joinToString(prefix = ": ") { it.code }
}
