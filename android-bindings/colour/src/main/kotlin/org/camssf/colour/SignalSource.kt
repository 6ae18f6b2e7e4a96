package org.camssf.colour

import org.camssf.FramesDiffer
import org.camssf.InvalidArgument
import org.camssf.photo.Alike
import org.camssf.photo.Facts
import org.camssf.photo.LensShading
import org.camssf.photo.PhysicalCamera
import org.camssf.short

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
            throw FramesDiffer(
                "${there.name} was taken by ${there.make} ${there.model}, the reference's photo ${here.name} by " +
                    "${here.make} ${here.model}.",
                "Measure the reference and the surface in photos of one camera.",
            )
        }
        PhysicalCamera.check("the reference's photo ${here.name}", here.camera, there.name, there.camera)
        if (photo.sensor.white != other.photo.sensor.white) {
            throw FramesDiffer(
                "${there.name} has a white level of ${short(other.photo.sensor.white)} DN, the reference's photo " +
                    "${here.name} one of ${short(photo.sensor.white)} DN.",
                "Take both photos with the same camera app and the same raw format.",
            )
        }
        return ratio(here.exposure, there.exposure, "exposure time", other) * ratio(here.iso, there.iso, "ISO", other)
    }

    private fun same(other: SignalSource): Boolean {
        val (here, there) = photo.origin to other.photo.origin
        return here === there || (here.sha256.isNotEmpty() && here.sha256 == there.sha256)
    }

    private fun ratio(here: Double?, there: Double?, word: String, other: SignalSource): Double {
        if (here == null || there == null || !(here > 0 && there > 0)) {
            val silent = if (here != null && here > 0) other.photo.name else photo.name
            throw FramesDiffer(
                "$silent does not state its $word, so the signals of ${other.photo.name} cannot be compared with " +
                    "the reference in ${photo.name}.",
                "Measure the reference and the surface in one photo, or in photos that state exposure time and ISO.",
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
            throw FramesDiffer(
                "${photo.name} was taken by ${photo.make} ${photo.model}, the result is of $make $model.",
                "Calibrate that camera; each has its own curves.",
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
