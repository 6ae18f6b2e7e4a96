package org.camssf.dng

import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import org.junit.jupiter.api.Timeout

/** The first files of [Fuzz]; its main runs any number. */
class FuzzTest {
    @Test
    @Timeout(60)
    fun damagedFilesAreReadOrRefused() {
        val fuzz = Fuzz()
        for (seed in 0L until 3000L) fuzz.once(seed)
        assertTrue(fuzz.slowest < 2_000_000_000, "seed ${fuzz.slowestSeed}: ${fuzz.slowest} ns")
        assertTrue(fuzz.read > 300, "the damage is too heavy: ${fuzz.read} files read")
        assertTrue(fuzz.refused.size > 30, "the damage is too uniform: ${fuzz.refused.keys}")
    }
}
