package org.camssf

import org.camssf.documents.ResultForm
import org.camssf.photo.DocumentForm
import org.camssf.spectra.SourceFile

/** Results from their texts, which [CalibrationResult.toJson] and Python write. */
public object SavedResult {
    internal const val NAMELESS = "(given)"

    /**
     * Reads a result: the same class with the same numbers as from the calibration. A [Refused] has the error of its
     * verdict's first reason. Any thread but the main one: it takes 0.1 s.
     *
     * @throws InvalidArgument the text is no such document; the message names the place of the first fault.
     */
    @JvmStatic
    public fun read(json: String): CalibrationResult = read(json, NAMELESS)

    /** The same, with the name of its file for messages, and for a result that is made with it as the previous one. */
    @JvmStatic
    public fun read(json: String, name: String): CalibrationResult =
        of(DocumentForm.read(json, name), SourceFile.of(name, json.toByteArray()))

    internal fun of(document: DocumentForm, file: SourceFile): CalibrationResult {
        val verdict = document.verdict?.let { ResultForm.verdict(it) }
            ?: throw InvalidArgument("${file.name}: the document lacks verdict.", DocumentForm.ADVICE)
        val answer = document.answer
        val provenance = ResultForm.provenance(document.version, answer, document.partial)
        if (answer == null) {
            val reason = verdict.reasons.firstOrNull()
                ?: throw InvalidArgument("${file.name}: the verdict has no reason.", DocumentForm.ADVICE)
            return Refused(Refusal.of(reason), verdict, provenance, document.partial, file)
        }
        return Recovered(
            document.capture!!, ResultForm.answer(answer), verdict, ResultForm.assumptions(document.assumptions),
            provenance, file,
        )
    }
}
