package org.camssf.colour

import org.camssf.InvalidArgument
import org.camssf.json.JsonText
import org.camssf.json.Members
import org.camssf.json.members
import org.camssf.json.numbers
import org.camssf.json.part
import org.camssf.json.text
import org.camssf.recovery.Tensor

/** The colour space of a [StandardPicture]. */
public enum class PictureSpace(
    /** Its name in results and in Python's options. */
    public val word: String,

    /** The white that colours are adapted to by CAT16. */
    public val white: Adapted,
) {
    /** sRGB (IEC 61966-2-1). */
    SRGB("srgb", Adapted.D65),

    /** Display P3 (SMPTE EG 432-1 with the curve of sRGB). */
    DISPLAY_P3("display-p3", Adapted.D65),

    /** Linear XYZ; 32768 is Y of a perfect white diffuser. */
    XYZ_D65("xyz-d65", Adapted.D65),

    /** Linear XYZ; 32768 is Y of a perfect white diffuser. */
    XYZ_D50("xyz-d50", Adapted.D50),
    ;

    private val known: Members get() = PictureSpaces.file.part(word)

    /** (3, 3) from XYZ over white to linear numbers up to 1. */
    internal val matrix: Tensor get() = Tensor(known.numbers("matrix"), 3, 3)

    /** Whether numbers follow the curve of sRGB; XYZ is linear. */
    internal val curved: Boolean get() = known.getValue("curved") as Boolean

    /** Its ICC profile; null for XYZ. */
    internal val profile: ByteArray?
        get() = (known["profile"] as String?)?.chunked(2) { it.toString().toInt(RADIX).toByte() }?.toByteArray()

    public companion object {
        private const val RADIX = 16

        /**
         * The space of a name.
         *
         * @throws InvalidArgument an unknown name.
         */
        @JvmStatic
        public fun of(word: String): PictureSpace = values().firstOrNull { it.word == word } ?: throw InvalidArgument(
            "There is no space '$word' for a picture.",
            "Take one of ${values().joinToString { it.word }}.",
        )
    }
}

/** The numbers of the spaces: picture-spaces.json, which is made by Python. */
private object PictureSpaces {
    val file: Members by lazy {
        val json = members(JsonText.parse(SurfaceModels.read("picture-spaces.json").decodeToString()))
        check(json.text("format") == "camssf-picture-spaces/1") { "picture-spaces.json is of another version" }
        json.part("spaces")
    }
}
