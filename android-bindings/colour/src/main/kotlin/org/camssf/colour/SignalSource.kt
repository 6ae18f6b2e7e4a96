package org.camssf.colour

import org.camssf.FramesDiffer
import org.camssf.InvalidArgument
import org.camssf.Refusal
import org.camssf.photo.Alike
import org.camssf.photo.Facts
import org.camssf.photo.LensShading
import org.camssf.photo.PhysicalCamera

/**
 * The photo in which raw signals were measured, and how.
 *
 * @property photo its metadata.
 * @property shading whether its gain maps were applied.
 */
internal class SignalSource(val photo: Facts, val shading: LensShading) {
    /**
     * Factor that brings raw signals of another photo to the exposure of this one: the ratio of exposure time × ISO.
     *
     * @param other where the signals of a surface come from, in the light of this photo.
     * @throws InvalidArgument the gain maps were applied to one of them only.
     * @throws FramesDiffer another camera or white level, or an exposure that one of two photos does not state.
     * @throws org.camssf.UnitDiffers another physical camera or lens.
     */
    fun factor(other: SignalSource): Double {
        if (other.shading != shading) {
            throw InvalidArgument(
                "The lens shading of ${photo.name} and ${other.photo.name} was treated differently.",
                "Measure the reference and the surface with the same lensShading.",
            )
        }
        if (same(other)) return 1.0
        val (here, there) = photo.origin to other.photo.origin
        if (differ(here.make, there.make) || differ(here.model, there.model)) {
            throw Refusal.of(
                "frames_differ.reference_camera", "file" to there.name, "camera" to "${there.make} ${there.model}",
                "reference" to here.name, "other" to "${here.make} ${here.model}",
            )
        }
        PhysicalCamera.check("the reference's photo ${here.name}", here.camera, there.name, there.camera)
        if (photo.sensor.white != other.photo.sensor.white) {
            throw Refusal.of(
                "frames_differ.reference_white_level", "file" to there.name, "white" to other.photo.sensor.white,
                "reference" to here.name, "other" to photo.sensor.white,
            )
        }
        return ratio(here.exposure, there.exposure, "exposure time", other) * ratio(here.iso, there.iso, "ISO", other)
    }

    /**
     * Exposure time of this photo over that of another one; 1 if it is the same photo.
     *
     * @throws FramesDiffer one of two photos does not state it.
     */
    fun timeOver(other: SignalSource): Double =
        if (same(other)) 1.0 else ratio(photo.origin.exposure, other.photo.origin.exposure, "exposure time", other)

    private fun same(other: SignalSource): Boolean {
        val (here, there) = photo.origin to other.photo.origin
        return here === there || (here.sha256.isNotEmpty() && here.sha256 == there.sha256)
    }

    private fun ratio(here: Double?, there: Double?, word: String, other: SignalSource): Double {
        if (here == null || there == null || !(here > 0 && there > 0)) {
            val silent = if (here != null && here > 0) other.photo.name else photo.name
            throw Refusal.of(
                "frames_differ.reference_silent", "silent" to silent, "setting" to word, "file" to other.photo.name,
                "reference" to photo.name,
            )
        }
        return if (Alike.equal(here, there)) 1.0 else here / there
    }
}

/**
 * The camera of a result; "" where unknown.
 *
 * @property unit the physical camera, as far as it is known.
 */
internal class CameraOfCurves(val make: String, val model: String, val unit: PhysicalCamera) {
    /**
     * Refuses signals of another camera. Zoom and aperture may differ from those of the calibration.
     *
     * @throws FramesDiffer another make or model.
     * @throws org.camssf.UnitDiffers another physical camera or lens.
     */
    fun check(source: SignalSource) {
        val photo = source.photo.origin
        if (differ(make, photo.make) || differ(model, photo.model)) {
            throw Refusal.of(
                "frames_differ.result_camera", "file" to photo.name, "camera" to "${photo.make} ${photo.model}",
                "other" to "$make $model",
            )
        }
        PhysicalCamera.check("the result's photo", unit.body, photo.name, photo.camera.body)
    }
}

/** True if both are known and differ. */
private fun differ(one: String, two: String) = one.isNotEmpty() && two.isNotEmpty() && one != two

/** Camera, serial number and lens; without zoom, aperture and sensor mode, which may change between photos. */
internal val PhysicalCamera.body: PhysicalCamera
    get() = PhysicalCamera(id, serial, lens, null, null, null, serialCheck)
