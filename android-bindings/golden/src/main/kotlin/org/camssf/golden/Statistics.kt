package org.camssf.golden

import kotlinx.serialization.json.JsonElement
import kotlinx.serialization.json.JsonObject
import org.camssf.photo.FrameMeans
import org.camssf.photo.PatchMeans

/** Patch statistics as cases give them. */
internal class Statistics(private val forms: Forms) {
    fun means(shot: JsonObject): PatchMeans = PatchMeans(
        frame(shot.getValue("chart"))!!,
        frame(shot.getValue("white")),
        frame(shot.getValue("dark")),
        forms.resolve(shot.getValue("black")).values,
        number(shot.getValue("saturation"))!!,
    )

    private fun frame(frame: JsonElement): FrameMeans? {
        if (frame !is JsonObject) return null
        fun values(name: String) = frame[name]?.let { forms.resolve(it).values }
        val mean = values("mean")!!
        val still = DoubleArray(mean.size)
        val count = values("count")
        return FrameMeans(
            mean,
            values("standard_error")!!,
            LongArray(mean.size) { count?.get(it)?.toLong() ?: 400 },
            values("clipped")!!,
            values("dead") ?: still,
            still,
            values("greens") ?: DoubleArray(mean.size / 3 * 2) { mean[it / 2 * 3 + 1] },
        )
    }
}
