package org.camssf.passport

import java.nio.ByteBuffer
import java.nio.charset.CharacterCodingException

/** The text is not strict JSON. Used inside this package only. */
internal class UnsoundException(message: String) : Exception(message)

/** A number, with its text as written. */
internal class Numeral(val text: String) {
    /** The number; null if it is not written as a whole number of at most 18 digits. */
    val whole: Long? get() = if (WHOLE.matches(text)) text.toLong() else null

    private companion object {
        val WHOLE = Regex("-?[0-9]{1,18}")
    }
}

/** A JSON object; for the outermost one, also the range of each value in the text. */
internal class Members(val values: Map<String, Any?>, val places: Map<String, IntRange>)

/**
 * Parses strict JSON to [Members], lists, strings, [Numeral], Boolean and null.
 *
 * It rejects what Python's parser rejects and kotlinx's parser would accept: a key twice in an object, words without
 * quotes, NaN, control characters in a string.
 */
internal class Sound private constructor(private val text: String) {
    private var at = 0

    private fun document(): Any? {
        blank()
        val found = value(0)
        blank()
        if (at < text.length) fail("more behind its end")
        return found
    }

    private fun value(depth: Int): Any? {
        if (depth > DEEPEST) fail("nested deeper than $DEEPEST")
        return when (peek()) {
            '{' -> members(depth)
            '[' -> list(depth)
            '"' -> string()
            't' -> word("true", true)
            'f' -> word("false", false)
            'n' -> word("null", null)
            else -> number()
        }
    }

    private fun members(depth: Int): Members {
        val values = LinkedHashMap<String, Any?>()
        val places = HashMap<String, IntRange>()
        at++
        blank()
        if (peek() == '}') {
            at++
            return Members(values, places)
        }
        while (true) {
            val name = string()
            blank()
            take(':')
            blank()
            if (name in values) fail("the same key twice in one object")
            val from = at
            values[name] = value(depth + 1)
            if (depth == 0) places[name] = from until at
            blank()
            if (peek() == '}') break
            take(',')
            blank()
        }
        at++
        return Members(values, places)
    }

    private fun list(depth: Int): List<Any?> {
        val found = ArrayList<Any?>()
        at++
        blank()
        if (peek() == ']') {
            at++
            return found
        }
        while (true) {
            found += value(depth + 1)
            blank()
            if (peek() == ']') break
            take(',')
            blank()
        }
        at++
        return found
    }

    private fun string(): String {
        take('"')
        val found = StringBuilder()
        while (true) {
            val letter = peek()
            at++
            when {
                letter == '"' -> return found.toString()
                letter == '\\' -> found.append(escaped())
                letter < ' ' -> fail("a control character in a string")
                else -> found.append(letter)
            }
        }
    }

    private fun escaped(): Char {
        val letter = peek()
        at++
        if (letter != 'u') return ESCAPES[letter] ?: fail("an unknown escape")
        var code = 0
        repeat(4) {
            val digit = HEX.indexOf(peek().lowercaseChar())
            if (digit < 0 || peek() > 'f') fail("an unknown escape")
            code = code * 16 + digit
            at++
        }
        return code.toChar()
    }

    private fun number(): Numeral {
        val from = at
        if (peek() == '-') at++
        val first = at
        if (digits() > 1 && text[first] == '0') fail("a number that begins with 0")
        val whole = at - first
        val next = text.getOrNull(at)
        if (next == '.') {
            at++
            digits()
        }
        val fraction = next == '.'
        val exponent = text.getOrNull(at) == 'e' || text.getOrNull(at) == 'E'
        if (exponent) {
            at++
            if (text.getOrNull(at) == '+' || text.getOrNull(at) == '-') at++
            digits()
        }
        if (!fraction && !exponent && whole > LONGEST) fail("a number of $whole digits")
        return Numeral(text.substring(from, at))
    }

    /** Skips digits and returns their number, at least one. */
    private fun digits(): Int {
        val from = at
        while (at < text.length && text[at] in '0'..'9') at++
        if (at == from) fail("no number where one must be")
        return at - from
    }

    private fun word(word: String, value: Boolean?): Boolean? {
        if (!text.startsWith(word, at)) fail("an unknown word")
        at += word.length
        return value
    }

    private fun take(letter: Char) {
        if (peek() != letter) fail("no $letter")
        at++
    }

    private fun peek(): Char = text.getOrNull(at) ?: fail("cut off")

    private fun blank() {
        while (at < text.length && isBlank(text[at])) at++
    }

    private fun fail(what: String): Nothing = throw UnsoundException("$what, at character $at")

    companion object {
        /** Deepest nesting. Python's own limit is higher and depends on its version. */
        const val DEEPEST = 500

        /** Largest number of digits of a whole number, as in Python. */
        private const val LONGEST = 4300
        private const val HEX = "0123456789abcdef"
        private val ESCAPES = mapOf(
            '"' to '"', '\\' to '\\', '/' to '/', 'b' to '\b', 'f' to '\u000c', 'n' to '\n', 'r' to '\r', 't' to '\t',
        )

        /** Decodes UTF-8; invalid bytes are not replaced but rejected. */
        fun text(data: ByteArray): String = try {
            Charsets.UTF_8.newDecoder().decode(ByteBuffer.wrap(data)).toString()
        } catch (_: CharacterCodingException) {
            throw UnsoundException("not UTF-8")
        }

        /** Parses a text that is one JSON value. */
        fun parse(text: String): Any? = Sound(text).document()

        /** A value as JSON without blanks; numbers as they were written. */
        fun write(value: Any?): String = StringBuilder().also { write(value, it) }.toString()

        private fun write(value: Any?, out: StringBuilder) {
            when (value) {
                is Members -> {
                    out.append('{')
                    for ((name, member) in value.values) {
                        if (out.last() != '{') out.append(',')
                        out.append(quote(name)).append(':')
                        write(member, out)
                    }
                    out.append('}')
                }

                is List<*> -> {
                    out.append('[')
                    for ((i, entry) in value.withIndex()) {
                        if (i > 0) out.append(',')
                        write(entry, out)
                    }
                    out.append(']')
                }

                is String -> out.append(quote(value))

                is Numeral -> out.append(value.text)

                else -> out.append(value)
            }
        }

        /** True if two values are equal: numbers by their values, members in any order. */
        fun isSame(one: Any?, other: Any?): Boolean = when (one) {
            is Members ->
                other is Members && one.values.keys == other.values.keys &&
                    one.values.all { (name, value) -> isSame(value, other.values[name]) }

            is List<*> -> other is List<*> && one.size == other.size && one.indices.all { isSame(one[it], other[it]) }

            is Numeral -> other is Numeral && one.text.toDouble() == other.text.toDouble()

            else -> one == other
        }

        /** A string as JSON; an unpaired surrogate becomes U+FFFD, as in Python. */
        fun quote(text: String): String {
            val out = StringBuilder(text.length + 2).append('"')
            for ((i, letter) in text.withIndex()) {
                val behind = text.getOrNull(i + 1)
                val before = text.getOrNull(i - 1)
                when {
                    letter == '"' || letter == '\\' -> out.append('\\').append(letter)
                    letter < ' ' -> out.append("\\u00").append(HEX[letter.code shr 4]).append(HEX[letter.code and 15])
                    letter.isHighSurrogate() && behind?.isLowSurrogate() != true -> out.append('\ufffd')
                    letter.isLowSurrogate() && before?.isHighSurrogate() != true -> out.append('\ufffd')
                    else -> out.append(letter)
                }
            }
            return out.append('"').toString()
        }

        private fun isBlank(letter: Char) = letter == ' ' || letter == '\n' || letter == '\r' || letter == '\t'
    }
}
