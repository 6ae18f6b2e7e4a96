package org.camssf

import org.camssf.photo.Capture
import org.camssf.photo.Mosaic
import org.camssf.photo.PhotoSource
import org.camssf.photo.Shot
import org.camssf.photo.dng.DngReader
import org.camssf.photo.dng.DngSource
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import org.camssf.verdict.Reasons
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import java.io.File

/** messages.json: its words are filled in as Python fills them, and an app says them in another language. */
class MessagesTest {
    /** What an app in German holds: its own text and advice of each key that it meets here. */
    private val german = mapOf(
        "overexposed.white" to Pair(
            "Aufnahme {shot}: bis zu {share:percent1} der Werte eines Feldes sind übersteuert.",
            "Chart und Weiß mit kürzerer Belichtung neu aufnehmen.",
        ),
        "overexposed.few_left" to Pair(
            "Aufnahme {shot}: nur {left} von {all} Feldern sind brauchbar, nötig sind {least}.",
            "Das Foto mit kürzerer Belichtung neu aufnehmen.",
        ),
        "glare.veil" to Pair(
            "Aufnahme {shot}: dunkle Felder sind zu hell, Streulicht fügt {amount:percent1} Weiß hinzu.",
            "Das Objektiv abschatten.",
        ),
    )

    /** The app's own text and advice; the English ones for a key that it does not know yet. */
    private fun inGerman(reason: Reason): Pair<String, String> {
        val (text, advice) = german[reason.key] ?: return reason.message to reason.advice
        return reason.inWords(text) to reason.inWords(advice)
    }

    private fun numbers(text: String) = Regex("""\d+(\.\d+)?%?""").findAll(text).map { it.value }.toList()

    @Test
    fun `an overexposed photo is refused in German`() {
        val whole = DngReader.read(
            DngSource.of(File(System.getProperty("camssf.root"), "golden/dng/chart-turned-0.dng")),
        )
        val sensor = Mosaic.Sensor(whole.sensor.cfa, whole.sensor.black.toDoubleArray(), whole.samples.max() / 4.0)
        val bright = Mosaic(whole.origin, whole.width, whole.height, whole.region, whole.samples, sensor)
        val capture =
            Capture(Shot(PhotoSource.of(bright), Lamp.read("E"), chartCorners), ChartTable.read("classic24"))
        val refused = opened("phones").use { it.calibrateBlocking(capture) } as Refused
        val reason = refused.error.reason
        assertEquals(listOf(reason), refused.verdict.reasons)
        val (text, advice) = inGerman(reason)
        assertTrue(text.startsWith("Aufnahme 1: ") && advice.endsWith("neu aufnehmen."), "$reason")
        assertTrue(numbers(text).isNotEmpty() && numbers(reason.message).containsAll(numbers(text)), text)
        assertTrue("\"key\":\"${reason.key}\"" in refused.toJson().replace(": ", ":"))
    }

    @Test
    fun `a reason of the verdict is said in German`() {
        val reason = Reasons.because("veil", 9.0, mapOf("shot" to 2, "amount" to 0.0312))
        assertEquals(
            "shot 2: dark patches are too bright. Stray light or a wrong black level adds 3.1% of white to all patches.",
            reason.message,
        )
        assertEquals(mapOf("shot" to 2L, "amount" to 0.0312), reason.arguments)
        assertEquals(
            "Aufnahme 2: dunkle Felder sind zu hell, Streulicht fügt 3.1% Weiß hinzu." to "Das Objektiv abschatten.",
            inGerman(reason),
        )
        val new = Refusal.of("unreadable_raw.missing", "file" to "a.dng").reason
        assertEquals("There is no file a.dng." to "Check the path.", inGerman(new))
    }

    @Test
    fun placeholders() {
        val values = mapOf("a" to 0.125, "n" to 12L, "t" to "x", "s_t" to 1234567.0)
        assertEquals(
            "12.5% 12% 0.12 12 x 1.23457e+06 1.2e+06 x",
            Messages.fill(
                "{a:percent1} {a:percent0} {a:fixed2} {n} {t} {s_t:general6} {s_t:scientific1} {t:fixed1}",
                values,
            ),
        )
        assertThrows(NoSuchElementException::class.java) { Messages.fill("{b}", values) }
    }

    @Test
    fun `a number that is not finite is a text`() {
        val reason = Refusal.of("not_converged.gap", "gap" to Double.NaN).reason
        assertEquals(mapOf<String, Any>("gap" to "nan"), reason.arguments)
        assertEquals("The solver did not converge: relative duality gap nan.", reason.message)
    }

    @Test
    fun `an unknown message, or one without its values, is misuse`() {
        for (call in listOf({ Refusal.of("glare.mist") }, { Refusal.of("unreadable_raw.missing") })) {
            val error: Misuse = assertThrows(InvalidArgument::class.java) { call() }
            assertTrue("messages.json" in error.advice)
        }
    }
}
