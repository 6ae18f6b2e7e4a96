package org.camssf

/** Tells the stage in words and the part done, 0 to 1; ends a call that was cancelled. */
internal typealias Tell = (String, Double) -> Unit
