package org.camssf.testing

import org.camssf.Tell
import org.camssf.photo.Capture
import org.camssf.photo.Corners
import org.camssf.photo.MeasuredShot
import org.camssf.photo.Measuring
import org.camssf.photo.PhotoSource
import org.camssf.photo.Shot
import org.camssf.photo.dng.DngSource
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp

/** A drawn photo of a Classic chart, 180 × 132 samples, under a flat light: what an app's tests can calibrate from. */
public object SampleCapture {
    private const val NAME = "chart-turned-0.dng"

    /** The DNG's bytes; a new array at each call. */
    @JvmStatic
    public fun bytes(): ByteArray = requireNotNull(SampleCapture::class.java.getResourceAsStream(NAME)).use {
        it.readBytes()
    }

    /** The chart's table. */
    @JvmStatic
    public fun chart(): ChartTable = ChartTable.read("classic24")

    /** Taps around the block of patches, as a careful hand makes them. */
    @JvmStatic
    public fun corners(): Corners = Corners.of(22.44, 17.44, 156.56, 22.44, 162.56, 116.56, 16.44, 109.56)

    /** The photo; opened anew at each reading. */
    @JvmStatic
    public fun photo(): PhotoSource = PhotoSource.dng { DngSource.of(bytes(), NAME) }

    /** One shot of it, without white and dark frame; `SsfCalibrator.calibrate` takes it, and accepts it. */
    @JvmStatic
    public fun capture(): Capture = Capture(Shot(photo(), Lamp.read("E"), corners()), chart())

    /** The same measured, without ONNX Runtime. */
    @JvmStatic
    public fun measured(): MeasuredShot = Measuring(capture(), Tell.NOBODY).run().shots[0]
}
