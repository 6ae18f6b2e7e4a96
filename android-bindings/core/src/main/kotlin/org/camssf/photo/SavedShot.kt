package org.camssf.photo

import kotlinx.serialization.json.Json
import kotlinx.serialization.json.JsonArray
import kotlinx.serialization.json.JsonNull
import kotlinx.serialization.json.JsonObject
import kotlinx.serialization.json.JsonPrimitive
import kotlinx.serialization.json.boolean
import kotlinx.serialization.json.double
import kotlinx.serialization.json.int
import kotlinx.serialization.json.jsonArray
import kotlinx.serialization.json.jsonObject
import kotlinx.serialization.json.jsonPrimitive
import kotlinx.serialization.json.long
import org.camssf.CalibrationException
import org.camssf.Grid
import org.camssf.InvalidArgument
import org.camssf.model.Models
import org.camssf.spectra.Lamp
import org.camssf.spectra.SourceFile

/**
 * Writes and reads a measured shot as text, "camssf-shot/1": a first line with the format and the SHA-256 of the
 * rest, then JSON. Numbers are restored bit for bit. Later versions are refused with a message that names the
 * version.
 */
internal object SavedShot {
    private const val FORMAT = "camssf-shot/"
    private const val VERSION = "1"
    private const val AGAIN = "Measure the photo again, and save the shot anew."

    fun write(shot: MeasuredShot): String {
        val content = JsonObject(
            mapOf(
                "lamp" to lamp(shot.lamp),
                "photo" to photo(shot.photo),
                "white" to (shot.white?.let { photo(it) } ?: JsonNull),
                "dark" to (shot.dark?.let { photo(it) } ?: JsonNull),
                "pose" to pose(shot.pose),
                "means" to means(shot.means),
                "lens_shading" to JsonPrimitive(shot.lensShading.word),
            ),
        ).toString()
        return "$FORMAT$VERSION ${hash(content)}\n$content\n"
    }

    /** @throws InvalidArgument another format or version, or a damaged text. */
    fun read(text: String): MeasuredShot {
        val head = text.substringBefore('\n')
        if (!head.startsWith(FORMAT)) throw InvalidArgument("This is no saved shot.", "Give what toText made.")
        val version = head.removePrefix(FORMAT).substringBefore(' ')
        if (version != VERSION) {
            throw InvalidArgument("The saved shot is of version $version, this camssf reads $VERSION.", AGAIN)
        }
        val content = text.substringAfter('\n', "").removeSuffix("\n")
        if (hash(content) != head.substringAfter(' ', "")) throw damaged("it was changed or cut off", null)
        try {
            return shot(Json.parseToJsonElement(content).jsonObject)
        } catch (error: CalibrationException) {
            throw error
        } catch (error: RuntimeException) { // thrown by the parser and for missing fields
            throw damaged(error.message ?: error.toString(), error)
        }
    }

    private fun damaged(what: String, cause: Throwable?) =
        InvalidArgument("The saved shot is damaged: $what.", AGAIN, cause = cause)

    private fun hash(content: String): String = Models.sha256(content.toByteArray())

    private fun shot(entry: JsonObject): MeasuredShot {
        val pose = poseOf(entry.part("pose"))
        val n = pose.sharedQuads.size / 8
        val means = entry.part("means")
        val frames = listOf("chart", "white", "dark").map { name -> means.maybe(name)?.let { frameOf(it, n) } }
        val photos = listOf("photo", "white", "dark").map { name -> entry.maybe(name)?.let { photoOf(it) } }
        for (i in 1..2) require((frames[i] == null) == (photos[i] == null)) { "a frame without its photo" }
        return MeasuredShot(
            lampOf(entry.part("lamp")),
            requireNotNull(photos[0]) { "no photo" },
            photos[1],
            photos[2],
            pose,
            PatchMeans(
                requireNotNull(frames[0]) { "no means" }, frames[1], frames[2],
                means.numbers("black", 3), means.number("saturation"),
            ),
            LensShading.of(entry.text("lens_shading")),
        )
    }

    // Lamp --------------------------------------------------------------------------------------------------------

    /** An unnamed light has only a name. */
    private fun lamp(lamp: Lamp) = if (lamp.unnamed) words("name" to lamp.name) else named(lamp)

    private fun named(lamp: Lamp) = JsonObject(
        mapOf(
            "name" to JsonPrimitive(lamp.name),
            "values" to array(lamp.sharedValues),
            "tolerance" to JsonPrimitive(lamp.tolerance),
            "modes" to JsonArray(lamp.sharedModes.map { array(it) }),
            "source" to JsonPrimitive(lamp.source),
            "file" to (lamp.file?.let { words("name" to it.name, "sha256" to it.sha256) } ?: JsonNull),
        ) + listOfNotNull(lamp.toleranceKelvin?.let { "tolerance_kelvin" to JsonPrimitive(it) }),
    )

    private fun lampOf(entry: JsonObject): Lamp {
        if (entry.keys == setOf("name")) {
            val unnamed = listOf(Lamp.auto(), Lamp.torch())
            return requireNotNull(unnamed.firstOrNull { it.name == entry.text("name") }) { "no lamp" }
        }
        val values = entry.numbers("values", Grid.SIZE)
        require(values.all { it >= 0 } && values.max() > 0) { "a lamp without power" }
        val modes = entry.getValue("modes").jsonArray.map { numbers(it.jsonArray, Grid.SIZE) }
        val file = entry.maybe("file")?.let { SourceFile(it.text("name"), it.text("sha256")) }
        return Lamp(
            entry.text("name"), values, entry.number("tolerance"), modes, entry.text("source"), file,
            if ("tolerance_kelvin" in entry) entry.number("tolerance_kelvin") else null,
        )
    }

    // Photo -------------------------------------------------------------------------------------------------------

    private fun photo(photo: Photo) = JsonObject(
        mapOf(
            "name" to JsonPrimitive(photo.name),
            "width" to JsonPrimitive(photo.width),
            "height" to JsonPrimitive(photo.height),
            "orientation" to JsonPrimitive(photo.orientation),
            "exposure" to JsonPrimitive(photo.exposure),
            "iso" to JsonPrimitive(photo.iso),
            "gain_map" to JsonPrimitive(photo.gainMap),
            "make" to JsonPrimitive(photo.make),
            "model" to JsonPrimitive(photo.model),
            "sha256" to JsonPrimitive(photo.sha256),
            "colour_matrices" to JsonArray(
                photo.colourMatrices.map {
                    JsonObject(mapOf("light" to JsonPrimitive(it.light), "values" to array(it.sharedValues)))
                },
            ),
            "camera" to camera(photo.camera),
            "captured" to JsonPrimitive(photo.captured),
            "unique_model" to JsonPrimitive(photo.uniqueModel),
        ),
    )

    private fun photoOf(entry: JsonObject) = Photo(
        entry.text("name"),
        entry.whole("width"),
        entry.whole("height"),
        entry.whole("orientation"),
        entry.maybeNumber("exposure"),
        entry.maybeNumber("iso"),
        entry.getValue("gain_map").jsonPrimitive.boolean,
        entry.text("make"),
        entry.text("model"),
        entry.text("sha256"),
        entry.getValue("colour_matrices").jsonArray.map { each ->
            val light = each.jsonObject.text("light")
            require(light in ColourMatrix.WHITE_POINTS) { "a light called $light" }
            ColourMatrix(light, each.jsonObject.numbers("values", 9))
        },
        cameraOf(entry.part("camera")),
        entry.text("captured"),
        entry.text("unique_model"),
    )

    private fun camera(camera: PhysicalCamera) = JsonObject(
        mapOf(
            "id" to JsonPrimitive(camera.id),
            "serial" to JsonPrimitive(camera.serial),
            "lens" to JsonPrimitive(camera.lens),
            "focal_length" to JsonPrimitive(camera.focalLength),
            "aperture" to JsonPrimitive(camera.aperture),
            "active_area" to (
                camera.activeArea?.let { area ->
                    JsonArray(listOf(area.left, area.top, area.right, area.bottom).map { JsonPrimitive(it) })
                } ?: JsonNull
                ),
        ),
    )

    private fun cameraOf(entry: JsonObject): PhysicalCamera {
        val area = (entry.getValue("active_area") as? JsonArray)?.map { it.jsonPrimitive.int }
        return PhysicalCamera(
            entry.text("id"), entry.text("serial"), entry.text("lens"),
            entry.maybeNumber("focal_length"), entry.maybeNumber("aperture"),
            area?.let { (left, top, right, bottom) -> Region(left, top, right, bottom) },
        )
    }

    // Pose and means ----------------------------------------------------------------------------------------------

    private fun pose(pose: ChartPose) = JsonObject(
        mapOf(
            "layout" to JsonPrimitive(pose.layout),
            "corners" to array(pose.sharedCorners),
            "patches" to array(pose.sharedQuads),
            "quarter_turns" to JsonPrimitive(pose.quarterTurns),
            "method" to JsonPrimitive(pose.method),
            "score" to JsonPrimitive(pose.score),
            "notes" to JsonArray(pose.notes.map { JsonPrimitive(it) }),
        ),
    )

    private fun poseOf(entry: JsonObject): ChartPose {
        val quads = numbers(entry.getValue("patches").jsonArray)
        require(quads.isNotEmpty() && quads.size % 8 == 0) { "corners of patches" }
        return ChartPose(
            entry.text("layout"), entry.numbers("corners", 8), quads, entry.whole("quarter_turns"),
            entry.text("method"), entry.number("score"),
            entry.getValue("notes").jsonArray.map { it.jsonPrimitive.content },
        )
    }

    private fun means(means: PatchMeans) = JsonObject(
        mapOf(
            "chart" to frame(means.chart),
            "white" to (means.white?.let { frame(it) } ?: JsonNull),
            "dark" to (means.dark?.let { frame(it) } ?: JsonNull),
            "black" to array(means.sharedBlack),
            "saturation" to JsonPrimitive(means.saturation),
        ),
    )

    private fun frame(frame: FrameMeans) = JsonObject(
        mapOf(
            "mean" to array(frame.sharedMean),
            "standard_error" to array(frame.sharedError),
            "count" to JsonArray(frame.count.map { JsonPrimitive(it) }),
            "clipped" to array(frame.sharedClipped),
            "dead" to array(frame.dead),
            "gradient" to array(frame.gradient),
            "greens" to array(frame.greens),
        ),
    )

    private fun frameOf(entry: JsonObject, n: Int): FrameMeans {
        val count = entry.getValue("count").jsonArray.map { it.jsonPrimitive.long }.toLongArray()
        require(count.size == 3 * n) { "${count.size} counts for $n patches" }
        return FrameMeans(
            entry.numbers("mean", 3 * n), entry.numbers("standard_error", 3 * n), count,
            entry.numbers("clipped", 3 * n), entry.numbers("dead", 3 * n),
            entry.numbers("gradient", 3 * n), entry.numbers("greens", 2 * n),
        )
    }

    // JSON --------------------------------------------------------------------------------------------------------

    private fun array(values: DoubleArray) = JsonArray(values.map { JsonPrimitive(it) })

    private fun words(vararg pairs: Pair<String, String>) = JsonObject(
        pairs.associate { (k, v) ->
            k to
                JsonPrimitive(v)
        },
    )

    private fun JsonObject.part(name: String): JsonObject = getValue(name).jsonObject

    private fun JsonObject.maybe(name: String): JsonObject? = getValue(name).let {
        if (it is JsonNull) null else it.jsonObject
    }

    private fun JsonObject.text(name: String): String = getValue(name).jsonPrimitive.also {
        require(it.isString) { name }
    }.content

    private fun JsonObject.whole(name: String): Int = getValue(name).jsonPrimitive.int

    private fun JsonObject.number(name: String): Double = getValue(name).jsonPrimitive.double.also {
        require(it.isFinite()) { name }
    }

    private fun JsonObject.maybeNumber(name: String): Double? =
        getValue(name).let { if (it is JsonNull) null else number(name) }

    private fun JsonObject.numbers(name: String, size: Int): DoubleArray = numbers(getValue(name).jsonArray, size)

    private fun numbers(values: JsonArray, size: Int = values.size): DoubleArray {
        require(values.size == size) { "${values.size} numbers instead of $size" }
        return DoubleArray(size) { at ->
            values[at].jsonPrimitive.double.also { require(it.isFinite()) { "a number" } }
        }
    }
}
