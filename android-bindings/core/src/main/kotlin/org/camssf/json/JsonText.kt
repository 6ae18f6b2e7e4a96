package org.camssf.json

import org.camssf.model.Models
import java.io.ByteArrayOutputStream
import java.io.DataOutputStream
import java.math.BigInteger
import kotlin.math.abs

/** Why a text is not strict JSON. */
internal class NotJson(what: String) : IllegalArgumentException(what)

/**
 * Strict JSON: no key twice, no NaN, bounded depth. A value is a map in the text's order, a list, a text, a Boolean or
 * null; a number is a Long or BigInteger if it is written without point and exponent, else a Double.
 */
internal object JsonText {
    /**
     * Parses a text.
     *
     * @param place gets the name of each member of the outermost object, and its value's range in the text.
     * @throws NotJson the text is not strict JSON; the message says why.
     */
    fun parse(text: String, place: (String, IntRange) -> Unit = { _, _ -> }): Any? = Parser(text, place).document()

    /** The value on one line; numbers lossless. */
    fun write(value: Any?): String = StringBuilder().also { write(value, it) }.toString()

    private fun write(value: Any?, to: StringBuilder) {
        when (value) {
            is Map<*, *> -> {
                to.append('{')
                var first = true
                for ((key, entry) in value) {
                    if (!first) to.append(',')
                    first = false
                    write(key, to)
                    to.append(':')
                    write(entry, to)
                }
                to.append('}')
            }

            is List<*> -> {
                to.append('[')
                value.forEachIndexed { i, entry ->
                    if (i > 0) to.append(',')
                    write(entry, to)
                }
                to.append(']')
            }

            is String -> quote(value, to)

            is Double -> number(value, to)

            else -> to.append(value)
        }
    }

    private fun number(value: Double, to: StringBuilder) {
        check(!value.isNaN() && !value.isInfinite()) { "a document holds a number that is not finite" }
        to.append(value)
    }

    private fun quote(text: String, to: StringBuilder) {
        to.append('"')
        for (c in text) {
            when {
                c == '"' || c == '\\' -> to.append('\\').append(c)
                c == '\n' -> to.append("\\n")
                c < ' ' -> to.append("\\u00").append(DIGITS[c.code shr 4]).append(DIGITS[c.code and 15])
                else -> to.append(c)
            }
        }
        to.append('"')
    }

    /**
     * SHA-256 of a value, of whatever spacing, order of keys and spelling of numbers: Python's
     * `documents.forms.content_hash`, which says how.
     */
    fun hash(value: Any?): String {
        val bytes = ByteArrayOutputStream()
        DataOutputStream(bytes).use { add(value, it) }
        return Models.sha256(bytes.toByteArray())
    }

    private fun add(value: Any?, to: DataOutputStream) {
        when (value) {
            is Map<*, *> -> {
                to.write('{'.code)
                // Each byte of a key as one character, so that texts are compared as bytes are.
                for (key in value.keys.sortedBy { String((it as String).toByteArray(), Charsets.ISO_8859_1) }) {
                    add(key, to)
                    add(value[key], to)
                }
                to.write('}'.code)
            }

            is List<*> -> {
                to.write('['.code)
                for (entry in value) add(entry, to)
                to.write(']'.code)
            }

            is String -> {
                val data = value.toByteArray()
                to.write('s'.code)
                to.writeInt(data.size)
                to.write(data)
            }

            is Boolean -> to.write((if (value) 't' else 'f').code)

            is Number -> {
                to.write('n'.code)
                to.writeDouble(value.toDouble().let { if (abs(it) < HUGE) it + 0.0 else HUGE })
            }

            else -> to.write('0'.code)
        }
    }

    private const val HUGE = 1e300
    private const val DIGITS = "0123456789abcdef"
}

/** Reads a text from left to right. */
private class Parser(private val text: String, private val place: (String, IntRange) -> Unit) {
    private var at = 0
    private var depth = 0

    fun document(): Any? = value().also { if (blank() < text.length) fail("more follows") }

    private fun fail(what: String): Nothing = throw NotJson("$what at character $at")

    /** The place of the next character that is no blank. */
    private fun blank(): Int {
        while (at < text.length && text[at] in " \n\r\t") at++
        return at
    }

    private fun peek(): Char = if (blank() < text.length) text[at] else fail("the text ends")

    private fun take(wanted: Char) {
        if (peek() != wanted) fail("no '$wanted'")
        at++
    }

    private fun value(): Any? = when (peek()) {
        '{' -> members()
        '[' -> entries()
        '"' -> string()
        't' -> word("true", true)
        'f' -> word("false", false)
        'n' -> word("null", null)
        else -> number()
    }

    private fun word(word: String, value: Any?): Any? {
        if (!text.startsWith(word, at)) fail("no value")
        at += word.length
        return value
    }

    private fun members(): Map<String, Any?> {
        val members = LinkedHashMap<String, Any?>()
        inside('}') {
            if (peek() != '"') fail("no key")
            val key = string()
            take(':')
            if (key in members) throw NotJson("the same key twice in one object")
            val from = blank()
            members[key] = value()
            if (depth == 1) place(key, from until at)
        }
        return members
    }

    private fun entries(): List<Any?> = ArrayList<Any?>().also { all -> inside(']') { all.add(value()) } }

    private inline fun inside(end: Char, entry: () -> Unit) {
        at++
        if (++depth > DEEPEST) throw NotJson("nested too deep")
        if (peek() != end) {
            entry()
            while (peek() == ',') {
                at++
                entry()
            }
        }
        take(end)
        depth--
    }

    private fun digits(): Boolean {
        val from = at
        while (at < text.length && text[at] in '0'..'9') at++
        return at > from
    }

    private fun number(): Any {
        val from = at
        if (text[at] == '-') at++
        val zero = at < text.length && text[at] == '0'
        if (zero) at++
        if (!zero && !digits()) fail("no value")
        var whole = true
        if (at < text.length && text[at] == '.') {
            at++
            whole = false
            if (!digits()) fail("no digit")
        }
        if (at < text.length && text[at] in "eE") {
            at++
            whole = false
            if (at < text.length && text[at] in "+-") at++
            if (!digits()) fail("no digit")
        }
        val token = text.substring(from, at)
        if (!whole) return token.toDouble()
        if (token.length > LONGEST) fail("a number of too many digits")
        return token.toLongOrNull() ?: BigInteger(token)
    }

    private fun string(): String {
        val from = ++at
        while (at < text.length && text[at] != '"' && text[at] != '\\' && text[at] >= ' ') at++
        if (at < text.length && text[at] == '"') return text.substring(from, at++)
        val found = StringBuilder(text.substring(from, at))
        while (true) {
            val c = next()
            when {
                c == '"' -> return found.toString()
                c < ' ' -> fail("a control character")
                c != '\\' -> found.append(c)
                else -> found.append(escaped())
            }
        }
    }

    private fun next(): Char = if (at < text.length) text[at++] else fail("the text ends")

    private fun escaped(): Char = when (val c = next()) {
        '"', '\\', '/' -> c

        'b' -> '\b'

        'f' -> '\u000c'

        'n' -> '\n'

        'r' -> '\r'

        't' -> '\t'

        'u' -> {
            var code = 0
            repeat(4) {
                val digit = HEX.indexOf(next().lowercaseChar())
                if (digit < 0) fail("a wrong escape")
                code = 16 * code + digit
            }
            code.toChar()
        }

        else -> fail("a wrong escape")
    }

    private companion object {
        const val DEEPEST = 200
        const val LONGEST = 4300
        const val HEX = "0123456789abcdef"
    }
}
