package org.camssf.passport

import org.camssf.json.JsonText
import org.camssf.json.NotJson
import java.nio.ByteBuffer
import java.nio.charset.CharacterCodingException

/** What passports need of JSON beyond [JsonText]. */
internal object PassportJson {
    /** Decodes UTF-8; invalid bytes are not replaced but rejected. */
    fun text(data: ByteArray): String = try {
        Charsets.UTF_8.newDecoder().decode(ByteBuffer.wrap(data)).toString()
    } catch (_: CharacterCodingException) {
        throw NotJson("not UTF-8")
    }

    /** A value as JSON without blanks; an unpaired surrogate becomes U+FFFD, as in Python. */
    fun write(value: Any?): String = JsonText.write(paired(value))

    /** True if two values are equal: numbers by their values, members in any order. */
    fun isSame(one: Any?, other: Any?): Boolean = when (one) {
        is Map<*, *> ->
            other is Map<*, *> && one.keys == other.keys && one.all { (name, value) -> isSame(value, other[name]) }

        is List<*> -> other is List<*> && one.size == other.size && one.indices.all { isSame(one[it], other[it]) }

        is Number -> other is Number && one.toDouble() == other.toDouble()

        else -> one == other
    }

    private fun paired(value: Any?): Any? = when (value) {
        is Map<*, *> -> value.entries.associate { (name, member) -> paired(name) to paired(member) }
        is List<*> -> value.map { paired(it) }
        is String -> paired(value)
        else -> value
    }

    private fun paired(text: String): String {
        val letters = text.toCharArray()
        for ((i, letter) in text.withIndex()) {
            val alone = when {
                letter.isHighSurrogate() -> text.getOrNull(i + 1)?.isLowSurrogate() != true
                letter.isLowSurrogate() -> text.getOrNull(i - 1)?.isHighSurrogate() != true
                else -> false
            }
            if (alone) letters[i] = '\ufffd'
        }
        return letters.concatToString()
    }
}
