package org.camssf.colour

import org.camssf.InvalidArgument
import org.camssf.LampUnfit
import org.camssf.Refusal
import org.camssf.photo.PhysicalCamera
import org.camssf.spectra.Lamp
import kotlin.math.exp
import kotlin.math.hypot
import kotlin.math.ln

/**
 * The light of a photo.
 *
 * @property lamp by name, by kind or measured; null, as `Lamp.auto()`, mixes the four kinds by their likelihood given
 *   the reference's raw ratios; `Lamp.torch()` is a white LED.
 * @property reference a white or grey surface in that light.
 */
public class PhotoLight internal constructor(
    public val lamp: Lamp?,
    public val reference: Reference,
    private val raw: DoubleArray?,
    private val error: Double,
) {
    public constructor(lamp: Lamp?, reference: Reference) : this(
        lamp,
        reference,
        reference.sharedRaw,
        (0..2).maxOf { reference.sharedError[it] / reference.sharedRaw[it] },
    )

    override fun toString(): String = "PhotoLight(${lamp?.name ?: "unnamed"}, $reference)"

    /** The lamp, or the four kinds, with what the reference says of them. */
    private fun choices(camera: ColourCamera): List<ReferenceRatios> {
        val ratios = if (raw == null || camera.ownWhite == null) {
            null
        } else {
            doubleArrayOf(ln(raw[0] / raw[1]), ln(raw[2] / raw[1]))
        }
        val noise = hypot(error, reference.tolerance / 2)
        val light = lamp ?: Lamp.auto()
        val lamps = if (light.unnamed) light.kinds else listOf(light)
        if (lamps.size > 1 && ratios == null) {
            throw InvalidArgument(
                "The lamp is unknown, and nothing in the photo tells it.",
                "Name the lamp; or measure a white or grey reference in the photo, and take a result that holds " +
                    "the light of its first photo: the whole result.json, not a passport, and not of an older version.",
            )
        }
        return lamps.map { ReferenceRatios(it, ratios, noise) }
    }

    internal companion object {
        /**
         * For each combination of lamps one light for each photo, with curves that are the same in all; and the
         * combinations' weights.
         *
         * @throws InvalidArgument an unknown lamp without what tells it.
         * @throws LampUnfit a reference's raw ratios contradict its lamp.
         * @throws org.camssf.FramesDiffer a reference in a photo of another camera than the result's.
         * @throws org.camssf.UnitDiffers the same, of two cameras of one model.
         */
        fun lights(camera: ColourCamera, photos: List<PhotoLight>): Pair<List<List<Light>>, DoubleArray> {
            val sources = photos.mapNotNull { it.reference.source }
            sources.forEach { camera.camera.check(it) }
            sources.zipWithNext { one, two ->
                val (first, second) = one.photo to two.photo
                PhysicalCamera.check(first.name, first.origin.camera.body, second.name, second.origin.camera.body)
            }
            val choices = photos.map { it.choices(camera) }
            for (lamps in choices) lamps.singleOrNull()?.let { check(Light.of(camera, listOf(it)).single()) }
            val combined = choices.fold(listOf(emptyList<ReferenceRatios>())) { combinations, lamps ->
                combinations.flatMap { before -> lamps.map { before + it } }
            }
            val lights = combined.map { Light.of(camera, it) }
            val most = lights.maxOf { it[0].logEvidence }
            val odds = DoubleArray(lights.size) { exp(lights[it][0].logEvidence - most) }
            val whole = odds.sum()
            val weights = DoubleArray(odds.size) { odds[it] / whole }
            if (!weights.all { it.isFinite() }) throw NoColour.error()
            return lights to weights
        }

        private fun check(light: Light) {
            val chiSquared = light.chiSquared ?: return
            if (chiSquared > CONTRADICTED) {
                throw Refusal.of(
                    "lamp_unfit.reference", "lamp" to light.name, "misfit" to chiSquared, value = chiSquared,
                    threshold = CONTRADICTED,
                )
            }
        }

        /**
         * χ² of the reference's two ratios above which the named lamp is rejected; its probability is 1 in 10,000.
         */
        private const val CONTRADICTED = 18.4
    }
}
