package org.camssf

import org.camssf.photo.Corners

/** A calibrator of one basis. */
internal fun opened(basis: String): SsfCalibrator = SsfCalibrator.Builder().basis(basis).openBlocking()

/** Of the chart in golden/dng/chart-turned-0.dng. */
internal val chartCorners = Corners.of(22.44, 17.44, 156.56, 22.44, 162.56, 116.56, 16.44, 109.56)
