package org.camssf.spectra

import org.camssf.model.Models

/**
 * The file of a lamp or a chart table.
 *
 * @property name without its path.
 * @property sha256 SHA-256 of its content, lower-case hex.
 */
public class SourceFile internal constructor(public val name: String, public val sha256: String) {
    override fun equals(other: Any?): Boolean = other is SourceFile && name == other.name && sha256 == other.sha256

    override fun hashCode(): Int = sha256.hashCode()

    override fun toString(): String = "$name ($sha256)"

    internal companion object {
        fun of(name: String, content: ByteArray): SourceFile =
            SourceFile(name.substringAfterLast('/').substringAfterLast('\\'), Models.sha256(content))
    }
}
