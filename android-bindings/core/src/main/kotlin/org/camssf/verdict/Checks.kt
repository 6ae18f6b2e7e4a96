package org.camssf.verdict

import org.camssf.Rules

/**
 * One number of a verdict, and the limits that it was held against, in the limit's own unit.
 *
 * @property name of the limit in rules.json, group "verdict".
 * @property shot from 1; null where it is of the capture as a whole.
 * @property value what was found.
 * @property limit beyond it the verdict is not accepted.
 * @property refuses beyond it there is no answer; null where it never refuses.
 * @property beyond "above" or "below", the side on which it breaks.
 */
internal class Check(
    val name: String,
    val shot: Int?,
    val value: Double,
    val limit: Double,
    val refuses: Double?,
    val beyond: String,
)

/** Told of every number as a rule weighs it, kept and broken alike, as Python's `camssf.verdict.checks`. */
internal class Checks {
    private val seen = LinkedHashMap<Pair<String, Int?>, Check>()

    /** In the order in which they were first told. */
    val all: List<Check> get() = seen.values.toList()

    /**
     * One number.
     *
     * @param name as in [Check].
     * @param value what is no number was not looked at.
     * @param shot whose, 0-based; null for the capture as a whole.
     * @param limit where it is not simply the rule's own.
     */
    fun note(name: String, value: Double, shot: Int? = null, limit: Double? = null) {
        if (!value.isFinite()) return
        val rules = Rules.shipped
        val rule = rules.bound("verdict.$name")
        val own = limit ?: rules.number("verdict.$name")
        val refuses = rule?.graver?.let { rules.number("verdict.$it") } ?: own.takeIf { rule?.refused == true }
        val at = shot?.plus(1)
        seen[name to at] = Check(name, at, value, own, refuses, rule?.beyond ?: "above")
    }
}
