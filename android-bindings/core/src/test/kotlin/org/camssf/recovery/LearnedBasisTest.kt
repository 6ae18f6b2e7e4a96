package org.camssf.recovery

import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertNull
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test

class LearnedBasisTest {
    @Test
    fun `a learned basis is the model's, and no other name or hash has one`() {
        val hash = listOf("phones", "cameras").associateWith { BasisConstants.of(it)!!.roundedSha256 }
        for ((name, sha256) in hash) {
            val basis = LearnedBasis.of(name, sha256)!!
            assertEquals(24, basis.atoms)
            for (c in 0..2) {
                val top = basis.mean[c].indices.maxByOrNull { basis.mean[c][it] }!!
                assertTrue(380 + 0.5 * top in listOf(570.0..640.0, 510.0..570.0, 430.0..490.0)[c], "$name $c $top")
            }
        }
        assertNull(LearnedBasis.of("phones", hash["cameras"]))
        assertNull(LearnedBasis.of("gaussian", hash["cameras"]))
    }
}
