package org.camssf.photo.dng

import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import org.junit.jupiter.api.Timeout

/** The first files of [Fuzz]; its main runs any number. */
class FuzzTest {
    @Test
    @Timeout(600)
    fun damagedFilesAreReadOrRefused() {
        val fuzz = Fuzz()
        for (seed in 0L until 10_000L) fuzz.once(seed)
        assertTrue(fuzz.read > 1_000, "the damage is too heavy: ${fuzz.read} files read")
        // a byte of deflate may hold 1032 samples of 8 bits, 2 bytes each in memory, and the files have a few kB
        assertTrue(fuzz.hungriest < 1L shl 21, "seed ${fuzz.hungriestSeed}: ${fuzz.hungriest} bytes")
        assertTrue(fuzz.refused.size > 30, "the damage is too uniform: ${fuzz.refused.keys}")
    }
}
