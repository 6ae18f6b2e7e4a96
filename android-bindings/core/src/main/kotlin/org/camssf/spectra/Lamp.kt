package org.camssf.spectra

import org.camssf.Curve
import org.camssf.Grid
import org.camssf.InvalidArgument
import org.camssf.LampUnfit
import org.camssf.Refusal
import org.camssf.Rules
import org.camssf.frozen
import org.camssf.json.number
import org.camssf.json.part
import org.camssf.json.range
import org.camssf.short
import kotlin.math.hypot
import kotlin.math.ln

/**
 * The relative spectral power distribution of a shot's light, or an unnamed light ([auto]). Safe to pass between
 * threads.
 *
 * @param given (681) relative power; null for an unnamed light.
 * @property name as given.
 * @property tolerance one standard deviation of its smooth relative error, 1 (0.02 = 2 %); NaN for an unnamed light.
 * @property source its table, formula or file, in words for the report.
 * @property file name and SHA-256 of its file, or null.
 * @property toleranceKelvin one standard deviation of its colour temperature, K, part of [modes]; null if not given.
 * @property lamps what the light may be: of an unnamed light lamps known only by kind, of one called by name the table
 *   of that name, then lamps of its kind; empty for a lamp that is taken as said.
 */
public class Lamp internal constructor(
    public val name: String,
    private val given: DoubleArray?,
    public val tolerance: Double,
    internal val sharedModes: List<DoubleArray>,
    public val source: String,
    public val file: SourceFile? = null,
    public val toleranceKelvin: Double? = null,
    internal val lamps: List<Lamp> = emptyList(),
    /** ln of the prior probability of each of [lamps]. */
    internal val logPrior: List<Double> = emptyList(),
) {
    override fun toString(): String = if (unnamed) "Lamp($name)" else "Lamp($name, tolerance=${short(tolerance)})"

    /** True for an unnamed light, which has no spectrum, only possible kinds. */
    public val unnamed: Boolean get() = given == null

    /** Whether the light may be one of several lamps: it was not named, or by a name only. */
    internal val uncertain: Boolean get() = lamps.isNotEmpty()

    /** The lamp as it was called: the table of a name, the one lamp of a kind. */
    internal fun asSaid(): Lamp = Lamp(name, sharedValues, tolerance, sharedModes, source, file, toleranceKelvin)

    internal val sharedValues: DoubleArray get() = given ?: throw nameless()

    /**
     * Relative power, any scale, none negative.
     *
     * @throws InvalidArgument the light is unnamed.
     */
    public val values: Curve get() = Curve(sharedValues)

    /** Directions of the relative error of L, each one standard deviation long. */
    public val modes: List<Curve> by lazy { sharedModes.map { Curve(it) }.frozen() }

    /** The same lamp, whatever file it is from. */
    internal fun withoutFile(): Lamp =
        Lamp(name, given, tolerance, sharedModes, source, null, toleranceKelvin, lamps, logPrior)

    /** The same lamp with another power (681). */
    internal fun withPower(power: DoubleArray): Lamp =
        Lamp(name, power, tolerance, sharedModes, source, file, toleranceKelvin, lamps, logPrior)

    /** The same light with these possible lamps. */
    internal fun withLamps(lamps: List<Lamp>, logPrior: List<Double>): Lamp =
        Lamp(name, given, tolerance, sharedModes, source, file, toleranceKelvin, lamps, logPrior)

    /**
     * Returns the lamp with another tolerance: `2%`, `300K`, or both, `300K,1%`.
     *
     * A percentage replaces the lamp's smooth tolerance. A temperature adds a mode: the change of ln L over that many
     * kelvin at the lamp's own temperature. Both are one standard deviation.
     *
     * @throws InvalidArgument invalid text, a temperature for a lamp without a colour temperature, or an unnamed
     *   light.
     */
    public fun withTolerance(text: String): Lamp = text.split(",").map {
        it.trim()
    }.filter { it.isNotEmpty() }.fold(this) { lamp, part -> lamp.tolerating(part) }

    private fun tolerating(part: String): Lamp {
        if (unnamed) {
            throw InvalidArgument(
                "A light that is not named has no tolerance.",
                "Leave the tolerance out, or name the lamp.",
            )
        }
        val number = Regex("""([0-9]+(?:\.[0-9]+)?) ?(%|k)""").matchEntire(part.lowercase())
            ?: throw InvalidArgument("'$part' is not a lamp tolerance.", "Write 2%, 300K, or 300K,2%.")
        val size = number.groupValues[1].toDouble()
        if (number.groupValues[2] == "%") {
            if (size > 100 * Bundled.limits.number("largest_lamp_tolerance")) {
                throw InvalidArgument(
                    "A lamp known to ${short(size)} % is not known.",
                    "Name the kind of lamp, or measure its spectrum.",
                )
            }
            return Lamp(name, sharedValues, size / 100.0, sharedModes, source, file, toleranceKelvin)
        }
        val (formula, kelvin) = temperature()
        if (!(0 < size && size < Bundled.limits.number("largest_kelvin_tolerance") * kelvin)) {
            throw InvalidArgument(
                "${short(size)} K is too large a tolerance for a lamp of ${short(kelvin)} K.",
                "Give less than a quarter of it.",
            )
        }
        val modes = sharedModes + Bundled.temperatureMode(formula, kelvin, size)
        val total = hypot(toleranceKelvin ?: 0.0, size)
        return Lamp(name, sharedValues, tolerance, modes, "$source, ± ${short(size)} K", file, total)
    }

    private fun temperature(): Pair<(Double) -> DoubleArray, Double> {
        kelvinOf(name)?.let { return ::planck to it.toDouble() }
        daylightOf(name)?.let { return ::daylight to it.toDouble() }
        val cie = cieName(name)
        val kelvin = Bundled.kelvin[cie] ?: throw InvalidArgument(
            "The lamp '$name' has no temperature to be off in.",
            "Give its tolerance in percent; kelvins suit A, D50 to D75, 3000K or D:5500.",
        )
        return (if (cie == "A") ::planck else ::daylight) to kelvin
    }

    public companion object {
        private const val MENU =
            "Lamps: daylight B C D50 D55 D60 D65 D75, behind a window ID50 ID65, or D:5500 for any colour " +
                "temperature; bulb A, or 2856K for any temperature; fluorescent FL1 to FL12, FL3.1 to FL3.15; " +
                "discharge HP1 to HP5; LED-B1 to LED-B5, LED-BH1, LED-RGB1, LED-V1, LED-V2; not known but by " +
                "kind: daylight, bulb, white-led, fluorescent; flat E, equal-energy (the paper's assumption); " +
                "a measured spectrum by Lamp.parse; Lamp.torch(); or Lamp.auto() for a phone's photo under " +
                "whatever light."

        /** Ends of [Grid], nm. */
        private const val FIRST = 380.0
        private const val LAST = 720.0

        /** The name of an unnamed light. */
        internal const val AUTO = "auto"

        /** The name of a phone's torch. */
        internal const val TORCH = "torch"

        /** Names of unnamed lights. */
        internal val UNNAMED = listOf(AUTO, TORCH)

        /**
         * An unnamed light, for photos taken with a phone. The calibration infers its kind (daylight, bulb, white LED
         * or fluorescent) from the signals and returns it in [org.camssf.recovery.Ssf.lights]. A camera that may not
         * be a phone is refused with advice which lamp to name. At most three shots of a capture may have an unnamed
         * light.
         */
        @JvmStatic
        public fun auto(): Lamp {
            val kinds = Bundled.families.map { it to ln(Rules.shipped.number("lamp.$it")) }
            return Lamp(
                AUTO,
                null,
                Double.NaN,
                emptyList(),
                "not named: daylight, bulb, white LED or fluorescent, as the signals say",
                lamps = kinds.flatMap { (kind, _) -> ofKind(kind).map { it.first } },
                logPrior = kinds.flatMap { (kind, prior) -> ofKind(kind).map { prior + it.second } },
            )
        }

        /** The phone's own torch: an unnamed light whose only kind is the white LED. */
        @JvmStatic
        public fun torch(): Lamp = Lamp(
            TORCH,
            null,
            Double.NaN,
            emptyList(),
            "the phone's torch, a white LED, as the signals say",
            lamps = ofKind("white-led").map { it.first },
            logPrior = ofKind("white-led").map { it.second },
        )

        /** The lamps that a kind may be, and ln of their shares: one, or several shapes. */
        private fun ofKind(kind: String): List<Pair<Lamp, Double>> = synchronized(known) {
            known.getOrPut(kind) {
                Bundled.shapes(kind).mapIndexed { i, (shape, share) ->
                    lamp("$kind/${i + 1}", shape) to ln(share)
                }.ifEmpty { listOf(lamp(kind, Bundled.family(kind)) to 0.0) }
            }
        }

        private val known = HashMap<String, List<Pair<Lamp, Double>>>()

        private fun lamp(name: String, family: Bundled.Family) =
            Lamp(name, Bundled.scaled(family.power), family.tolerance, family.modes, family.source)

        /** The kind of a lamp that is known by its kind alone, or by a shape of its kind; null for another lamp. */
        internal fun kindOf(name: String): String? = name.substringBefore('/').takeIf { it in Bundled.families }

        /** Names of tables by their kind. */
        private val KINDS = mapOf(
            "daylight" to Regex("d[0-9]{2}|b|c|id50|id65"),
            "bulb" to Regex("a"),
            "white-led" to Regex("led-(b[0-9]|bh1|v1|v2)"),
            "fluorescent" to Regex("fl.*"),
        )

        /**
         * The kind of the lamp that a name means: of a kind itself, or of a table or formula; null if it is of none.
         */
        internal fun plainKind(name: String): String? {
            kindOf(name)?.let { return it }
            val hottest = Rules.shipped.number("lamp.hottest_bulb")
            kelvinOf(name)?.let { return if (it.toDouble() <= hottest) "bulb" else null }
            if (daylightOf(name) != null) return "daylight"
            val cie = cieName(name)?.lowercase() ?: return null
            return KINDS.entries.firstOrNull { it.value.matches(cie) }?.key
        }

        /** The lamp with what else it may be: a name is one hypothesis beside its kind. */
        private fun called(lamp: Lamp): Lamp {
            val kind = plainKind(lamp.name) ?: return lamp
            val own = ofKind(kind)
            if (lamp.name == kind) return lamp.withLamps(own.map { it.first }, own.map { it.second })
            val named = Rules.shipped.number("lamp.named")
            val priors = listOf(ln(named)) + own.map { ln(1.0 - named) + it.second }
            return lamp.withLamps(listOf(lamp) + own.map { it.first }, priors)
        }

        private fun nameless() = InvalidArgument(
            "A light that is not named has no spectrum.",
            "Only a chart's photo can tell it. $MENU",
        )

        /** Names that [read] accepts, in addition to temperatures such as `2856K` and `D:5500`. */
        @JvmStatic
        public fun names(): List<String> = Bundled.lamps.toList() + "equal-energy" + Bundled.families

        /**
         * Reads the spectral power of a lamp by name or formula, scaled to a mean of 1 on the grid. The numbers are
         * the same as those of Python's `camssf.spectra.read_lamp`.
         *
         * A CIE illuminant (`A`, `D55`, `FL2`, `LED-B3`; case, blanks and hyphens do not matter); `2856K` (Planck,
         * 1000 to 20,000 K); `D:5500` (CIE daylight, 4000 to 25,000 K); `equal-energy` (tolerance 0); a kind of lamp:
         * `daylight`, `bulb`, `white-led`, `fluorescent`. The tolerance is 2 % for a name or formula.
         *
         * A calibration takes a name as one hypothesis beside its kind: lamps sold under one name differ, and people
         * name them wrongly. With a tolerance ([withTolerance]) the lamp is taken as said, as one from [parse] is.
         *
         * `auto` is not accepted, because it has no spectrum; use [auto].
         *
         * Threads: any once an `SsfCalibrator` was opened, which loads the tables; before, any but the main one.
         *
         * @throws InvalidArgument no lamp, an unknown name, or a temperature out of range.
         */
        @JvmStatic
        public fun read(spec: String): Lamp {
            val text = spec.trim()
            val key = text.lowercase()
            if (text.isEmpty()) {
                throw InvalidArgument(
                    "The lamp is missing.",
                    "One photo cannot do without: dividing by the white frame does not cancel the lamp's spectrum, " +
                        "and no photo of a chart tells lamp from camera. $MENU",
                )
            }
            if (key in UNNAMED) throw nameless()
            if (plain(text) == "equalenergy") {
                return Lamp(text, DoubleArray(Grid.SIZE) { 1.0 }, 0.0, emptyList(), "equal energy, by definition")
            }
            if (key in Bundled.families) return called(lamp(key, Bundled.family(key)))
            val named = Bundled.limits.number("named_lamp")
            kelvinOf(text)?.let {
                val power = Bundled.scaled(planck(it.toDouble()))
                return called(Lamp(text, power, named, emptyList(), "Planck's law, $it K"))
            }
            daylightOf(text)?.let {
                val power = Bundled.scaled(daylight(it.toDouble()))
                return called(Lamp(text, power, named, emptyList(), "CIE daylight, $it K"))
            }
            val cie = cieName(text) ?: throw InvalidArgument("No lamp is called '$text'.", MENU)
            val source = "CIE illuminant $cie (colour-science)"
            return called(Lamp(text, Bundled.scaled(Bundled.illuminant(cie)), named, emptyList(), source))
        }

        /**
         * Parses a measured spectrum: a table of wavelength (nm) and power, CGATS text with one set (Argyll's `.sp`),
         * or rawtoaces' illuminant. It must cover 400 to 700 nm in steps of 20 nm at most.
         *
         * Outside its range the power is held constant, which `source` states. If its steps are finer than the
         * grid's, power is averaged over each step of the grid. Negative noise, down to 0.5 % of the peak from 380
         * to 720 nm, is set to 0. The tolerance is 1 %.
         *
         * Threads: any but the main one.
         *
         * @param name of the file, for messages and the result.
         * @throws InvalidArgument the content is not such a table.
         * @throws LampUnfit power that is negative, not finite or all zero, or a table with too small a range or too
         *   large gaps.
         */
        @JvmStatic
        public fun parse(name: String, content: ByteArray): Lamp {
            val spectrum = SpectraFile.spectrum(name, content)
            SpectraFile.checkWavelengths(spectrum.wavelengths, name, "lamp_unfit")
            // Nodes that the grid needs; a spectrometer's noise beyond them does not matter.
            val all = spectrum.wavelengths
            val from = maxOf(all.indexOfLast { it <= FIRST - Grid.STEP }, 0)
            val to = all.indexOfFirst { it >= LAST + Grid.STEP }.let { if (it < 0) all.size else it + 1 }
            val nodes = all.copyOfRange(from, to)
            val power = spectrum.values[0].copyOfRange(from, to)
            if (!power.all { it.isFinite() }) {
                throw Refusal.of("lamp_unfit.not_a_number", "file" to name)
            }
            val seen = power.filterIndexed { i, _ -> nodes[i] in FIRST..LAST }
            val peak = seen.max()
            if (peak <= 0) throw Refusal.of("lamp_unfit.no_power", "file" to name)
            val shares = DoubleArray(power.size) { power[it] / peak }
            val noise = Bundled.limits.number("noise_below_zero")
            val least = seen.min() / peak
            if (least < -noise) {
                throw Refusal.of("lamp_unfit.negative", "file" to name, value = least, threshold = -noise)
            }
            for (i in shares.indices) shares[i] = maxOf(shares[i], 0.0)
            val finest = (1 until nodes.size).minOf { nodes[it] - nodes[it - 1] }
            val fine = finest < 0.99 * Grid.STEP
            val values = if (fine) Interpolation.stepMeans(nodes, shares) else Interpolation.linear(nodes, shares)
            return Lamp(
                name,
                Bundled.scaled(values),
                Bundled.limits.number("measured_lamp"),
                emptyList(),
                "file $name${SpectraFile.held(all)}",
                SourceFile.of(name, content),
            )
        }

        private fun planck(kelvin: Double): DoubleArray {
            val possible = Bundled.limits.part("temperatures").range("planck")
            if (kelvin !in possible) {
                val ends = "${short(possible.start)}K to ${short(possible.endInclusive)}K"
                throw InvalidArgument("No lamp burns at ${short(kelvin)} K.", "Give $ends.", kelvin)
            }
            return Bundled.planck(kelvin)
        }

        private fun daylight(kelvin: Double): DoubleArray {
            val possible = Bundled.limits.part("temperatures").range("daylight")
            if (kelvin !in possible) {
                throw InvalidArgument(
                    "CIE daylight is not defined at ${short(kelvin)} K.",
                    "Give D:${short(possible.start)} to D:${short(possible.endInclusive)}; for a bulb ${short(kelvin)}K, without D.",
                    kelvin,
                )
            }
            return Bundled.daylight(kelvin)
        }

        private fun kelvinOf(text: String): String? =
            Regex("""([0-9]+(?:\.[0-9]+)?) ?k""").matchEntire(text.trim().lowercase())?.groupValues?.get(1)

        private fun daylightOf(text: String): String? =
            Regex("""d: ?([0-9]+(?:\.[0-9]+)?) ?k?""").matchEntire(text.trim().lowercase())?.groupValues?.get(1)

        private fun cieName(text: String): String? {
            val key = plain(text).removePrefix("cie").replace(Regex("^f(?=[0-9])"), "fl")
            return Bundled.lamps.firstOrNull { plain(it) == key }
        }
    }
}

/** The name in lower case without blanks, hyphens and underscores, for comparison. */
internal fun plain(name: String): String = name.lowercase().replace(Regex("[\\s_-]"), "")
