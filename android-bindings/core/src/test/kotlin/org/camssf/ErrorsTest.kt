package org.camssf

import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Test
import java.io.File
import java.lang.reflect.Modifier

/** One vocabulary of refusals in both languages. */
class ErrorsTest {
    private val root = System.getProperty("camssf.root")

    /** Every class of this package that can be thrown as a [CalibrationException]. */
    private val kinds = File(CalibrationException::class.java.protectionDomain.codeSource.location.toURI())
        .resolve("org/camssf").listFiles()!!
        .filter { it.extension == "class" }
        .map { Class.forName("org.camssf.${it.nameWithoutExtension}", false, javaClass.classLoader) }
        .filter { CalibrationException::class.java.isAssignableFrom(it) && !Modifier.isAbstract(it.modifiers) }

    private val codes = kinds.associate { kind ->
        val code = kind.simpleName.replace(Regex("(?<!^)[A-Z]")) { "_${it.value}" }.lowercase()
        val made = when (code) {
            "invalid_argument" -> InvalidArgument("What.", "How.")
            "runtime_unfit" -> RuntimeUnfit("What.", "How.")
            "passport_invalid" -> PassportInvalid("What.", "How.")
            else -> Refusal.of(Reason(code, "What.", "How.", null, null))
        }
        assertEquals(kind, made.javaClass)
        kind.simpleName to made.code
    }

    @Test
    fun `the codes are Python's`() {
        val text = File(root, "reference/camssf/errors.py").readText()
        val known = Regex("""(?m)^ {4}code(?:: ClassVar\[str])? = "(\w+)"$""").findAll(text).map { it.groupValues[1] }
        // ONNX Runtime's version is the app's build's; in Python pip pins it.
        val wanted = known.toSet() - "calibration_error" + "runtime_unfit"
        assertEquals(wanted.sorted(), codes.values.sorted())
    }

    @Test
    fun `the tree in the documentation names each with its code`() {
        val tree = File(root, "android-bindings/core/src/main/kotlin/org/camssf/Errors.kt").readText()
        val leaves = Regex("""(?m)^ \* [^\w\n]*── (\w+) {1,20}([a-z_]+)\b""").findAll(tree)
        assertEquals(codes, leaves.associate { it.groupValues[1] to it.groupValues[2] })
    }
}
