package org.camssf.model

import java.io.InputStream

/** The files in this jar: the models, tables and rules that Python also uses, each with the SHA-256 of its build. */
public object Models {
    /** Names of the files. */
    @JvmField
    public val NAMES: List<String> = listOf(
        "camssf-phones.onnx", "camssf-cameras.onnx", "camssf-ryyb.onnx", "camssf-gaussian.onnx",
        "spectra.json", "rules.json", "colour.json", "finder.json",
    )

    /**
     * Opens the file of this name; the caller closes the stream.
     *
     * @throws IllegalStateException the file is missing from the jar (an app's packaging rules can remove it).
     */
    @JvmStatic
    public fun open(name: String): InputStream =
        checkNotNull(Models::class.java.getResourceAsStream("/org/camssf/model/$name")) {
            "$name is missing from the app: keep the resources org/camssf/model/* when packaging."
        }

    /**
     * Reads one of [NAMES] and checks its hash.
     *
     * @throws IllegalStateException the file is missing or differs from the one that this jar was built with.
     */
    @JvmStatic
    public fun read(name: String): ByteArray = checked(name, open(name).use { it.readBytes() })

    internal fun checked(name: String, content: ByteArray): ByteArray {
        val known = open("$name.sha256").use { it.readBytes() }.toString(Charsets.US_ASCII).trim()
        check(sha256(content) == known) {
            "$name is not the file that this version of camssf was built with: it was changed when packaging."
        }
        return content
    }

    /** SHA-256 of bytes, lower-case hex. */
    @JvmStatic
    public fun sha256(content: ByteArray): String = Sha256().add(content).hex()
}
