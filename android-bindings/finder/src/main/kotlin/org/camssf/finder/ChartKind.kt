package org.camssf.finder

import kotlinx.serialization.json.Json
import kotlinx.serialization.json.JsonObject
import kotlinx.serialization.json.double
import kotlinx.serialization.json.jsonArray
import kotlinx.serialization.json.jsonObject
import kotlinx.serialization.json.jsonPrimitive
import org.camssf.InvalidArgument
import org.camssf.model.Models

/**
 * A kind of chart that the finder can distinguish: a grid of patches and their colours.
 *
 * Classic, Classic Nano, Classic Mini and the Passport's classic page are **one** kind: they have the same 24 colours
 * in the same 6 × 4 grid. A picture does not show their sizes. The gap between their patches is 0.12 of the pitch on
 * Classic and Mini, 0.14 on Nano, 0.17 on the Passport; it is measured only when the pose is refined on the mosaic.
 *
 * @property columns number of patches in a row.
 * @property rows number of patches in a column.
 * @property layouts names of the possible layouts ([org.camssf.spectra.ChartLayout]), the most common one first.
 */
public enum class ChartKind(public val columns: Int, public val rows: Int, public val layouts: List<String>) {
    /** 24 patches: Classic, Nano, Mini, Passport. */
    CLASSIC_24(6, 4, listOf("classic24", "passport24", "nano24", "mini24")),

    /** ColorChecker Digital SG. */
    SG_140(14, 10, listOf("sg140")),
    ;

    private val stored: JsonObject by lazy { FILE.getValue("kinds").jsonObject.getValue(layouts[0]).jsonObject }
    private val coloured: DoubleArray by lazy { Orientation.features(colours(), 3) }
    private val grey: DoubleArray by lazy { Orientation.features(colours(), 1) }

    /** Edge of a patch in pitches. */
    internal val side: Double by lazy { stored.getValue("side").jsonPrimitive.double }

    internal fun features(channels: Int): DoubleArray = if (channels == 3) coloured else grey

    private fun colours(): DoubleArray {
        val rows = stored.getValue("colours").jsonArray
        return DoubleArray(3 * rows.size) { rows[it / 3].jsonArray[it % 3].jsonPrimitive.double }
    }

    private companion object {
        /** The patch edges and colours of the charts; Python uses the same file. */
        val FILE: JsonObject by lazy {
            val text = try {
                Models.read("finder.json").decodeToString()
            } catch (error: IllegalStateException) {
                throw InvalidArgument(error.message.orEmpty(), "Add camssf-model unchanged.", cause = error)
            }
            Json.parseToJsonElement(text).jsonObject.also {
                check(it.getValue("format").jsonPrimitive.content == "camssf-finder/1") {
                    "finder.json is of another version"
                }
            }
        }
    }
}
