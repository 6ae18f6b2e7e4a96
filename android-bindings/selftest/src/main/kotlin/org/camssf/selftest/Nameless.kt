package org.camssf.selftest

import org.camssf.photo.dng.DngSource

/** A photo whose name, which may hold date and time, stays out of results. */
internal class Nameless(source: DngSource) : DngSource by source {
    override val name: String = "photo"
}
