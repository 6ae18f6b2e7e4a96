package org.camssf.photo

import org.camssf.InvalidArgument

/**
 * Treatment of the lens shading that a photo's file describes.
 *
 * @property word its name in Python and JSON.
 */
public enum class LensShading(public val word: String) {
    /** The samples stay as they are. A white frame corrects the shading. */
    AS_STORED("as-stored"),

    /** The signal above black is multiplied by the gain maps in the chart photo's file. */
    APPLY("apply"),
    ;

    public companion object {
        /**
         * The value with this name.
         *
         * @throws InvalidArgument an unknown name.
         */
        @JvmStatic
        public fun of(word: String): LensShading = values().firstOrNull { it.word == word } ?: throw InvalidArgument(
            "Lens shading '$word' is unknown.",
            "Say ${values().joinToString(" or ") { it.word }}.",
        )
    }
}
