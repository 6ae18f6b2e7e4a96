package org.camssf

import org.camssf.model.Models

/** Reads the files in camssf's artefacts; one that is missing or was changed is the app's fault. */
internal object Shipped {
    const val ADVICE = "Add the artefacts camssf-core and camssf-model of one version, unchanged."

    /**
     * The content of a file.
     *
     * @param advice what to do if it is missing.
     * @param read how its artefact is read; camssf-model's by default.
     * @throws InvalidArgument it is missing or was changed.
     */
    fun bytes(name: String, advice: String = ADVICE, read: (String) -> ByteArray = Models::read): ByteArray = try {
        read(name)
    } catch (error: IllegalStateException) {
        throw InvalidArgument(error.message.orEmpty(), advice, cause = error)
    }

    /** The text of one of camssf-model's files; errors as of [bytes]. */
    fun text(name: String): String = bytes(name).decodeToString()
}
