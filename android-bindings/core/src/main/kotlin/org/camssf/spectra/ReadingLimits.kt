package org.camssf.spectra

import org.camssf.json.Members
import org.camssf.json.number
import org.camssf.json.numbers
import org.camssf.json.part
import org.camssf.json.whole

/** Limits of what is read, by their names in spectra.json; Python's `camssf.spectra.limits` says what they mean. */
internal class ReadingLimits(private val json: Members) {
    val smallestPhoto = json.whole("smallest_photo")
    val largestFile = json.whole("largest_file")
    val preamble = json.whole("preamble")
    val fewestInHeader = json.whole("fewest_in_header")
    val fewestLabelled = json.whole("fewest_labelled")
    val sample = json.whole("sample")
    val longestCell = json.whole("longest_cell")
    val longestQuote = json.whole("longest_quote")
    val named = range("named")
    val rounded = json.number("rounded")
    val largestDeviation = json.number("largest_deviation")
    val nanometres = range("nanometres")
    val angstroms = range("angstroms")
    val otherUnits = json.part("other_units").let { units -> units.mapValues { range(it.key, units) } }
    val covered = range("covered")
    val fewestWavelengths = json.whole("fewest_wavelengths")
    val widestStep = json.number("widest_step")
    val smallestStep = json.number("smallest_step")
    val planck = range("planck", json.part("temperatures"))
    val daylight = range("daylight", json.part("temperatures"))
    val namedLamp = json.number("named_lamp")
    val measuredLamp = json.number("measured_lamp")
    val noiseBelowZero = json.number("noise_below_zero")
    val dimmest = json.number("dimmest")
    val largestLampTolerance = json.number("largest_lamp_tolerance")
    val largestKelvinTolerance = json.number("largest_kelvin_tolerance")
    val publicChart = json.number("public_chart")
    val measuredChart = json.number("measured_chart")
    val largestChartTolerance = json.number("largest_chart_tolerance")
    val percent = json.number("percent")
    val largestReflectance = json.number("largest_reflectance")
    val card = range("card")
    val reference = range("reference")
    val neutral = range("neutral")
    val uneven = json.number("uneven")
    val asWhite = json.number("as_white")
    val otherOrder = json.number("other_order")
    val sides = whole("sides")
    val patches = whole("patches")
    val narrowest = json.number("narrowest")
    val longestName = json.whole("longest_name")

    private fun range(name: String, of: Members = json) = of.numbers(name).let { (least, most) -> least..most }

    private fun whole(name: String) = range(name).let { it.start.toInt()..it.endInclusive.toInt() }
}
