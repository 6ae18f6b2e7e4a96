package org.camssf

import org.camssf.json.JsonText
import java.util.Collections

/**
 * What each refusal and each reason of the verdict says, from messages.json, which Python also reads. A key is the error
 * code and a name, for example "frames_differ.swapped".
 */
internal object Messages {
    private val PLACEHOLDER = Regex("""\{([a-z_]+)(?::(percent|fixed|general|scientific)([0-9]))?\}""")

    /** Text and advice of each key, with shared phrases filled in. */
    private val all: Map<String, Pair<String, String>> by lazy {
        val file = JsonText.parse(Shipped.text("messages.json")) as Map<*, *>
        val phrases = file["phrases"] as Map<*, *>
        fun whole(template: Any?) = PLACEHOLDER.replace(template as String) {
            phrases[it.groupValues[1]] as String? ?: it.value
        }
        (file["messages"] as Map<*, *>).entries.associate { (key, entry) ->
            key as String to (entry as Map<*, *>).let { whole(it["text"]) to whole(it["advice"]) }
        }
    }

    /** All keys. */
    val keys: Set<String> get() = all.keys

    /**
     * The reason with this message.
     *
     * @throws NoSuchElementException there is no such message, or a placeholder has no value.
     */
    fun reason(
        key: String,
        arguments: Map<String, Any>,
        value: Double?,
        threshold: Double?,
        fatal: Boolean = false,
    ): Reason {
        val (text, advice) = all.getValue(key)
        val plain = Collections.unmodifiableMap(arguments.mapValues { plain(it.value) })
        val code = key.substringBefore('.')
        return Reason(code, fill(text, plain), fill(advice, plain), value, threshold, fatal, key, plain)
    }

    /** Fills in the placeholders: `{name}`, `{name:percent1}`, `{name:fixed2}`, `{name:general6}`, `{name:scientific1}`. */
    fun fill(template: String, arguments: Map<String, Any>): String = PLACEHOLDER.replace(template) {
        val (name, kind, digits) = it.destructured
        val value = arguments.getValue(name)
        val number = (value as? Number)?.toDouble()
        when (if (number == null) "" else kind) {
            "percent" -> percent(number!!, digits.toInt())
            "fixed" -> fixed(number!!, digits.toInt())
            "general" -> general(number!!, digits.toInt())
            "scientific" -> scientific(number!!, digits.toInt())
            else -> value.toString()
        }
    }

    /** An argument as JSON can hold it: a finite number, or a text. */
    private fun plain(value: Any): Any = when (value) {
        is Int, is Long -> (value as Number).toLong()
        is Double -> if (value.isFinite()) value else fixed(value, 0)
        else -> value.toString()
    }
}
