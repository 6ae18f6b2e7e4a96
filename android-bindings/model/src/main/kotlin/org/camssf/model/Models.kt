package org.camssf.model

import java.io.InputStream

/** The files in this jar: model, bases, tables and rules that Python also uses, each with the SHA-256 of its build. */
public object Models {
    private const val FOLDER = "org/camssf/model"

    /** Names of the files. */
    @JvmField
    public val NAMES: List<String> = listOf(
        "camssf-learned.onnx", "camssf-verdict.onnx", "bases.f64",
        "spectra.json", "rules.json", "messages.json", "finder.json", "forms.json",
    )

    /**
     * Opens the file of this name; the caller closes the stream.
     *
     * @throws IllegalStateException the file is missing from the jar (an app's packaging rules can remove it).
     */
    @JvmStatic
    public fun open(name: String): InputStream = open(Models::class.java, FOLDER, name)

    /**
     * Reads one of [NAMES], or `camssf-gaussian.onnx` of the artefact `camssf-model-gaussian`, and checks its hash.
     *
     * @throws IllegalStateException the file is missing or differs from the one that this jar was built with.
     */
    @JvmStatic
    public fun read(name: String): ByteArray = read(Models::class.java, FOLDER, name)

    /**
     * Reads a file of a camssf jar and checks its hash.
     *
     * @param owner a class in that jar.
     * @param folder of the file in that jar.
     * @throws IllegalStateException the file is missing or differs from the one that the jar was built with.
     */
    internal fun read(owner: Class<*>, folder: String, name: String): ByteArray {
        val (content, hash) = listOf(name, "$name.sha256").map {
            open(owner, folder, it).use { file -> file.readBytes() }
        }
        return checked(name, content, hash)
    }

    private fun open(owner: Class<*>, folder: String, name: String): InputStream =
        checkNotNull(owner.classLoader!!.getResourceAsStream("$folder/$name")) {
            "$name is missing from the app: keep the resources $folder/* when packaging."
        }

    internal fun checked(name: String, content: ByteArray, hash: ByteArray): ByteArray {
        check(sha256(content) == hash.toString(Charsets.US_ASCII).trim()) {
            "$name is not the file that this version of camssf was built with: it was changed when packaging."
        }
        return content
    }

    /** SHA-256 of bytes, lower-case hex. */
    @JvmStatic
    public fun sha256(content: ByteArray): String = Sha256().add(content).hex()
}
