package org.camssf

/** Reports the progress of a run and ends a run that was cancelled. */
internal interface Tell {
    /** Calls [check], then reports the stage in words and the part done, 0 to 1. */
    operator fun invoke(stage: String, part: Double)

    /** Throws if the thread was interrupted or the calibrator was closed; cheap enough for inner loops. */
    fun check()

    companion object {
        /** Reports nothing and never ends a run. */
        val NOBODY: Tell = object : Tell {
            override fun invoke(stage: String, part: Double) = Unit

            override fun check() = Unit
        }
    }
}
