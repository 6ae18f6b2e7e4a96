package org.camssf.forms

import org.camssf.CalibrationException
import org.camssf.InvalidArgument
import org.camssf.Rows
import org.camssf.Shipped
import org.camssf.decimal
import org.camssf.general
import org.camssf.json.JsonText
import org.camssf.json.NotJson
import java.math.BigDecimal
import java.math.BigInteger
import kotlin.math.abs

/** The place of a fault in a document, and what is wrong there. */
internal class BrokenDocument(val place: String, val what: String) : IllegalArgumentException("$place $what")

/** Throws [BrokenDocument] unless it is right. */
internal fun need(right: Boolean, place: String, what: () -> String) {
    if (!right) throw BrokenDocument(place, what())
}

/** A part of a document that was read and checked: its fields by name, with their defaults. */
internal class Fields(private val values: Map<String, Any?>) {
    /** A field's value; of an array [Rows], of a part [Fields], of a whole number a Long. */
    operator fun get(name: String): Any? = values.getValue(name)

    fun text(name: String): String = this[name] as String

    fun flag(name: String): Boolean = this[name] as Boolean

    fun number(name: String): Double = this[name] as Double

    fun maybeNumber(name: String): Double? = this[name] as Double?

    fun whole(name: String): Int = (this[name] as Long).toInt()

    fun array(name: String): DoubleArray = (this[name] as Rows).values

    fun maybe(name: String): Fields? = this[name] as Fields?

    fun part(name: String): Fields = this[name] as Fields

    @Suppress("UNCHECKED_CAST")
    fun <T> list(name: String): List<T> = this[name] as List<T>

    @Suppress("UNCHECKED_CAST")
    fun <T> map(name: String): Map<String, T> = this[name] as Map<String, T>
}

/**
 * Reads and writes documents, "camssf/2", by the table of their parts, forms.json. Python's `documents.forms` has
 * the same rules and words.
 *
 * @param own readers of parts that have a form of their own, by name; they get the plain value and its place.
 * @param checks what one field of a part says against another, by the part's name; they throw [BrokenDocument].
 */
internal class Forms(
    private val own: Map<String, (Any?, String) -> Any?>,
    private val checks: Map<String, (Fields) -> Unit>,
) {
    /**
     * Reads a document.
     *
     * @param name of its source, for messages.
     * @param advice what to do if it is another document.
     * @throws InvalidArgument it is no such document; the message names the place of the first fault.
     */
    fun read(text: String, name: String, advice: String): Fields {
        if (text.length > LARGEST) throw InvalidArgument("$name is larger than $LARGEST characters.", advice)
        val plain = try {
            JsonText.parse(text)
        } catch (error: NotJson) {
            throw InvalidArgument("$name is not valid JSON (${error.message}).", advice, cause = error)
        }
        try {
            return part(DOCUMENT, unsealed(plain), "")
        } catch (error: BrokenDocument) {
            val place = error.place.trimStart('.').ifEmpty { "the document" }
            throw InvalidArgument("$name: $place ${error.what}.", advice, cause = error)
        }
    }

    /** The document without its hash, which must be that of the rest. */
    private fun unsealed(plain: Any?): Any? {
        if (plain !is Map<*, *> || HASH !in plain) return plain
        checkFormat(plain)
        val rest = plain - HASH
        need(plain[HASH] == JsonText.hash(rest), HASH) {
            "is not the hash of the rest: something was changed after it was written. Give the file as it was " +
                "written, or take out \"$HASH\" if the change was meant"
        }
        return rest
    }

    private fun part(name: String, value: Any?, place: String): Fields {
        need(value is Map<*, *>, place) { "must be an object${shown(value)}" }
        val members = value as Map<*, *>
        val rows = PARTS.getValue(name)
        if (name == DOCUMENT) checkFormat(members)
        for (key in members.keys) need(key in rows, place) { "has the unknown key ${JsonText.write(key).take(80)}" }
        val missing = rows.filter { (key, form) -> key !in members && DEFAULT !in form }.keys
        need(missing.isEmpty(), place) { "lacks ${missing.joinToString()}" }
        val found = HashMap<String, Any?>()
        for ((key, entry) in members) found[key as String] = value(rows.getValue(key), entry, "$place.$key")
        for ((key, form) in rows) if (key !in members) found[key] = value(form, form[DEFAULT], "$place.$key")
        return Fields(found).also { fields ->
            try {
                checks[name]?.invoke(fields)
            } catch (error: BrokenDocument) {
                throw BrokenDocument(if (error.place.isEmpty()) place else "$place.${error.place}", error.what)
            }
        }
    }

    private fun checkFormat(members: Map<*, *>) {
        val word = members["format"]
        if (word == FORMAT) return
        need(word is String && word.startsWith("camssf"), "") {
            "is not $FORMAT: it has no \"format\": \"$FORMAT\""
        }
        val older = (word as String).substringBefore('/') in OLDER
        val why =
            if (older) "; that form was never released, so measure or calibrate the photos anew" else ""
        throw BrokenDocument("", "is ${word.take(40)}, not $FORMAT$why")
    }

    /** A plain value as its form says. */
    private fun value(form: Map<String, Any?>, value: Any?, place: String): Any? {
        if (value == null && form["null"] == true) return null
        return when (form["is"]) {
            "array" -> ArrayReader(form, place).read(value)

            "text" -> text(form, value, place)

            "number", "whole" -> number(form, value, place)

            "flag" -> value.also { need(it is Boolean, place) { "must be true or false${shown(it)}" } }

            "words" -> value.also {
                val words = form.list("words")
                need(it in words, place) {
                    "must be ${words.joinToString(" or ") { JsonText.write(it) }}${shown(value)}"
                }
            }

            "list" -> entries(form, value, place)

            "tuple" -> {
                val kinds = form.list("of")
                need(value is List<*>, place) { "must be a list${shown(value)}" }
                val all = value as List<*>
                need(all.size == kinds.size, place) { "must hold ${kinds.size} entries, holds ${all.size}" }
                all.mapIndexed { i, entry -> value(form(kinds[i]), entry, "$place[$i]") }
            }

            "map" -> {
                need(value is Map<*, *>, place) { "must be an object${shown(value)}" }
                (value as Map<*, *>).entries.associate { (key, entry) ->
                    text(form(form["key"]), key, place) to value(form(form["of"]), entry, "$place.$key")
                }
            }

            "argument" -> when (value) {
                is String -> text(form, value, place)
                is Number -> number(form + ("is" to if (isWhole(value)) "whole" else "number"), value, place)
                else -> throw BrokenDocument(place, "must be a text or a number${shown(value)}")
            }

            "either" -> either(form(form["of"]), value, place)

            "own" -> try {
                own.getValue(form["name"] as String)(value, place.trimStart('.'))
            } catch (error: CalibrationException) {
                throw BrokenDocument(place, "is no such form: ${error.message.trimEnd('.')}")
            }

            else -> part(form["name"] as String, value, place)
        }
    }

    private fun text(form: Map<String, Any?>, value: Any?, place: String): String {
        need(value is String, place) { "must be a text${shown(value)}" }
        val text = value as String
        val most = (form["most"] as Long?)?.toInt() ?: LONGEST
        need(text.codePointCount(0, text.length) <= most, place) { "must have at most $most characters" }
        val pattern = form["pattern"] as String?
        need(pattern == null || Regex(pattern).matches(text), place) { "${form["words"]}${shown(value)}" }
        return text
    }

    private fun number(form: Map<String, Any?>, value: Any?, place: String): Any {
        val whole = form["is"] == "whole"
        val right = if (whole) isWhole(value) else value is Double || (value is Long && abs(value) <= MOST)
        need(right, place) { "must be a ${if (whole) "whole " else ""}number${shown(value)}" }
        val (least, most) = form.limits()
        val number = (value as Number).toDouble()
        need(number in least..most, place) {
            "must lie between ${general(least)} and ${general(most)}${shown(if (whole) value else number)}"
        }
        return if (whole) value else number
    }

    private fun entries(form: Map<String, Any?>, value: Any?, place: String): List<Any?> {
        need(value is List<*>, place) { "must be a list${shown(value)}" }
        val all = value as List<*>
        val (least, most) = form.limits()
        need(all.size.toDouble() in least..most, place) {
            "must hold ${general(maxOf(least, 0.0))} to ${general(most)} entries, holds ${all.size}"
        }
        val kind = form(form["of"])
        return all.mapIndexed { i, entry -> value(kind, entry, "$place[$i]") }
    }

    private fun either(kinds: Map<String, Any?>, value: Any?, place: String): Any? {
        need(value is Map<*, *>, place) { "must be an object${shown(value)}" }
        val members = value as Map<*, *>
        val word = members[KIND]
        need(word in kinds, "$place.$KIND") {
            "must be ${kinds.keys.joinToString(" or ") { "\"$it\"" }}${shown(word)}"
        }
        return value(form(kinds[word]), members - KIND, place)
    }

    /** Reads nested lists of numbers, each checked. */
    private class ArrayReader(form: Map<String, Any?>, private val place: String) {
        private val sides = form.list("sides").map { (it as Long?)?.toInt() ?: ANY }.toIntArray()
        private val whole = form["whole"] == true
        private val gaps = form["gaps"] == true
        private val mayBeEmpty = form["fewest"] == 0L
        private val least = form.limits().first
        private val most = form.limits().second
        private val at = IntArray(sides.size)
        private var values = DoubleArray(72)
        private var size = 0

        fun read(value: Any?): Rows {
            if (mayBeEmpty && value is List<*> && value.isEmpty()) {
                return Rows(DoubleArray(0), *sides.also { it[0] = 0 })
            }
            rows(value, 0)
            return Rows(values.copyOf(size), *sides)
        }

        private fun add(number: Double) {
            if (size == values.size) values = values.copyOf(2 * size)
            values[size++] = number
        }

        private fun rows(value: Any?, axis: Int) {
            if (axis == sides.size) return number(value)
            if (value == null && gaps && axis == sides.size - 1) return repeat(sides[axis]) { add(Double.NaN) }
            if (value !is List<*>) fail(axis, "must be a list${shown(value)}")
            if (sides[axis] == ANY) sides[axis] = value.size
            if (value.isEmpty()) fail(axis, "must not be empty")
            if (value.size != sides[axis]) fail(axis, "must hold ${sides[axis]} entries, holds ${value.size}")
            for (i in value.indices) {
                at[axis] = i
                rows(value[i], axis + 1)
            }
        }

        private fun number(value: Any?) {
            val number = (value as? Number)?.toDouble()
            if (number == null || (whole && !isWhole(value)) || !(number >= least && number <= most)) {
                val word = if (whole) "a whole number" else "a number"
                fail(sides.size, "must be $word from ${general(least)} to ${general(most)}${shown(value)}")
            }
            add(number)
        }

        private fun fail(axis: Int, what: String): Nothing =
            throw BrokenDocument(place + at.take(axis).joinToString("") { "[$it]" }, what)
    }

    companion object {
        const val FORMAT = "camssf/2"

        /** Key of the kind of a lamp. */
        const val KIND = "kind"

        /** Last key of a document: the hash of its content. */
        private const val HASH = "sha256"
        private const val DOCUMENT = "Document"
        private const val DEFAULT = "default"
        private const val LARGEST = 64 shl 20
        private const val LONGEST = 4096
        private const val MOST = 1e12
        private const val ANY = -1
        private val OLDER = setOf("camssf-result", "camssf-patches", "camssf-shot")

        @Suppress("UNCHECKED_CAST")
        private val PARTS by lazy {
            JsonText.parse(Shipped.text("forms.json")) as Map<String, Map<String, Map<String, Any?>>>
        }

        /**
         * A part in plain values, its fields in the table's order, without those that have their default.
         *
         * @param values of all fields but those that have their default; an array as its numbers row by row, or as
         *   [Rows] where its sides do not follow from how many there are.
         */
        fun plain(part: String, vararg values: Pair<String, Any?>): Map<String, Any?> {
            val given = mapOf(*values)
            val rows = PARTS.getValue(part)
            check(given.keys.all { it in rows }) { "$part has no ${given.keys - rows.keys}" }
            val found = LinkedHashMap<String, Any?>()
            for ((name, form) in rows) {
                check(name in given || DEFAULT in form) { "$part lacks $name" }
                val value = if (name in given) plain(form, given[name]) else form[DEFAULT]
                if (DEFAULT !in form || value != form[DEFAULT]) found[name] = value
            }
            return found
        }

        /** A whole document as text, its last key the hash of its content. */
        fun write(document: Map<String, Any?>): String =
            JsonText.write(document + (HASH to JsonText.hash(document))) + "\n"

        private fun plain(form: Map<String, Any?>, value: Any?): Any? = when (value) {
            is DoubleArray -> plain(form, numbers(form, value))
            is LongArray -> plain(form, numbers(form, DoubleArray(value.size) { value[it].toDouble() }))
            is IntArray -> plain(form, numbers(form, DoubleArray(value.size) { value[it].toDouble() }))
            is Rows -> value.nested(form["whole"] == true, form["gaps"] == true)
            is Int -> value.toLong()
            is List<*> -> value.map { plain(form, it) }
            is Map<*, *> -> if (form["is"] == "map") sorted(value) else value
            else -> value
        }

        private fun sorted(value: Map<*, *>) =
            value.entries.sortedBy { it.key as String }.associate { it.key to it.value }

        /** Rows in one row, as the array of this form; at most one of its sides is open. */
        private fun numbers(form: Map<String, Any?>, values: DoubleArray): Rows {
            val sides = form.list("sides").map { (it as Long?)?.toInt() ?: ANY }.toIntArray()
            val known = sides.filter { it != ANY }.fold(1) { all, side -> all * side }
            return Rows(values, *IntArray(sides.size) { if (sides[it] == ANY) values.size / known else sides[it] })
        }

        @Suppress("UNCHECKED_CAST")
        private fun form(value: Any?) = value as Map<String, Any?>

        private fun Map<String, Any?>.list(name: String): List<Any?> = getValue(name) as List<Any?>

        private fun Map<String, Any?>.limits(): Pair<Double, Double> =
            ((this["least"] as Number?)?.toDouble() ?: -MOST) to ((this["most"] as Number?)?.toDouble() ?: MOST)

        private fun isWhole(value: Any?): Boolean = value is Long || value is BigInteger

        /** ", is 'x'": the faulty value for the message, if it is short. */
        private fun shown(value: Any?): String = when (value) {
            is Map<*, *> -> ", is an object"
            is List<*> -> ", is a list"
            is BigInteger -> if (value.bitLength() > 200) ", is too large" else ", is ${clipped(value.toString())}"
            is Double -> ", is ${if (value.isInfinite()) "Infinity" else decimal(BigDecimal(value.toString()), 16)}"
            else -> ", is ${clipped(JsonText.write(value))}"
        }

        private fun clipped(text: String) = if (text.length <= 60) text else text.take(60) + "…"
    }
}
