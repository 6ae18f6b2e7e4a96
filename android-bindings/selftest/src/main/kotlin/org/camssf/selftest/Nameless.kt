package org.camssf.selftest

import org.camssf.photo.dng.DngSource

/** A photo without its file name, which may contain date and time and must not reach results. */
internal class Nameless(source: DngSource) : DngSource by source {
    override val name: String = "photo"
}
