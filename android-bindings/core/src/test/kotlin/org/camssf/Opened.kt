package org.camssf

/** A calibrator of one basis. */
internal fun opened(basis: String): SsfCalibrator = SsfCalibrator.Builder().basis(basis).openBlocking()
