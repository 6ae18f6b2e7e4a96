package org.camssf.golden

import kotlinx.serialization.json.JsonArray
import kotlinx.serialization.json.JsonNull
import kotlinx.serialization.json.JsonObject
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
import org.camssf.colour.View
import org.camssf.flatten
import org.camssf.photo.LensShading
import org.camssf.photo.PhysicalCamera
import org.camssf.recovery.LearnedBasis
import org.camssf.spectra.Bundled
import org.camssf.spectra.Lamp
import kotlin.math.sqrt

/** The stages colour and spectrum, from a result document on, and regions, from a DNG on. */
internal class Colours(private val forms: Forms, private val photos: Photos) {
    /** As a case has it; its reference's raw signals are asked only where it says so. */
    fun standardiser(case: GoldenCase): Standardiser {
        val (white, raw, error) = reference(case["reference"].jsonObject)
        return Standardiser.of(camera(case), lamp(case.text("lamp")), white, view(case), raw, error)
    }

    /** A lamp by its name; null where the light is unknown. */
    fun lamp(name: String): Lamp? = if (name == "auto") null else Lamp.read(name)

    /** The reference, its raw signals where they are asked, and their error. */
    private fun reference(given: JsonObject): Triple<Reference, DoubleArray?, Double> {
        val raw = given.getValue("raw").takeIf { it != JsonNull }?.let { numbers(it) }
        val white = Reference(raw ?: DoubleArray(3) { 1.0 }, tolerance = number(given.getValue("tolerance"))!!)
        return Triple(white, raw, number(given.getValue("error"))!!)
    }

    fun colour(case: GoldenCase): Map<String, Any?> {
        val standardiser = standardiser(case)
        val errors = case.list("standard_error")
        val found = case.list("signals").mapIndexed { i, signals ->
            standardiser.colourOf(RelativeSignals(numbers(signals), numbers(errors[i])))
        }
        val far = found.map { it.reach > SurfaceDistance.REACH }
        return mapOf(
            "xyz" to found.map { it.xyz.values },
            "lab" to found.map { it.lab.values },
            "xyz_covariance" to found.map { it.xyzCovariance.values }.flatten(),
            "lab_covariance" to found.map { it.labCovariance.values }.flatten(),
            "parts" to Part.values().map { part -> found.map { it.deviation(part).values } },
            "white" to standardiser.white.values,
            "lamps" to standardiser.lamps.map { it.name },
            "weights" to standardiser.lamps.map { it.weight },
            "chi_squared" to standardiser.chiSquared,
            "far" to far,
            "reach" to found.map { it.reach }.filterIndexed { i, _ -> far[i] },
        )
    }

    fun spectrum(case: GoldenCase): Map<String, Any?> {
        val given = case.list("photos").map { it.jsonObject }
        val lights = given.map { photo ->
            val (white, raw, error) = reference(photo.getValue("reference").jsonObject)
            PhotoLight(lamp(photo.text("lamp")), white, raw, error)
        }
        val estimator = SpectrumEstimator.of(camera(case), lights, SurfacePrior.read(case.text("prior")), view(case))
        fun of(name: String, i: Int): DoubleArray =
            given.flatMap { numbers(it.getValue(name).jsonArray[i]).asList() }.toDoubleArray()
        val found = given[0].getValue("signals").jsonArray.indices.map {
            estimator.spectrumOf(RelativeSignals(of("signals", it), of("standard_error", it)))
        }
        return mapOf(
            "reflectance" to found.map { it.reflectance.values },
            "covariance_sums" to found.map { one ->
                one.covariance.values.toList().chunked(SurfaceNodes.SIZE) { it.sum() }
            },
            "parts" to Part.values().map { part -> found.map { one -> sqrt(one.deviation(part).sumOf { it * it }) } },
            "indices" to SkinIndex.values().map { index ->
                found.map { it.index(index) }.map { listOf(it.value, it.standardDeviation) }
            },
            "xyz" to found.map { it.xyz.values },
            "lab" to found.map { it.lab.values },
            "xyz_covariance" to found.map { it.xyzCovariance.values }.flatten(),
            "lab_covariance" to found.map { it.labCovariance.values }.flatten(),
            "white" to estimator.white.values,
            "distance" to found.map { it.distance },
            "far" to found.map { it.outsidePrior },
            "from_photo" to found.map { it.fromPhoto },
            "lamps" to estimator.lamps.map { it.names },
            "weights" to estimator.lamps.map { it.weight },
            "chi_squared" to estimator.chiSquared,
        )
    }

    private fun view(case: GoldenCase): View {
        val given = case["view"].jsonObject
        return View(
            Observer.values().single { it.word == given.text("observer") },
            Adapted.values().single { it.word == given.text("white") },
        )
    }

    /**
     * The camera of a case's result, which holds no more than the stage needs.
     *
     * @param anonymous whether photos of any camera are taken for its own.
     */
    fun camera(case: GoldenCase, anonymous: Boolean = false): ColourCamera {
        val result = result(case["result"].jsonObject)
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
            lampOf(result.getValue("shots").jsonArray[0].jsonObject),
            CameraOfCurves(make, model, PhysicalCamera()),
        ) { own ->
            val basis = LearnedBasis.of(result.text("basis"), result.text("basis_sha256"))
            val scale = number(result.getValue("prior_scale"))!!
            ColourCamera.ofCode(basis, scale, (result["code_covariance"] as? JsonArray)?.let(::numbers), values, own)
        }
    }

    /** The light of a result's shot; null if it is a file's whose power is not there. */
    private fun lampOf(shot: JsonObject): Lamp? {
        val entry = shot.getValue("lamp").jsonObject
        val name = entry.text("name")
        shot["light"]?.jsonObject?.let {
            return StoredLamp.estimated(name, numbers(it.getValue("power")), numbers(it.getValue("std")))
        }
        entry["power"]?.let {
            val tolerance = number(entry.getValue("tolerance"))!!
            return Lamp(name, Bundled.scaled(numbers(it)), tolerance, emptyList(), entry.text("source"))
        }
        return try {
            Lamp.read(name)
        } catch (_: InvalidArgument) {
            null
        }
    }

    /** A result, or that of another case, but for some fields. */
    private fun result(given: JsonObject): JsonObject {
        val other = given["case"] ?: return given
        val own = forms.case(other.jsonPrimitive.content)["result"].jsonObject
        return JsonObject(own + (given["but"] as? JsonObject).orEmpty())
    }

    fun regions(case: GoldenCase): Map<String, Any?> {
        val (photo, dark) = listOf("photo", "dark").map { photos.find(case, it) }
        val areas = case.list("areas").map { region(it) }
        val found = RawRegion.measure(photo!!, areas, dark, LensShading.of(case.text("lens_shading")))
        return mapOf("raw" to found.map { it.raw.values }, "standard_error" to found.map { it.sharedError })
    }
}
