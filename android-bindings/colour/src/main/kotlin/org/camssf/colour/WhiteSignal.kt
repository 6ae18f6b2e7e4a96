package org.camssf.colour

import org.camssf.InvalidArgument
import org.camssf.Rules
import org.camssf.photo.Facts
import org.camssf.spectra.Directions
import org.camssf.spectra.Lamp

/**
 * What the raw signals of a picture are divided by.
 *
 * @property raw (3) raw signal of a perfect white diffuser in this photo, DN above black.
 * @property fromReference whether a white or grey surface was measured. Else `raw` has the ratios that the calibration
 *   gives for the lamp, and a level at which the first channel saturates.
 * @property photonNoise (3) variance of a sample over its signal, relative to `raw`; zeros if it is not known.
 */
internal class WhiteSignal(val raw: DoubleArray, val fromReference: Boolean, val photonNoise: DoubleArray) {
    companion object {
        /** Relative error of the calibration's own white by target, drift and noise; its lamp's error is added. */
        val OWN_WHITE get() = Rules.shipped.number("colour.own_white")

        /**
         * The white signal by a reference.
         *
         * @param factor what brings raw signals of the photo to the exposure of the reference.
         * @param source of the photo's signals.
         */
        fun of(reference: Reference, factor: Double, source: SignalSource): WhiteSignal {
            val raw = DoubleArray(3) { 1.0 / reference.scale[it] / factor }
            val photonNoise = reference.sharedPhotonNoise ?: return WhiteSignal(raw, true, DoubleArray(3))
            // The noise of photons depends on the exposure time alone, since ISO scales signal and noise.
            val longer = reference.source?.timeOver(source) ?: 1.0
            return WhiteSignal(raw, true, DoubleArray(3) { photonNoise[it] * reference.scale[it] * longer })
        }

        /**
         * The white signal without a reference, by the calibration; and the light, whose errors and those of the
         * calibration's own white are then errors of the white signal, too.
         *
         * @throws InvalidArgument a light that is not named, or a result without the light of its first photo.
         */
        fun of(camera: ColourCamera, lamp: Lamp, photo: Facts): Pair<WhiteSignal, ReferenceRatios> {
            val own = camera.ownWhite ?: throw InvalidArgument(
                "This result does not hold the light of its first photo, so the white balance of a photo without a " +
                    "reference is unknown.",
                "Measure a white or grey surface in the photo, or take the whole result.json.",
            )
            val light = PhotoLight.lamps(lamp, told = false).single()
            val ratios = DoubleArray(3) {
                val curve = camera.values[it]
                own.raw[it] * dot(light.sharedValues, curve) / dot(own.lamp.sharedValues, curve)
            }
            val level = (0..2).minOf { (photo.sensor.white - black(photo, it)) / ratios[it] }
            val smooth = Directions.of(Rules.shipped.number("covariance.chart_correlation")).columns
            val modes = SurfaceResponse.modes(light) + SurfaceResponse.modes(own.lamp) +
                smooth.map { it.times(OWN_WHITE) }
            val errors = modes.map { it.times(1 / OWN_WHITE) }
            val white = WhiteSignal(ratios.times(level), false, DoubleArray(3))
            return white to ReferenceRatios(light, null, 0.0, OWN_WHITE, errors)
        }

        /** Mean black level of the places of a colour. */
        private fun black(photo: Facts, colour: Int): Double {
            val places = (0..3).filter { photo.sensor.cfa[it] == "RGB"[colour] }
            return places.sumOf { photo.sensor.sharedBlack[it] } / places.size
        }
    }
}
