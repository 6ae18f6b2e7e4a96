package org.camssf.golden

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
        val area = case.find("area")?.let { region(it) } ?: Region(0, 0, made.width, made.height)
        val half = Region(area.left / 2, area.top / 2, area.right / 2, area.bottom / 2)
        return mapOf("picture" to part(pixels, made.width, area), "uncertainty" to part(layer, made.width / 2, half))
    }

    private fun made(case: GoldenCase): StandardPicture {
        val space = PictureSpace.of(case.text("space"))
        val shading = LensShading.of(case.text("shading"))
        // The photos are by other cameras than the result.
        val camera = colours.camera(case, anonymous = true)
        val lamp = colours.lamp(case.text("lamp")) ?: Lamp.auto()
        val photo = photos.find(case, "photo")!!
        val dark = photos.find(case, "dark")
        val white = case.find("white")?.let { region(it) }
            ?: return StandardPicture.of(camera, lamp, PhotoSource.of(photo), space, shading)
        val region = RawRegion.measure(photo, listOf(white), dark, shading).single()
        val reference = Reference(region, REFLECTANCE)
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

    private companion object {
        /** Of the white surface in the cases' photo. */
        const val REFLECTANCE = 0.3
    }
}
