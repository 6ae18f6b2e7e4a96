package org.camssf.golden

import kotlinx.serialization.json.JsonArray
import kotlinx.serialization.json.JsonElement
import kotlinx.serialization.json.JsonNull
import kotlinx.serialization.json.JsonObject
import kotlinx.serialization.json.JsonPrimitive
import kotlinx.serialization.json.contentOrNull
import kotlinx.serialization.json.double
import kotlinx.serialization.json.int
import kotlinx.serialization.json.jsonArray
import kotlinx.serialization.json.jsonObject
import kotlinx.serialization.json.jsonPrimitive
import org.camssf.InvalidArgument
import org.camssf.colour.Adapted
import org.camssf.colour.CameraOfCurves
import org.camssf.colour.ColourCamera
import org.camssf.colour.Observer
import org.camssf.colour.Part
import org.camssf.colour.PhotoLight
import org.camssf.colour.RawRegion
import org.camssf.colour.Reference
import org.camssf.colour.RelativeSignals
import org.camssf.colour.SkinIndex
import org.camssf.colour.SpectrumEstimator
import org.camssf.colour.Standardiser
import org.camssf.colour.StoredLamp
import org.camssf.colour.SurfaceDistance
import org.camssf.colour.SurfaceNodes
import org.camssf.colour.SurfacePrior
import org.camssf.colour.SurfaceSpectrum
import org.camssf.colour.View
import org.camssf.photo.LensShading
import org.camssf.photo.PhysicalCamera
import org.camssf.photo.Region
import org.camssf.recovery.LearnedBasis
import org.camssf.recovery.Tensor
import org.camssf.spectra.Bundled
import org.camssf.spectra.Lamp
import kotlin.math.sqrt

/** The stages colour and spectrum, from a result document on, and regions, from a DNG on. */
internal class Colours(private val files: GoldenFiles, private val forms: Forms, private val photos: Photos) {
    /** As a case has it; its reference's raw signals are asked only where it says so. */
    fun standardiser(case: GoldenCase): Standardiser {
        val asGiven = case.inputs.getValue("reference").jsonObject
        val raw = asGiven.getValue("raw").takeIf { it != JsonNull }?.let { forms.resolve(it).values }
        val white = Reference(raw ?: DoubleArray(3) { 1.0 }, tolerance = number(asGiven.getValue("tolerance"))!!)
        val lamp = case.inputs.text("lamp").takeIf { it != "auto" }?.let { Lamp.read(it) }
        val camera = camera(result(case.inputs.getValue("result").jsonObject))
        return Standardiser.of(camera, lamp, white, view(case), raw, number(asGiven.getValue("error"))!!)
    }

    fun colour(case: GoldenCase): Map<String, Any?> {
        fun given(name: String) = forms.resolve(case.inputs.getValue(name)).values
        val standardiser = standardiser(case)
        val (signals, errors) = given("signals") to given("standard_error")
        val m = signals.size / 3
        fun row(of: DoubleArray, i: Int) = of.copyOfRange(3 * i, 3 * i + 3)
        val found = List(m) { standardiser.colourOf(RelativeSignals(row(signals, it), row(errors, it))) }
        fun each(size: Int, of: (Int) -> DoubleArray) = DoubleArray(m * size) { of(it / size)[it % size] }
        val far = found.map { it.reach > SurfaceDistance.FARTHEST }
        val distances = found.map { it.reach }.filter { it > SurfaceDistance.FARTHEST }.toDoubleArray()
        val parts = Part.values().map { part -> each(3) { found[it].deviation(part).values } }
        return mapOf(
            "xyz" to Tensor(each(3) { found[it].xyz.values }, m, 3),
            "lab" to Tensor(each(3) { found[it].lab.values }, m, 3),
            "xyz_covariance" to Tensor(each(9) { found[it].xyzCovariance.values }, m, 3, 3),
            "lab_covariance" to Tensor(each(9) { found[it].labCovariance.values }, m, 3, 3),
            "parts" to Tensor(
                DoubleArray(parts.size * 3 * m) {
                    parts[it / (3 * m)][it % (3 * m)]
                },
                parts.size, m, 3,
            ),
            "white" to Tensor(standardiser.white.values, 3),
            "lamps" to words(standardiser.lamps.map { it.name }),
            "weights" to Tensor(standardiser.lamps.map { it.weight }.toDoubleArray(), standardiser.lamps.size),
            "chi_squared" to standardiser.chiSquared?.let { Tensor.scalar(it) },
            "far" to JsonArray(far.map { JsonPrimitive(it) }),
            "reach" to if (distances.isEmpty()) null else Tensor(distances, distances.size),
        )
    }

    fun spectrum(case: GoldenCase): Map<String, Any?> {
        val asGiven = case.inputs.getValue("photos").jsonArray.map { it.jsonObject }
        val photos = asGiven.map { photo ->
            val reference = photo.getValue("reference").jsonObject
            val raw = reference.getValue("raw").takeIf { it != JsonNull }?.let { forms.resolve(it).values }
            val tolerance = number(reference.getValue("tolerance"))!!
            val lamp = photo.text("lamp").takeIf { it != "auto" }?.let { Lamp.read(it) }
            val white = Reference(raw ?: DoubleArray(3) { 1.0 }, tolerance = tolerance)
            PhotoLight(lamp, white, raw, number(reference.getValue("error"))!!)
        }
        val camera = camera(result(case.inputs.getValue("result").jsonObject))
        val prior = SurfacePrior.read(case.inputs.text("prior"))
        val estimator = SpectrumEstimator.of(camera, photos, prior, view(case))
        fun given(name: String, i: Int): DoubleArray = asGiven.flatMap { photo ->
            forms.resolve(photo.getValue(name)).values.asList().subList(3 * i, 3 * i + 3)
        }.toDoubleArray()
        val m = asGiven[0].getValue("signals").jsonArray.size
        val found =
            List(m) { estimator.spectrumOf(RelativeSignals(given("signals", it), given("standard_error", it))) }
        fun each(size: Int, of: (SurfaceSpectrum) -> DoubleArray) =
            DoubleArray(m * size) { of(found[it / size])[it % size] }
        val n = SurfaceNodes.SIZE
        val sums = each(n) { one ->
            val covariance = one.covariance.values
            DoubleArray(n) { row -> covariance.copyOfRange(n * row, n * row + n).sum() }
        }
        val parts = Part.values().flatMap { part ->
            found.map { one -> sqrt(one.deviation(part).sumOf { it * it }) }
        }
        val indices = SkinIndex.values().flatMap { index ->
            found.map { it.index(index) }.flatMap { listOf(it.value, it.standardDeviation) }
        }
        return mapOf(
            "reflectance" to Tensor(each(n) { it.reflectance.values }, m, n),
            "covariance_sums" to Tensor(sums, m, n),
            "parts" to Tensor(parts.toDoubleArray(), Part.values().size, m),
            "indices" to Tensor(indices.toDoubleArray(), SkinIndex.values().size, m, 2),
            "xyz" to Tensor(each(3) { it.xyz.values }, m, 3),
            "lab" to Tensor(each(3) { it.lab.values }, m, 3),
            "xyz_covariance" to Tensor(each(9) { it.xyzCovariance.values }, m, 3, 3),
            "lab_covariance" to Tensor(each(9) { it.labCovariance.values }, m, 3, 3),
            "white" to Tensor(estimator.white.values, 3),
            "distance" to Tensor(each(1) { doubleArrayOf(it.distance) }, m),
            "from_photo" to Tensor(each(1) { doubleArrayOf(it.fromPhoto) }, m),
            "lamps" to JsonArray(estimator.lamps.map { words(it.names) }),
            "weights" to Tensor(estimator.lamps.map { it.weight }.toDoubleArray(), estimator.lamps.size),
            "chi_squared" to estimator.chiSquared?.let { Tensor.scalar(it) },
        )
    }

    private fun words(of: List<String>): JsonElement = JsonArray(of.map { JsonPrimitive(it) })

    private fun view(case: GoldenCase): View {
        val asGiven = case.inputs.getValue("view").jsonObject
        return View(
            Observer.values().single { it.word == asGiven.text("observer") },
            Adapted.values().single { it.word == asGiven.text("white") },
        )
    }

    /**
     * The camera of a case's result, which holds no more than the stage needs.
     *
     * @param anonymous whether photos of any camera are taken for its own.
     */
    fun camera(result: JsonObject, anonymous: Boolean = false): ColourCamera {
        if ("ssf" !in result) {
            val reason = result.getValue("verdict").jsonObject.getValue("reasons").jsonArray[0].jsonObject
            throw InvalidArgument("This result was refused: it has no curves.", reason.text("advice"))
        }
        fun curves(name: String) = (result[name] as? JsonObject)?.let { of ->
            Array(3) { numbers(of.getValue(listOf("red", "green", "blue")[it])) }
        }
        val named = result.getValue("camera").jsonObject
        val (make, model) = listOf("make", "model").map { if (anonymous) "" else named.text(it) }
        val values = curves("ssf")!!
        return ColourCamera.of(
            values,
            curves("ssf_std"),
            numbers(result.getValue("channel_gain")),
            lamp(result.getValue("shots").jsonArray[0].jsonObject),
            CameraOfCurves(make, model, PhysicalCamera()),
        ) { own ->
            val basis = LearnedBasis.of(result.text("basis"), result.text("basis_sha256"))
            val scale = result.getValue("prior_scale").jsonPrimitive.double
            ColourCamera.ofCode(basis, scale, (result["code_covariance"] as? JsonArray)?.let(::numbers), values, own)
        }
    }

    /** The light of a case's shot; null if it is a file's whose power is not there. */
    private fun lamp(shot: JsonObject): Lamp? {
        val entry = shot.getValue("lamp").jsonObject
        val name = entry.text("name")
        shot["light"]?.jsonObject?.let {
            return StoredLamp.estimated(name, numbers(it.getValue("power")), numbers(it.getValue("std")))
        }
        entry["power"]?.let {
            val tolerance = entry.getValue("tolerance").jsonPrimitive.double
            return Lamp(name, Bundled.scaled(numbers(it)), tolerance, emptyList(), entry.text("source"))
        }
        return try {
            Lamp.read(name)
        } catch (_: InvalidArgument) {
            null
        }
    }

    private fun numbers(of: JsonElement): DoubleArray = of.jsonArray.map { it.jsonPrimitive.double }.toDoubleArray()

    /** A result, or that of another case, but for some fields. */
    fun result(given: JsonObject): JsonObject {
        val other = given["case"] ?: return given
        val own = GoldenCase.read(other.jsonPrimitive.content, files).inputs.getValue("result").jsonObject
        return JsonObject(own + (given["but"] as? JsonObject).orEmpty())
    }

    fun regions(case: GoldenCase): Map<String, Any?> {
        val areas = case.inputs.getValue("areas").jsonArray.map { area ->
            val (x, y, width, height) = area.jsonArray.map { it.jsonPrimitive.int }
            Region(x, y, x + width, y + height)
        }
        val dark = case.inputs.getValue("dark").jsonPrimitive.contentOrNull?.let { photos.read(it) }
        val shading = LensShading.of(case.inputs.text("lens_shading"))
        val found = RawRegion.measure(photos.read(case.inputs.text("photo")), areas, dark, shading)
        fun all(of: (RawRegion) -> DoubleArray) = Tensor(
            DoubleArray(3 * found.size) { of(found[it / 3])[it % 3] },
            found.size,
            3,
        )
        return mapOf("raw" to all { it.raw.values }, "standard_error" to all { it.sharedError })
    }
}
