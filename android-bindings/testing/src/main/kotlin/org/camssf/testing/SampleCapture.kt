package org.camssf.testing

import org.camssf.ProgressReporter
import org.camssf.photo.Capture
import org.camssf.photo.Corners
import org.camssf.photo.MeasuredShot
import org.camssf.photo.Measuring
import org.camssf.photo.PhotoSource
import org.camssf.photo.Shot
import org.camssf.photo.dng.DngSource
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp

/**
 * A synthetic photo of a Classic chart, 180 × 132 samples, under light with a flat spectrum, for calibrations in an
 * app's tests.
 */
public object SampleCapture {
    private const val NAME = "chart-turned-0.dng"

    /** The bytes of the DNG; a new array for each call. */
    @JvmStatic
    public fun bytes(): ByteArray = requireNotNull(SampleCapture::class.java.getResourceAsStream(NAME)).use {
        it.readBytes()
    }

    /** The chart's table. */
    @JvmStatic
    public fun chart(): ChartTable = ChartTable.read("classic24")

    /** Corners of the block of patches, as a careful user would tap them. */
    @JvmStatic
    public fun corners(): Corners = Corners.of(22.44, 17.44, 156.56, 22.44, 162.56, 116.56, 16.44, 109.56)

    /** The photo; each reading opens it again. */
    @JvmStatic
    public fun photo(): PhotoSource = PhotoSource.dng { DngSource.of(bytes(), NAME) }

    /** A capture of one shot, without white and dark frame; `SsfCalibrator.calibrate` accepts it. */
    @JvmStatic
    public fun capture(): Capture = Capture(Shot(photo(), Lamp.read("E"), corners()), chart())

    /** The shot of this capture, measured; ONNX Runtime is not needed. */
    @JvmStatic
    public fun measured(): MeasuredShot = Measuring(capture(), ProgressReporter.NOBODY).run().shots[0]
}
