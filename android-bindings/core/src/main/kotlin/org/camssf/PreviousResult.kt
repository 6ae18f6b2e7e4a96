package org.camssf

import org.camssf.documents.PreviousShots
import org.camssf.model.Models
import org.camssf.photo.DocumentForm
import org.camssf.photo.MeasuredCapture

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
    private val document: DocumentForm,
) {
    /**
     * The capture with the named shots of this result behind its own, all relative to the chart's white patch.
     *
     * @throws InvalidArgument the result is not accepted, names no lamp, is of another chart, or holds the same
     *   photo.
     * @throws UnitDiffers it is of another camera.
     */
    internal fun joined(capture: MeasuredCapture): MeasuredCapture = PreviousShots(name, document).joined(capture)

    override fun equals(other: Any?): Boolean =
        other is PreviousResult && sha256 == other.sha256 && name == other.name

    override fun hashCode(): Int = sha256.hashCode()

    override fun toString(): String = "PreviousResult($name)"

    public companion object {
        /**
         * Reads a result, a document "camssf/2", as [Calibration.toJson] and Python write it.
         *
         * @throws InvalidArgument the text is no such document; the message names the place of the first fault.
         */
        @JvmStatic
        @JvmOverloads
        public fun parse(json: String, name: String = "(given)"): PreviousResult {
            val document = DocumentForm.read(json, name)
            if (document.verdict == null) {
                throw InvalidArgument("$name: the document lacks verdict.", DocumentForm.ADVICE)
            }
            return PreviousResult(name, Models.sha256(json.toByteArray()), document)
        }
    }
}
