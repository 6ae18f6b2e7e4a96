package org.camssf.golden

import kotlinx.serialization.json.JsonArray
import kotlinx.serialization.json.JsonElement
import kotlinx.serialization.json.contentOrNull
import kotlinx.serialization.json.int
import kotlinx.serialization.json.jsonArray
import kotlinx.serialization.json.jsonObject
import kotlinx.serialization.json.jsonPrimitive
import org.camssf.colour.PictureSpace
import org.camssf.colour.RawRegion
import org.camssf.colour.Reference
import org.camssf.colour.StandardPicture
import org.camssf.colour.Standardiser
import org.camssf.colour.View
import org.camssf.photo.LensShading
import org.camssf.photo.PhotoSource
import org.camssf.photo.Region
import org.camssf.recovery.Tensor
import org.camssf.spectra.Lamp

/** The stage picture, from a DNG on. */
internal class Pictures(private val colours: Colours, private val photos: Photos) {
    fun picture(case: GoldenCase): Map<String, Any?> {
        val made = made(case)
        val pixels = ArrayList<Short>()
        val layer = ArrayList<Short>()
        made.strips { _, _, ofStrip, uncertainty ->
            pixels += ofStrip.asList()
            layer += uncertainty.asList()
        }
        val area = (case.inputs.getValue("area") as? JsonArray)?.let { region(it) }
            ?: Region(0, 0, made.width, made.height)
        val half = Region(area.left / 2, area.top / 2, area.right / 2, area.bottom / 2)
        return mapOf("picture" to part(pixels, made.width, area), "uncertainty" to part(layer, made.width / 2, half))
    }

    private fun made(case: GoldenCase): StandardPicture {
        val space = PictureSpace.of(case.inputs.text("space"))
        val shading = LensShading.of(case.inputs.text("shading"))
        // The photos are by other cameras than the result.
        val camera = colours.camera(colours.result(case.inputs.getValue("result").jsonObject), anonymous = true)
        val lamp = case.inputs.text("lamp").let { if (it == "auto") Lamp.auto() else Lamp.read(it) }
        val photo = photos.read(case.inputs.text("photo"))
        val dark = case.inputs["dark"]?.jsonPrimitive?.contentOrNull?.let { photos.read(it) }
        val white = (case.inputs.getValue("white") as? JsonArray)?.let { region(it) }
            ?: return StandardPicture.of(camera, lamp, PhotoSource.of(photo), space, shading)
        val region = RawRegion.measure(photo, listOf(white), dark, shading).single()
        val reference = Reference(region, REFLECTANCE)
        return Standardiser.of(camera, lamp, reference, View()).picture(photo, space, shading, dark)
    }

    /** Of x, y, width and height. */
    private fun region(of: JsonElement): Region {
        val (x, y, width, height) = of.jsonArray.map { it.jsonPrimitive.int }
        return Region(x, y, x + width, y + height)
    }

    /** A part (height, width, 3) of unsigned numbers (any, `columns`, 3). */
    private fun part(numbers: List<Short>, columns: Int, area: Region): Tensor {
        val values = DoubleArray(3 * area.width * area.height) {
            val pixel = (area.top + it / 3 / area.width) * columns + area.left + it / 3 % area.width
            (numbers[3 * pixel + it % 3].toInt() and 0xffff).toDouble()
        }
        return Tensor(values, area.height, area.width, 3)
    }

    private companion object {
        /** Of the white surface in the cases' photo. */
        const val REFLECTANCE = 0.3
    }
}
