package org.camssf.verdict

import org.camssf.Rules

/**
 * One number of a verdict and its limits, in the unit of the limit.
 *
 * @property name of the limit in rules.json, group "verdict".
 * @property shot from 1; null for the capture as a whole.
 * @property value the measured number.
 * @property limit beyond it the verdict is not accepted.
 * @property refuses beyond it the verdict is refused; null if this number never refuses.
 * @property beyond "above" or "below", the side on which the limit is broken.
 */
internal class Check(
    val name: String,
    val shot: Int?,
    val value: Double,
    val limit: Double,
    val refuses: Double?,
    val beyond: String,
)

/**
 * Collects every number that the rules compare, whether its limit holds or not, as Python's `camssf.verdict.reasons`.
 */
internal class Checks {
    private val seen = LinkedHashMap<Pair<String, Int?>, Check>()

    /** In the order in which they were first recorded. */
    val all: List<Check> get() = seen.values.toList()

    /**
     * Records one number; a later one of the same name and shot replaces it.
     *
     * @param name as in [Check].
     * @param value the number; ignored if it is not finite.
     * @param shot from 0; null for the capture as a whole.
     * @param limit replaces the rule's own limit; `refuses` the one beyond which the verdict is refused.
     */
    fun note(name: String, value: Double, shot: Int? = null, limit: Double? = null, refuses: Double? = null) {
        if (!value.isFinite()) return
        val rules = Rules.shipped
        val rule = rules.bound("verdict.$name")
        val own = limit ?: rules.number("verdict.$name")
        val gravest =
            refuses ?: rule?.graver?.let { rules.number("verdict.$it") } ?: own.takeIf { rule?.refused == true }
        val at = shot?.plus(1)
        seen[name to at] = Check(name, at, value, own, gravest, rule?.beyond ?: "above")
    }
}
