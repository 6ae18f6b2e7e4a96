package org.camssf

import org.camssf.json.JsonText
import org.camssf.json.Members
import org.camssf.json.NotJson
import org.camssf.json.members

/**
 * All thresholds, the rival lamps, makers' names and the limits of the verdict's reasons, from rules.json. Python reads
 * the same file, so that no number is duplicated. docs/verdict.md describes it.
 *
 * @property rivals lamps tried in place of the named one.
 * @property makers for each basis, beginnings of makers' names that make it more probable, in lower case.
 */
internal class Rules private constructor(
    private val numbers: Map<String, String>,
    private val bounds: Map<String, Bound>,
    val rivals: List<String>,
    val makers: Map<String, List<String>>,
    private val reasons: Map<String, Ground>,
) {
    /** A number by group and word, for example "verdict.goodness_of_fit". */
    fun number(name: String): Double = numbers.getValue(name).toDouble()

    /**
     * A whole number by group and word.
     *
     * @throws InvalidArgument it is not a whole number.
     */
    fun whole(name: String): Int =
        numbers.getValue(name).toIntOrNull() ?: throw damaged("$name is ${numbers[name]}, which is no whole number")

    /** The bound of the verdict with this group and word; null if the number is not a bound. */
    fun bound(name: String): Bound? = bounds[name]

    /** What the reason of that name says and what decides. */
    fun ground(name: String): Ground = reasons.getValue(name)

    /**
     * How a bound of the verdict decides.
     *
     * @property refused whether a verdict beyond it is refused; otherwise it is doubtful.
     * @property beyond "above" or "below", the side on which the bound is broken.
     * @property graver for a doubtful bound, the name of the bound on the same quantity that refuses, or null.
     */
    class Bound(val refused: Boolean, val beyond: String, val graver: String?)

    /**
     * A reason of the verdict.
     *
     * @property message key of its texts in messages.json.
     * @property limits names of the numbers that decide: the doubtful one, then the refusing one if it exists.
     */
    class Ground(val message: String, val limits: List<String>)

    companion object {
        private const val FORMAT = "camssf-rules/1"
        private val ENTRY = setOf("value", "unit", "what", "why")

        /**
         * The rules that are shipped with this app.
         *
         * @throws InvalidArgument the file is missing or damaged.
         */
        val shipped: Rules by lazy { parse(Shipped.text("rules.json")) }

        /**
         * Parses the file's text; unknown and missing keys are errors.
         *
         * @throws InvalidArgument the text is not valid.
         */
        fun parse(text: String): Rules {
            val parsed = try {
                JsonText.parse(text)
            } catch (error: NotJson) {
                throw damaged("it is no JSON: ${error.message}")
            }
            val file = record("the file", parsed, setOf("format", "numbers", "rivals", "makers", "reasons"))
            val format = text("format", file.getValue("format"))
            if (format != FORMAT) throw damaged("it calls itself $format instead of $FORMAT")
            val numbers = HashMap<String, String>()
            val bounds = HashMap<String, Bound>()
            for ((group, entries) in record("numbers", file.getValue("numbers"))) {
                for ((word, entry) in record(group, entries)) {
                    val name = "$group.$word"
                    val known = record(name, entry, ENTRY, setOf("makes", "beyond", "refuses"))
                    numbers[name] = number(name, known.getValue("value"))
                    bound(name, known)?.let { bounds[name] = it }
                }
            }
            for ((name, bound) in bounds) {
                val graver = "${name.substringBefore('.')}.${bound.graver ?: continue}"
                if (bound.refused || bounds[graver]?.refused != true) throw damaged("$name refuses by $graver")
            }
            val reasons = record("reasons", file.getValue("reasons")).mapValues { (name, entry) ->
                ground(name, record(name, entry, setOf("message", "limits")), numbers)
            }
            val makers = record("makers", file.getValue("makers")).mapValues { (basis, names) ->
                different("makers, $basis", names)
            }
            return Rules(numbers, bounds, different("rivals", file.getValue("rivals")), makers, reasons)
        }

        private fun ground(name: String, entry: Members, numbers: Map<String, String>): Ground {
            val limits = texts("limits of $name", entry.getValue("limits"))
            val unknown = limits.filter { "verdict.$it" !in numbers }
            if (unknown.isNotEmpty()) throw damaged("$name has the limits $unknown, which no number is")
            val key = text("message of $name", entry.getValue("message"))
            if (key !in Messages.keys) throw damaged("$name has the message $key, which messages.json lacks")
            return Ground(key, limits)
        }

        private fun bound(name: String, entry: Members): Bound? {
            val (makes, beyond, refuses) = listOf("makes", "beyond", "refuses").map { key ->
                entry[key]?.let { text("$key of $name", it) }
            }
            if (makes == null && beyond == null && refuses == null) return null
            if (makes !in setOf("doubtful", "refused") || beyond == null || beyond !in setOf("above", "below")) {
                throw damaged("$name makes $makes $beyond")
            }
            return Bound(makes == "refused", beyond, refuses)
        }

        private fun number(name: String, value: Any?): String {
            val number = (value as? Number)?.toDouble() ?: Double.NaN
            if (!number.isFinite() || number == 0.0) throw damaged("$name is $value instead of a number other than 0")
            return value.toString()
        }

        private fun text(where: String, value: Any?): String =
            (value as? String)?.ifEmpty { null } ?: throw damaged("$where is no text")

        private fun texts(where: String, value: Any?): List<String> =
            (value as? List<*>)?.takeIf { it.isNotEmpty() }?.map { text(where, it) }
                ?: throw damaged("$where is no list")

        private fun different(where: String, value: Any?): List<String> =
            texts(where, value).also { if (it.toSet().size < it.size) throw damaged("$where names one twice") }

        private fun record(where: String, value: Any?): Members =
            if (value is Map<*, *>) members(value) else throw damaged("$where is no object")

        private fun record(
            where: String,
            value: Any?,
            needed: Set<String>,
            allowed: Set<String> = emptySet(),
        ): Members {
            val found = record(where, value)
            val odd = (found.keys - needed - allowed) + (needed - found.keys)
            if (odd.isNotEmpty()) throw damaged("$where has unknown or missing keys: ${odd.joinToString()}")
            return found
        }

        private fun damaged(what: String) =
            InvalidArgument("The rules of this installation cannot be read: $what.", Shipped.ADVICE)
    }
}
