package org.camssf.colour

import org.camssf.InvalidArgument
import org.camssf.Rules
import org.camssf.recovery.Tensor
import kotlin.math.exp
import kotlin.math.ln
import kotlin.math.max
import kotlin.math.sqrt

/**
 * A prior distribution of reflectance: a mixture of N Gaussians, one at each measured surface. Reflectances are divided
 * by their mean over the nodes first. The covariance of the i-th is h_i² C + F + Σ_c (s_i g_c)(s_i g_c)ᵀ
 * (docs/spectrum.md). Immutable; safe to share between threads.
 *
 * @property name "general" or "skin".
 * @property arrays what the model takes: `shapes` (N, 35) s_i, of mean 1; `variances` (N, 2) h_i² and 1 of the `shared`
 *   covariances (2, 35, 35) C and F; `changes` (q, 35) g_c, relative changes of reflectance, one standard deviation
 *   each, zeros if there are none; `log_weights` (N), up to a constant.
 */
public class SurfacePrior private constructor(public val name: String, internal val arrays: Map<String, Tensor>) {
    override fun toString(): String = "SurfacePrior($name)"

    public companion object {
        /**
         * The prior of a name: "general" (760 surfaces and 97 skins, each skin counted eight times) or "skin" (the 97
         * skins, widened by changes of haemoglobin and bilirubin within one person).
         *
         * @throws InvalidArgument another name.
         */
        @JvmStatic
        public fun read(name: String): SurfacePrior = when (name) {
            "general" -> general
            "skin" -> skin
            else -> throw InvalidArgument("No prior is called '$name'.", "Take general or skin.")
        }

        private val general: SurfacePrior by lazy {
            val (general, skins) = listOf("general", "skin").map { Tables.library(it) }
            val weights = DoubleArray(general.size + skins.size) { if (it < general.size) 0.0 else ln(SKINS_COUNT) }
            of("general", general + skins, weights, listOf(DoubleArray(SurfaceNodes.SIZE)))
        }

        private val skin: SurfacePrior by lazy {
            val skins = Tables.library("skin")
            of("skin", skins, DoubleArray(skins.size), changesOfSkin())
        }

        private fun of(
            name: String,
            reflectances: List<DoubleArray>,
            logWeights: DoubleArray,
            changes: List<DoubleArray>,
        ): SurfacePrior {
            val shapes = reflectances.map { row ->
                val mean = row.sum() / row.size
                DoubleArray(row.size) { row[it] / mean }
            }
            val common = Array(SurfaceNodes.SIZE) { DoubleArray(SurfaceNodes.SIZE) }
            val radius = DoubleArray(shapes.size) { i ->
                val differences = nearest(shapes, i).map { j ->
                    DoubleArray(SurfaceNodes.SIZE) { shapes[j][it] - shapes[i][it] }
                }
                val squares = differences.map { dot(it, it) / it.size }
                for ((difference, square) in differences.zip(squares)) {
                    val share = 1 / (max(sqrt(square), 1e-9).let { it * it } * NEIGHBOURS * shapes.size)
                    for (a in common.indices) add(common[a], share * difference[a], difference)
                }
                sqrt(squares.sum() / NEIGHBOURS)
            }
            val least = NARROWEST * median(radius)
            val variances = radius.map { r -> doubleArrayOf((WIDTH * max(r, least)).let { it * it }, 1.0) }
            val arrays = mapOf(
                "shapes" to tensor(shapes),
                "variances" to tensor(variances),
                "shared" to Tensor.stack(listOf(common, fine()).map { tensor(it.asList()) }),
                "changes" to tensor(changes),
                "log_weights" to Tensor(logWeights, logWeights.size),
            )
            return SurfacePrior(name, arrays)
        }

        private fun nearest(shapes: List<DoubleArray>, to: Int): List<Int> {
            val distance = DoubleArray(shapes.size) { i ->
                var total = 0.0
                for (n in shapes[i].indices) (shapes[i][n] - shapes[to][n]).let { total += it * it }
                total
            }
            val limit = distance.sortedArray()[NEIGHBOURS] // the first is its own
            val near = shapes.indices.filter { it != to && distance[it] <= limit }
            return near.sortedBy { distance[it] }.take(NEIGHBOURS)
        }

        private fun median(values: DoubleArray): Double {
            val sorted = values.sortedArray()
            return 0.5 * (sorted[(sorted.size - 1) / 2] + sorted[sorted.size / 2])
        }

        /** Of each absorber a layer above everything, and one that light reaches the less the more it is absorbed. */
        private fun changesOfSkin(): List<DoubleArray> = Tables.changes().flatMap { (name, sizes) ->
            val (a, above, below) = Triple(Tables.absorber(name), sizes[0], sizes[1])
            listOf(
                DoubleArray(a.size) { -above * a[it] },
                DoubleArray(a.size) { -below * a[it] * (1 + SATURATION) / (a[it] + SATURATION) },
            )
        }.filter { change -> change.any { it != 0.0 } }

        /** F (35) of (35): the fine structure that no neighbour shows, for a mean of 1. */
        private fun fine() = SurfaceNodes.wavelengths.let { nm ->
            Array(nm.size) { a ->
                DoubleArray(nm.size) { b ->
                    val step = (nm[a] - nm[b]) / ROUGHNESS_CORRELATION
                    ROUGHNESS * ROUGHNESS * exp(-0.5 * step * step)
                }
            }
        }

        private fun number(word: String) = Rules.shipped.number("surfaces.$word")
        private val NEIGHBOURS get() = Rules.shipped.whole("surfaces.neighbours")
        private val WIDTH get() = number("width")
        private val NARROWEST get() = number("narrowest")
        private val ROUGHNESS get() = number("roughness")
        private val ROUGHNESS_CORRELATION get() = number("roughness_correlation")
        private val SKINS_COUNT get() = number("skins_count")
        private val SATURATION get() = number("saturation")
    }
}
