package org.camssf.spectra

import org.camssf.model.Models

/**
 * A file that a lamp or a chart table came from.
 *
 * @property name without its path.
 * @property sha256 of its content, lower-case hex.
 */
public class SourceFile internal constructor(public val name: String, public val sha256: String) {
    internal companion object {
        fun of(name: String, content: ByteArray): SourceFile =
            SourceFile(name.substringAfterLast('/').substringAfterLast('\\'), Models.sha256(content))
    }
}
