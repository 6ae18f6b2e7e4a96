package org.camssf

import kotlinx.serialization.json.Json
import kotlinx.serialization.json.JsonObject
import kotlinx.serialization.json.jsonObject
import org.camssf.documents.PreviousShots
import org.camssf.model.Models
import org.camssf.photo.MeasuredCapture
import org.camssf.spectra.text

/**
 * A stored result of the same unit under a lamp that was named, for [Settings.previous]: its shots are solved
 * together with new ones of the same chart, in any light. If the unit has changed since, the answer is that of the
 * new ones alone, and doubtful. Immutable; safe to pass between threads.
 *
 * @property name of its file, for messages and for the new result.
 * @property sha256 SHA-256 of its text in UTF-8, lower-case hex.
 */
public class PreviousResult private constructor(
    public val name: String,
    public val sha256: String,
    private val json: String,
) {
    /**
     * The capture with the named shots of this result behind its own, all relative to the chart's white patch.
     *
     * @throws InvalidArgument the result is not accepted, names no lamp, is of another chart, or holds the same
     *   photo.
     * @throws UnitDiffers it is of another camera.
     */
    internal fun joined(capture: MeasuredCapture): MeasuredCapture = reading {
        PreviousShots(name, read(json)).joined(capture)
    }

    private fun <T> reading(work: () -> T): T = try {
        work()
    } catch (error: CalibrationException) {
        throw error
    } catch (error: RuntimeException) { // a missing or malformed field
        throw damaged(name, error)
    }

    override fun equals(other: Any?): Boolean =
        other is PreviousResult && sha256 == other.sha256 && name == other.name

    override fun hashCode(): Int = sha256.hashCode()

    override fun toString(): String = "PreviousResult($name)"

    public companion object {
        /**
         * Reads a result document, "camssf-result/1", as [Calibration.toJson] and Python write it.
         *
         * @throws InvalidArgument the text is no such document.
         */
        @JvmStatic
        @JvmOverloads
        public fun parse(json: String, name: String = "(given)"): PreviousResult {
            try {
                check(read(json).text("format") == "camssf-result/1") { "another format" }
            } catch (error: RuntimeException) { // thrown by the parser and for missing fields
                throw damaged(name, error)
            }
            return PreviousResult(name, Models.sha256(json.toByteArray()), json)
        }

        private fun read(json: String): JsonObject = Json.parseToJsonElement(json).jsonObject

        private fun damaged(name: String, cause: RuntimeException) = InvalidArgument(
            "The previous result $name is no result that camssf wrote (${cause.message?.lines()?.first()}).",
            "Give the text of a \"camssf-result/1\", as Calibration.toJson has it.",
            cause = cause,
        )
    }
}
