package org.camssf.json

/** The members of an object in a file of known form; a value of another type is a ClassCastException. */
internal typealias Members = Map<String, Any?>

/** A value as an object. */
@Suppress("UNCHECKED_CAST")
internal fun members(value: Any?): Members = value as Members

internal fun Members.part(name: String): Members = members(getValue(name))

internal fun Members.list(name: String): List<Any?> = getValue(name) as List<Any?>

internal fun Members.text(name: String): String = getValue(name) as String

internal fun Members.texts(name: String): List<String> = list(name).map { it as String }

internal fun Members.number(name: String): Double = (getValue(name) as Number).toDouble()

internal fun Members.whole(name: String): Int = (getValue(name) as Long).toInt()

internal fun Members.numbers(name: String): DoubleArray = numbers(getValue(name))

/** From the first to the second of two numbers. */
internal fun Members.range(name: String): ClosedFloatingPointRange<Double> =
    numbers(name).let { (least, most) -> least..most }

/** A list of numbers. */
internal fun numbers(value: Any?): DoubleArray =
    (value as List<*>).let { list -> DoubleArray(list.size) { (list[it] as Number).toDouble() } }
