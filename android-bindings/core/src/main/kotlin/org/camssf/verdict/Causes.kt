package org.camssf.verdict

import org.camssf.Reason
import org.camssf.Rules
import org.camssf.photo.MeasuredShot
import org.camssf.recovery.Choice
import org.camssf.recovery.Ssf
import org.camssf.spectra.ChartTable
import kotlin.math.abs
import kotlin.math.exp
import kotlin.math.ln

/**
 * What may have spoilt a shot, the causes weighed against each other: Python's `camssf.verdict.cause`.
 *
 * @property shot 0-based.
 * @property probability of each of [CAUSES] that is possible, of another lamp, and of none.
 * @property patch 0-based, the likeliest one if a patch is the cause.
 * @property basis name of the answer's basis.
 */
internal class Causes(
    val shot: Int,
    val probability: Map<String, Double>,
    private val patch: Int,
    private val basis: String,
) {
    /** The likeliest of [GROUPS]. */
    val group: String get() = GROUPS.maxByOrNull { (_, names) -> names.sumOf { of(it) } }!!.key

    private fun of(name: String) = probability[name] ?: 0.0

    /**
     * The reasons with the likeliest cause first, in place of those that name a cause without weighing it.
     *
     * Where an error is less likely than none and no such reason is there, the reasons stay as they are: what they say
     * is not a misfit of the signals. Processed RAW, which its noise shows, comes before any cause.
     *
     * @param one of the shot.
     */
    fun putFirst(reasons: List<Reason>, one: GoodnessOfFit, table: ChartTable, lamp: String): List<Reason> {
        val replaced = reasons.filter { it.key in BLAMED }
        if (replaced.isEmpty() && of(NONE) >= EVEN) return reasons
        val fatal = replaced.ifEmpty { reasons }.any { it.fatal }
        val (name, words) = message(one, table, lamp)
        val by = replaced.firstOrNull()
        val first = Reasons.because(name, by?.value, words + ("shot" to shot + 1), fatal, by?.threshold)
        val rest = reasons.filter { it !in replaced && it.key != first.key }
        val (seen, others) = rest.partition { it.key in SEEN }
        return seen.map { if (fatal) it.refusing() else it } + first + others
    }

    /** The reason's name, and the values of its placeholders. */
    private fun message(one: GoodnessOfFit, table: ChartTable, lamp: String): Pair<String, Map<String, Any>> {
        val amount = one.explanations.associate { it.cause.word to it.amount }
        fun size(name: String) = mapOf("amount" to abs(amount.getValue(name)))
        return when (val likeliest = group) {
            "patch" -> likeliest to mapOf("patch" to table.patches[patch])

            "tone" -> likeliest to mapOf("exponent" to 1.0 + amount.getValue(likeliest))

            "lamp" -> "rival" to mapOf("lamp" to lamp)

            "stranger" -> likeliest to mapOf("basis" to basis)

            "shadow" -> "light" to emptyMap()

            "offset" -> when {
                of("gloss") > of("veil") + of("black") -> "gloss" to emptyMap()

                // Without a dark frame.
                "black" in amount && (of("black") > of("veil") || amount.getValue("veil") < 0) ->
                    "black" to size("black")

                else -> (if (amount.getValue("veil") > 0) "veil" else "bright_dark") to size("veil")
            }

            else -> likeliest to emptyMap()
        }
    }

    companion object {
        const val NONE = "none"
        private const val LAMP = "lamp"
        private const val EVEN = 0.5

        /** In the order of the model's output `cause`. */
        val CAUSES = listOf(
            "patch", "gloss", "veil", "black", "white", "clipped", "shadow", "lights", "tone", "tint", "table",
            "stranger",
        )

        /** Causes that also change the raw white. */
        val BY_WHITE = setOf(LAMP, "tint", "white", "clipped")

        /** Causes that ask for the same advice, and those that photos cannot tell apart: another lamp or a tinted lens. */
        private val GROUPS = mapOf(
            "patch" to listOf("patch"), "offset" to listOf("gloss", "veil", "black"), "white" to listOf("white"),
            "clipped" to listOf("clipped"), "shadow" to listOf("shadow"), "lights" to listOf("lights"),
            "tone" to listOf("tone"), "lamp" to listOf(LAMP, "tint"), "table" to listOf("table"),
            "stranger" to listOf("stranger"),
        )

        /** Messages of rules 2 to 4, which name a cause without weighing it against the others. */
        private val BLAMED by lazy {
            val names =
                listOf("veil", "bright_dark", "black", "white", "light", "tone", "patch", "unexplained", "rival")
            names.map { Rules.shipped.ground(it).message }.toSet()
        }

        /**
         * The verdict that says what the light is by the signals, if another lamp comes first and one kind is likely.
         *
         * @param estimated the answer to a shot alone, from 0, as if its lamp had not been named.
         */
        fun withLight(verdict: Verdict, estimated: (Int) -> Ssf): Verdict {
            val first = verdict.reasons.firstOrNull()?.takeIf { it.key == Rules.shipped.ground("rival").message }
                ?: return verdict
            val ssf = estimated((first.arguments.getValue("shot") as Long).toInt() - 1)
            val light = ssf.lights[0].takeIf { Choice.MAKERS_OF[ssf.basis] == Light.PHONES } ?: return verdict
            val (kind, share) = light.kinds.maxByOrNull { it.value }!!
            if (share <= Rules.shipped.number("causes.likely_kind")) return verdict
            val words = first.arguments + mapOf("kind" to kind, "kelvin" to light.kelvin, "std" to light.kelvinStd)
            val told = Reasons.because("rival_kind", first.value, words, first.fatal, first.threshold)
            return Verdict(verdict.outcome, listOf(told) + verdict.reasons.drop(1), verdict.checks)
        }

        /** The patch, 0-based, that is the first reason of a verdict, if it is one. */
        fun blamedPatch(verdict: Verdict, table: ChartTable): Int? {
            val first = verdict.reasons.firstOrNull()?.takeIf { it.key == Rules.shipped.ground("patch").message }
            return first?.let { table.patches.indexOf(it.arguments.getValue("patch")) }
        }

        /**
         * The shots, from 0, that rules 2 to 4 blame; all `count` shots if they blame none by its number.
         *
         * A spoilt shot bends the common curves, so that a sound one may look as improbable.
         */
        fun blamedShots(reasons: List<Reason>, count: Int): List<Int> {
            val numbers = reasons.filter { it.key in BLAMED }.mapNotNull { it.arguments["shot"] as Long? }
            return numbers.distinct().sorted().map { it.toInt() - 1 }.ifEmpty { (0 until count).toList() }
        }

        /** Messages of rule 11: what the samples' noise shows. */
        private val SEEN by lazy {
            listOf("mixed", "demosaiced", "smoothed").map { Rules.shipped.ground(it).message }.toSet()
        }

        /** How much of its colour a chart may have lost. */
        private val FADED get() = listOf("causes.faded_small", "causes.faded_large").map { Rules.shipped.number(it) }

        /**
         * Weighs the causes of a shot.
         *
         * @param inputs of that shot alone, with the answer to it.
         * @param shot its photo. @param j its number, from 0.
         * @param rivals gains of other lamps of this shot in ln of the marginal likelihood; empty if none was tried.
         * @param witnesses causes for which another rule speaks: [BY_WHITE] for rule 5, "table" for a faded chart.
         */
        fun weigh(
            inputs: VerdictInputs,
            shot: MeasuredShot,
            j: Int,
            rivals: List<Double>,
            witnesses: Set<String>,
        ): Causes {
            val table = inputs.table
            val (evidences, ofPatches) = inputs.causeEvidences(shot, FADED.map(table::faded) + table.otherTables())
            val nats = LinkedHashMap(CAUSES.zip(evidences.toList()).toMap() + (NONE to 0.0))
            if (shot.means.white == null) nats.remove("white")
            if (rivals.isNotEmpty()) nats[LAMP] = Choice.logSum(rivals) - ln(rivals.size.toDouble())
            val odds = ln(Rules.shipped.number("causes.witness"))
            for (name in nats.keys.toList()) {
                val prior = ln(Rules.shipped.number("causes.prior_$name"))
                nats[name] = nats.getValue(name) + prior + if (name in witnesses) odds else 0.0
            }
            val total = Choice.logSum(nats.values.toList())
            val patch = ofPatches.indices.maxByOrNull { ofPatches[it] }!!
            return Causes(j, nats.mapValues { exp(it.value - total) }, patch, inputs.ssf.basis)
        }
    }
}
