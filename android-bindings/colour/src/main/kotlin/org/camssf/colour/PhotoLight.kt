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
        return lamps(lamp ?: Lamp.auto(), told = ratios != null).map {
            ReferenceRatios(it, ratios, noise, reference.tolerance)
        }
    }

    internal companion object {
        /**
         * The lamp, or the kinds of an unnamed one.
         *
         * @param told whether a reference's raw ratios tell the kinds apart.
         * @throws InvalidArgument several kinds, and nothing that tells them apart.
         */
        fun lamps(light: Lamp, told: Boolean): List<Lamp> {
            val kinds = light.lamps.mapNotNull { Lamp.kindOf(it.name) }.distinct()
            val lamps = if (light.unnamed) kinds.map { Lamp.read(it) } else listOf(light)
            if (lamps.size > 1 && !told) {
                throw InvalidArgument(
                    "The lamp is unknown, and nothing in the photo tells it.",
                    "Name the lamp; or measure a white or grey reference in the photo, and take a result that " +
                        "holds the light of its first photo: the whole result.json, not a passport, and not of an " +
                        "older version.",
                )
            }
            return lamps
        }

        /**
         * The response under each combination of lamps, and the combinations' weights.
         *
         * @throws InvalidArgument an unknown lamp without what tells it; a curve without a response to a lamp.
         * @throws LampUnfit a reference's raw ratios contradict its lamp.
         * @throws org.camssf.FramesDiffer a reference in a photo of another camera than the result's.
         * @throws org.camssf.UnitDiffers the same, of two cameras of one model.
         */
        fun responses(
            camera: ColourCamera,
            photos: List<PhotoLight>,
            view: View,
        ): Pair<List<SurfaceResponse>, DoubleArray> {
            val sources = photos.mapNotNull { it.reference.source }
            sources.forEach { camera.camera.check(it) }
            sources.zipWithNext { one, two ->
                val (first, second) = one.photo to two.photo
                PhysicalCamera.check(first.name, first.origin.camera.body, second.name, second.origin.camera.body)
            }
            val choices = photos.map { it.choices(camera) }
            if (photos.size > 1) {
                for (named in choices.filter { it.size == 1 }) check(SurfaceResponse.of(camera, named, view))
            }
            val combined = choices.fold(listOf(emptyList<ReferenceRatios>())) { combinations, lamps ->
                combinations.flatMap { before -> lamps.map { before + it } }
            }
            val responses = combined.map { SurfaceResponse.of(camera, it, view) }
            if (photos.size == 1) responses.singleOrNull()?.let { check(it) }
            val most = responses.maxOf { it.logEvidence }
            val odds = DoubleArray(responses.size) { exp(responses[it].logEvidence - most) }
            val whole = odds.sum()
            val weights = DoubleArray(odds.size) { odds[it] / whole }
            return responses to weights
        }

        private fun check(light: SurfaceResponse) {
            val chiSquared = light.chiSquared ?: return
            if (chiSquared > WhiteRatios.CONTRADICTED) {
                throw Refusal.of(
                    "lamp_unfit.reference", "lamp" to light.names.single(), "misfit" to chiSquared,
                    value = chiSquared, threshold = WhiteRatios.CONTRADICTED,
                )
            }
        }
    }
}
