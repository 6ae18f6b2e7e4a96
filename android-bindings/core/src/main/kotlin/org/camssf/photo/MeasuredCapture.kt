package org.camssf.photo

import org.camssf.frozen
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import org.camssf.spectra.SourceFile

/**
 * k measured shots of one chart with one camera: the input of `SsfCalibrator.solve`. Immutable; safe to pass between
 * threads. Its functions take 0.1 s, so any thread but the main one.
 *
 * @property chart the chart's table.
 * @property whiteReflectance reflectance of the white frame's target, one number; null for a perfect diffuser.
 * @property files SHA-256 by role and name of further files that the result depends on.
 */
public class MeasuredCapture internal constructor(
    shots: List<MeasuredShot>,
    public val chart: ChartTable,
    public val whiteReflectance: Double?,
    internal val files: Map<String, String> = emptyMap(),
) {
    /** The shots, k of them. */
    public val shots: List<MeasuredShot> = shots.frozen()

    override fun toString(): String = "MeasuredCapture($chart, $shots)"

    /** The same capture with other shots, or another table of its chart. */
    internal fun with(shots: List<MeasuredShot> = this.shots, chart: ChartTable = this.chart): MeasuredCapture =
        MeasuredCapture(shots, chart, whiteReflectance, files)

    /** [toJson] without serial numbers and times. */
    public fun toJson(): String = toJson(false)

    /**
     * The capture as a document, "camssf/2", on one line: for a file, for an activity's saved state (30 kB a shot, up to
     * 100 kB under a lamp known only by kind), or for `camssf solve` and `camssf patches` on a desktop. [fromJson] and
     * Python read it; all numbers are equal bit for bit.
     *
     * @param identifying whether it holds the cameras' serial numbers and the photos' times. Without, it holds four
     *   digits of the serial number's hash, which tell two units apart.
     */
    public fun toJson(identifying: Boolean): String = CaptureForm.write(PartialCapture(this), identifying)

    public companion object {
        /** As the other `of`, with no card before the white frames but a perfect diffuser. */
        @JvmStatic
        public fun of(shots: List<MeasuredShot>, chart: ChartTable): MeasuredCapture = of(shots, chart, null)

        /**
         * Joins shots that were measured one by one, perhaps restored by [fromJson].
         *
         * @param whiteReflectance of the target in the white frames, 90 % is 0.9; null for a perfect diffuser.
         * @throws org.camssf.InvalidArgument no shot, one photo twice, or white frames for some shots only.
         * @throws org.camssf.FramesDiffer they are of different cameras.
         * @throws org.camssf.UnitDiffers they are of different units or lenses.
         */
        @JvmStatic
        public fun of(shots: List<MeasuredShot>, chart: ChartTable, whiteReflectance: Double?): MeasuredCapture =
            Measuring.joined(shots, chart, whiteReflectance)

        /** As the other `fromJson`, of a source without a name. */
        @JvmStatic
        public fun fromJson(text: String): MeasuredCapture = fromJson(text, "(given)")

        /**
         * Reads the capture of a document, "camssf/2": one that [toJson] wrote, a result, or what `camssf patches`
         * prints.
         *
         * @param name of its source, for messages.
         * @throws org.camssf.InvalidArgument the text is no such document, was changed, or its capture was refused
         *   before all photos were measured; the message names the place.
         */
        @JvmStatic
        public fun fromJson(text: String, name: String): MeasuredCapture =
            DocumentForm.read(text, name).wholeCapture(name)
    }
}

/** A shot at which measuring ended: its lamp, and what is known of it. */
internal class PartialShot(
    val photo: Photo? = null,
    val black: DoubleArray? = null,
    val saturation: Double = 0.0,
    val pose: ChartPose? = null,
)

/**
 * The data of a capture so far, for the report of a refusal.
 *
 * @property lamps of all shots, also of those that were not measured.
 * @property shots the finished ones.
 * @property unfinished the shot at which measuring ended; null of a whole capture.
 * @property others SHA-256 by role and name of files other than lamps' and the chart's.
 */
internal class PartialCapture(
    val chart: ChartTable,
    val lamps: List<Lamp>,
    val shots: List<MeasuredShot>,
    val unfinished: PartialShot? = null,
    val whiteReflectance: Double? = null,
    val others: Map<String, String> = emptyMap(),
) {
    /** Of a finished capture. */
    constructor(capture: MeasuredCapture) : this(
        capture.chart, capture.shots.map { it.lamp }, capture.shots, null, capture.whiteReflectance, capture.files,
    )

    /** The finished capture; null if measuring ended before. */
    fun whole(): MeasuredCapture? = MeasuredCapture(shots, chart, whiteReflectance, others)
        .takeIf { unfinished == null && shots.isNotEmpty() }

    /** SHA-256 of the lamp and chart files, by role and name. */
    val files: Map<String, String>
        get() {
            val lamps = lamps.mapIndexed { j, lamp -> FileRoles.lamp(j) to lamp.file }
            val known = listOf(FileRoles.CHART to chart.file) + lamps
            return known.mapNotNull { (role, file) -> file?.let { "$role: ${it.name}" to it.sha256 } }.toMap() +
                others
        }
}

/** The roles of a capture's files. */
internal object FileRoles {
    const val CHART = "chart table"

    fun lamp(shot: Int): String = "shot ${shot + 1}, lamp"

    /** The file of a role among a document's files. */
    fun file(role: String, files: Map<String, String>): SourceFile? = files.entries
        .firstOrNull { it.key.startsWith("$role: ") }
        ?.let { SourceFile(it.key.removePrefix("$role: "), it.value) }
}
