package org.camssf.photo

import org.camssf.InvalidArgument

/**
 * What is done about the lens shading that a photo's file describes.
 *
 * @property word the same in Python and JSON.
 */
public enum class LensShading(public val word: String) {
    /** Nothing: the samples are taken as they are. A white frame corrects the shading. */
    AS_STORED("as-stored"),

    /** What lies above black is multiplied by the gain maps in the chart photo's file. */
    APPLY("apply"),
    ;

    public companion object {
        /**
         * The one of that word.
         *
         * @throws InvalidArgument another word.
         */
        @JvmStatic
        public fun of(word: String): LensShading = values().firstOrNull { it.word == word } ?: throw InvalidArgument(
            "Lens shading '$word' is unknown.",
            "Say ${values().joinToString(" or ") { it.word }}.",
        )
    }
}
