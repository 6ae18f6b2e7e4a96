package org.camssf.golden

import kotlinx.serialization.json.JsonArray
import kotlinx.serialization.json.JsonElement
import kotlinx.serialization.json.JsonNull
import kotlinx.serialization.json.JsonObject
import kotlinx.serialization.json.jsonObject
import org.camssf.colour.Adapted
import org.camssf.colour.ColourCamera
import org.camssf.colour.Observer
import org.camssf.colour.Part
import org.camssf.colour.PhotoLight
import org.camssf.colour.PictureSpace
import org.camssf.colour.RawRegion
import org.camssf.colour.Reference
import org.camssf.colour.RelativeSignals
import org.camssf.colour.SkinIndex
import org.camssf.colour.SpectrumEstimator
import org.camssf.colour.StandardPicture
import org.camssf.colour.Standardiser
import org.camssf.colour.SurfaceDistance
import org.camssf.colour.SurfaceNodes
import org.camssf.colour.SurfacePrior
import org.camssf.colour.View
import org.camssf.flatten
import org.camssf.photo.LensShading
import org.camssf.photo.PhotoSource
import org.camssf.photo.Region
import org.camssf.recovery.Tensor
import org.camssf.spectra.Lamp
import kotlin.math.sqrt

/** The stages from a result document on: colour, spectrum and picture. */
internal class Colours(private val photos: Photos) {
    fun standardiser(case: Fields): Standardiser {
        val (white, raw, error) = reference(case.part("reference")!!)
        return Standardiser.of(camera(case), lamp(case.text("lamp")), white, view(case), raw, error)
    }

    /** The reference, its raw signals where they are asked, and their error. */
    private fun reference(of: Fields): Triple<Reference, DoubleArray?, Double> {
        val raw = of.findValues("raw")
        val white = Reference(raw ?: DoubleArray(3) { 1.0 }, tolerance = of.number("tolerance"))
        return Triple(white, raw, of.number("error"))
    }

    /** A lamp by its name; null where the light is unknown. */
    private fun lamp(name: String): Lamp? = if (name == "auto") null else Lamp.read(name)

    private fun view(case: Fields): View {
        val view = case.part("view")!!
        return View(
            Observer.values().single { it.word == view.text("observer") },
            Adapted.values().single { it.word == view.text("white") },
        )
    }

    fun colour(case: Fields): Map<String, Any?> {
        val standardiser = standardiser(case)
        val colours = case.rows("signals").zip(case.rows("standard_error")) { signals, error ->
            standardiser.colourOf(RelativeSignals(signals, error))
        }
        val far = colours.map { it.reach > SurfaceDistance.REACH }
        return mapOf(
            "xyz" to colours.map { it.xyz.values }, "lab" to colours.map { it.lab.values },
            "xyz_covariance" to colours.map { it.xyzCovariance.values }.flatten(),
            "lab_covariance" to colours.map { it.labCovariance.values }.flatten(),
            "parts" to Part.values().map { part -> colours.map { it.deviation(part).values } },
            "white" to standardiser.white.values, "chi_squared" to standardiser.chiSquared,
            "lamps" to standardiser.lamps.map { it.name }, "weights" to standardiser.lamps.map { it.weight },
            "far" to far,
            "reach" to colours.map { it.reach }.filterIndexed { i, _ -> far[i] },
        )
    }

    fun spectrum(case: Fields): Map<String, Any?> {
        val photos = case.parts("photos")
        val lights = photos.map { photo ->
            val (white, raw, error) = reference(photo.part("reference")!!)
            PhotoLight(lamp(photo.text("lamp")), white, raw, error)
        }
        val estimator = SpectrumEstimator.of(camera(case), lights, SurfacePrior.read(case.text("prior")), view(case))
        fun joined(name: String, i: Int) = photos.flatMap { it.rows(name)[i].asList() }.toDoubleArray()
        val spectra = photos[0].list("signals").indices.map {
            estimator.spectrumOf(RelativeSignals(joined("signals", it), joined("standard_error", it)))
        }
        return mapOf(
            "reflectance" to spectra.map { it.reflectance.values },
            "covariance_sums" to spectra.map { one ->
                one.covariance.values.toList().chunked(SurfaceNodes.SIZE) { it.sum() }
            },
            "parts" to
                Part.values().map { part -> spectra.map { one -> sqrt(one.deviation(part).sumOf { it * it }) } },
            "indices" to SkinIndex.values().map { index ->
                spectra.map { it.index(index) }.map { listOf(it.value, it.standardDeviation) }
            },
            "xyz" to spectra.map { it.xyz.values }, "lab" to spectra.map { it.lab.values },
            "xyz_covariance" to spectra.map { it.xyzCovariance.values }.flatten(),
            "lab_covariance" to spectra.map { it.labCovariance.values }.flatten(),
            "white" to estimator.white.values, "chi_squared" to estimator.chiSquared,
            "distance" to spectra.map { it.distance }, "far" to spectra.map { it.outsidePrior },
            "from_photo" to spectra.map { it.fromPhoto },
            "lamps" to estimator.lamps.map { it.names }, "weights" to estimator.lamps.map { it.weight },
        )
    }

    fun picture(case: Fields): Map<String, Any?> {
        val made = standardPicture(case)
        val pixels = ArrayList<Short>()
        val layer = ArrayList<Short>()
        made.strips { _, _, ofStrip, uncertainty ->
            pixels += ofStrip.asList()
            layer += uncertainty.asList()
        }
        val area = case.find("area")?.let { region(it) } ?: Region(0, 0, made.width, made.height)
        val half = Region(area.left / 2, area.top / 2, area.right / 2, area.bottom / 2)
        return mapOf("picture" to part(pixels, made.width, area), "uncertainty" to part(layer, made.width / 2, half))
    }

    private fun standardPicture(case: Fields): StandardPicture {
        val space = PictureSpace.of(case.text("space"))
        val shading = LensShading.of(case.text("shading"))
        val camera = camera(case)
        val lamp = lamp(case.text("lamp")) ?: Lamp.auto()
        val (photo, dark) = listOf("photo", "dark").map { photos.find(case, it) }
        val white = case.find("white")?.let { region(it) }
            ?: return StandardPicture.of(camera, lamp, PhotoSource.of(photo!!), space, shading)
        val reference = Reference(RawRegion.measure(photo!!, listOf(white), dark, shading).single(), 0.3)
        return Standardiser.of(camera, lamp, reference, View()).picture(photo, space, shading, dark)
    }

    /** A part (height, width, 3) of unsigned numbers (any, `columns`, 3). */
    private fun part(numbers: List<Short>, columns: Int, area: Region): Tensor {
        val values = DoubleArray(3 * area.width * area.height) {
            val pixel = (area.top + it / 3 / area.width) * columns + area.left + it / 3 % area.width
            (numbers[3 * pixel + it % 3].toInt() and 0xffff).toDouble()
        }
        return Tensor(values, area.height, area.width, 3)
    }

    /** The camera of a case's result, or of that of another case but for the values at some paths. */
    private fun camera(case: Fields): ColourCamera {
        val own = case["result"]
        val document = if ("case" in own.jsonObject) changed(case.part("result")!!) else own
        return ColourCamera.parse("$document")
    }

    private fun changed(of: Fields): JsonElement =
        of.find("but")?.jsonObject.orEmpty().entries.fold(of.forms.case(of.text("case"))["result"]) { json, change ->
            json.with(change.key.split('/'), change.value)
        }

    private fun JsonElement.with(path: List<String>, value: JsonElement): JsonElement {
        val key = path.firstOrNull() ?: return value
        fun inner(of: JsonElement) = of.with(path.drop(1), value)
        if (this is JsonArray) return JsonArray(mapIndexed { i, part -> if ("$i" == key) inner(part) else part })
        return JsonObject(jsonObject + (key to inner(jsonObject[key] ?: JsonNull)))
    }
}
