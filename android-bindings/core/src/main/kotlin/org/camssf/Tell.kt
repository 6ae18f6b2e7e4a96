package org.camssf

/** How a run tells what it does, and learns that nobody waits for it any more. */
internal interface Tell {
    /** Tells the stage in words and the part done, 0 to 1; [check]s first. */
    operator fun invoke(stage: String, part: Double)

    /** Ends a run whose thread was interrupted or whose calibrator was closed; cheap, for inner loops. */
    fun check()

    companion object {
        /** Nobody listens, and nobody ends it. */
        val NOBODY: Tell = object : Tell {
            override fun invoke(stage: String, part: Double) = Unit

            override fun check() = Unit
        }
    }
}
