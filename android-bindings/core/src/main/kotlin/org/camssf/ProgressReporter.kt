package org.camssf

/** Reports the progress of a run and ends a run that was cancelled. */
internal interface ProgressReporter {
    /** Calls [check], then reports that a step of a stage begins; `shot` is an index. */
    fun begin(stage: Stage, shot: Int? = null)

    /** Calls [check], then reports the next run of a model within the step. */
    fun proceed()

    /** Throws if the thread was interrupted or the calibrator was closed; cheap enough for inner loops. */
    fun check()

    companion object {
        /** Reports nothing and never ends a run. */
        val NOBODY: ProgressReporter = object : ProgressReporter {
            override fun begin(stage: Stage, shot: Int?) = Unit

            override fun proceed() = Unit

            override fun check() = Unit
        }
    }
}
