package org.camssf.photo

import org.camssf.Camssf
import org.camssf.Grid
import org.camssf.Rows
import org.camssf.flatten
import org.camssf.forms.Fields
import org.camssf.forms.Forms
import org.camssf.spectra.ChartLayout
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import org.camssf.spectra.SourceFile

/** A capture in a document: the table of its parts (Python's types) beside Kotlin's classes. */
internal object CaptureForm {
    /** A document of a capture alone. */
    fun write(capture: PartialCapture, identifying: Boolean): String = Forms.write(
        Forms.plain(
            "Document", "format" to Forms.FORMAT, "version" to Camssf.VERSION,
            "capture" to plain(capture, identifying),
        ),
    )

    /** The capture in plain values; with serial numbers and times if it may be `identifying`. */
    fun plain(capture: PartialCapture, identifying: Boolean = false): Map<String, Any?> {
        val last = capture.unfinished
        return Forms.plain(
            "Capture", "shots" to capture.shots.map { plain(it, identifying) }, "chart" to plain(capture.chart),
            "white_reflectance" to capture.whiteReflectance, "files" to capture.files,
            "unfinished" to last?.let {
                Forms.plain(
                    "UnfinishedShot", "lamp" to plain(capture.lamps[capture.shots.size]),
                    "photo" to last.photo?.let { plain(it, identifying) }, "black" to last.black,
                    "saturation" to last.saturation, "pose" to last.pose?.let { plain(it) },
                )
            },
        )
    }

    private fun plain(shot: MeasuredShot, identifying: Boolean) = Forms.plain(
        "MeasuredShot", "lamp" to plain(shot.lamp), "photo" to plain(shot.photo, identifying),
        "white" to shot.white?.let { plain(it, identifying) }, "dark" to shot.dark?.let { plain(it, identifying) },
        "pose" to plain(shot.pose), "means" to plain(shot.means), "lens_shading" to shot.lensShading.word,
    )

    private fun plain(lamp: Lamp): Map<String, Any?> {
        if (lamp.unnamed) return mapOf(Forms.KIND to "unnamed", "name" to lamp.name)
        if (lamp.uncertain) return mapOf(Forms.KIND to "called", "name" to lamp.name)
        return mapOf(Forms.KIND to "named") + Forms.plain(
            "Lamp", "name" to lamp.name, "values" to lamp.sharedValues, "tolerance" to lamp.tolerance,
            "modes" to Rows(lamp.sharedModes.flatten(), lamp.sharedModes.size, Grid.SIZE), "source" to lamp.source,
            "tolerance_kelvin" to lamp.toleranceKelvin,
        )
    }

    private fun plain(photo: Photo, identifying: Boolean) = Forms.plain(
        "Photo", "name" to photo.name, "width" to photo.width, "height" to photo.height,
        "orientation" to photo.orientation, "exposure" to photo.exposure, "iso" to photo.iso,
        "gain_map" to photo.gainMap, "make" to photo.make, "model" to photo.model, "sha256" to photo.sha256,
        "colour_matrices" to photo.colourMatrices.map {
            Forms.plain("ColourMatrix", "light" to it.light, "values" to it.sharedValues.toList())
        },
        "unit" to unit(photo.camera, identifying),
        "active_area" to photo.camera.activeArea?.let { listOf(it.top, it.left, it.bottom, it.right) },
        "levels" to photo.levels, "unique_model" to photo.uniqueModel, "matrices_left_out" to photo.matricesLeftOut,
        "time" to if (identifying) photo.captured else "",
    )

    private fun unit(camera: PhysicalCamera, identifying: Boolean) = Forms.plain(
        "Unit", "camera_id" to camera.id, "serial" to if (identifying) camera.serial else "",
        "serial_check" to camera.serialCheck, "lens" to camera.lens, "focal_length" to camera.focalLength,
        "aperture" to camera.aperture,
    )

    private fun plain(pose: ChartPose) = Forms.plain(
        "Pose", "layout" to pose.layout, "corners" to pose.sharedCorners, "patches" to pose.sharedQuads,
        "quarter_turns" to pose.quarterTurns, "method" to pose.method, "score" to pose.score, "notes" to pose.notes,
    )

    private fun plain(means: PatchMeans) = Forms.plain(
        "PatchMeans", "chart" to plain(means.chart), "white" to means.white?.let { plain(it) },
        "dark" to means.dark?.let { plain(it) }, "black" to means.sharedBlack, "saturation" to means.saturation,
        "evened" to means.evened, "noise" to means.noise?.let { plain(it) },
    )

    private fun plain(noise: SampleNoise) = Forms.plain(
        "SampleNoise", "step" to noise.step, "unlike" to noise.unlike?.let { plain(it) },
        "like" to noise.like?.let { plain(it) },
    )

    private fun plain(estimate: Estimate) =
        Forms.plain("Estimate", "value" to estimate.value, "error" to estimate.error)

    private fun plain(frame: FrameMeans) = Forms.plain(
        "FrameMeans", "mean" to frame.sharedMean, "standard_error" to frame.sharedError,
        "count" to frame.sharedCount, "clipped" to frame.sharedClipped, "dead" to frame.sharedDead,
        "gradient" to frame.sharedGradient, "greens" to frame.sharedGreens,
    )

    private fun plain(chart: ChartTable) = Forms.plain(
        "ChartTable", "name" to chart.name, "table" to chart.table, "layout" to chart.layout.plain(),
        "patches" to chart.patches, "wavelengths" to chart.wavelengths,
        "reflectance" to Rows(chart.reflectance, chart.patches.size, chart.wavelengths.size),
        "tolerance" to chart.sharedTolerance, "white" to chart.white, "source" to chart.source,
        "fading" to chart.fading,
    )

    // Reading

    /** The capture of a document's part. */
    fun capture(part: Fields): PartialCapture {
        val files = part.map<String>("files")
        val shots = part.list<Fields>("shots")
        val chart = chart(part.part("chart"), files)
        val measured = shots.mapIndexed { j, shot -> shot(shot, FileRoles.file(FileRoles.lamp(j), files)) }
        val last = part.maybe("unfinished")
        val next = last?.let { lamp(it["lamp"], FileRoles.file(FileRoles.lamp(shots.size), files)) }
        val lamps = measured.map { it.lamp } + listOfNotNull(next)
        val known = PartialCapture(chart, lamps, measured).files
        val unfinished = last?.let {
            PartialShot(
                it.maybe("photo")?.let { photo(it) }, (it["black"] as Rows?)?.values, it.number("saturation"),
                it.maybe("pose")?.let { pose(it) },
            )
        }
        val white = part.maybeNumber("white_reflectance")
        return PartialCapture(chart, lamps, measured, unfinished, white, files - known.keys)
    }

    private fun shot(part: Fields, lampFile: SourceFile?): MeasuredShot = MeasuredShot(
        lamp(part["lamp"], lampFile), photo(part.part("photo")), part.maybe("white")?.let { photo(it) },
        part.maybe("dark")?.let { photo(it) }, pose(part.part("pose")), means(part.part("means")),
        LensShading.of(part.text("lens_shading")),
    )

    /** A named lamp's part, or a light that is called by a name or unnamed, which is read already. */
    private fun lamp(part: Any?, file: SourceFile?): Lamp {
        if (part !is Fields) return part as Lamp
        val modes = part["modes"] as Rows
        val size = modes.sides[1]
        return Lamp(
            part.text("name"), part.array("values"), part.number("tolerance"),
            List(modes.sides[0]) { modes.values.copyOfRange(it * size, (it + 1) * size) }, part.text("source"), file,
            part.maybeNumber("tolerance_kelvin"),
        )
    }

    private fun photo(part: Fields) = Photo(
        part.text("name"), part.whole("width"), part.whole("height"), part.whole("orientation"),
        part.maybeNumber("exposure"), part.maybeNumber("iso"), part.flag("gain_map"), part.text("make"),
        part.text("model"), part.text("sha256"),
        part.list<Fields>("colour_matrices").map {
            ColourMatrix(it.text("light"), it.list<Double>("values").toDoubleArray())
        },
        camera(part.part("unit"), part["active_area"]), part.text("time"), part.text("unique_model"),
        part.text("matrices_left_out"), part.text("levels"),
    )

    private fun camera(unit: Fields, area: Any?): PhysicalCamera {
        val sides = (area as List<*>?)?.map { (it as Long).toInt() }
        return PhysicalCamera(
            unit.text("camera_id"), unit.text("serial"), unit.text("lens"), unit.maybeNumber("focal_length"),
            unit.maybeNumber("aperture"),
            sides?.let { (top, left, bottom, right) -> Region(left, top, right, bottom) },
            unit.text("serial_check"),
        )
    }

    private fun pose(part: Fields) = ChartPose(
        part.text("layout"), part.array("corners"), part.array("patches"), part.whole("quarter_turns"),
        part.text("method"), part.number("score"), part.list("notes"),
    )

    private fun means(part: Fields) = PatchMeans(
        frame(part.part("chart")), part.maybe("white")?.let { frame(it) }, part.maybe("dark")?.let { frame(it) },
        part.array("black"), part.number("saturation"), part.flag("evened"), part.maybe("noise")?.let { noise(it) },
    )

    private fun noise(part: Fields): SampleNoise {
        val (unlike, like) = listOf("unlike", "like").map { name -> part.maybe(name)?.let { estimate(it) } }
        return SampleNoise(part.number("step"), unlike, like)
    }

    private fun estimate(part: Fields) = Estimate(part.number("value"), part.number("error"))

    private fun frame(part: Fields) = FrameMeans(
        part.array("mean"), part.array("standard_error"),
        part.array("count").let { counts -> LongArray(counts.size) { counts[it].toLong() } },
        part.array("clipped"), part.array("dead"), part.array("gradient"), part.array("greens"),
    )

    private fun chart(part: Fields, files: Map<String, String>) = ChartTable(
        part.text("name"), part.text("table"), part["layout"] as ChartLayout, part.list("patches"),
        part.array("wavelengths"), part.array("reflectance"), part.array("tolerance"), part.whole("white"),
        part.text("source"), FileRoles.file(FileRoles.CHART, files), part.number("fading"),
    )
}
