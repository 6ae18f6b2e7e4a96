package org.camssf.verdict

import org.camssf.frozen

/**
 * How far an answer can be trusted.
 *
 * @property word the same in Python and JSON.
 */
public enum class Status(public val word: String) {
    /** Nothing speaks against it. */
    ACCEPTED("accepted"),

    /** Usable, with reasons. */
    DOUBTFUL("doubtful"),

    /** No curves. */
    REFUSED("refused"),
    ;

    internal companion object {
        /** Refused by one fatal reason, doubtful by any other. */
        fun of(reasons: List<Reason>): Status = when {
            reasons.any { it.fatal } -> REFUSED
            reasons.isEmpty() -> ACCEPTED
            else -> DOUBTFUL
        }
    }
}

/**
 * What the evidence says. Safe to pass between threads.
 *
 * @property outcome accepted, doubtful or refused.
 * @property checks every number that was looked at, whether it held or not; empty where a stage refused before.
 */
public class Verdict internal constructor(
    public val outcome: Status,
    reasons: List<Reason>,
    internal val checks: List<Check> = emptyList(),
) {
    /** Empty only when accepted. */
    public val reasons: List<Reason> = reasons.frozen()
}
