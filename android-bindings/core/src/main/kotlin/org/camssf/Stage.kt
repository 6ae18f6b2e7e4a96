package org.camssf

/** The stages of a calibration, in their order; the first three for each shot in turn. */
public enum class Stage(
    /** The stage for a user, in lower case. */
    public val words: String,
) {
    /** Opens the photo and reads its metadata. */
    READING("reading the photo"),

    /** Moves the corners to the printed borders. */
    FINDING("looking for the chart"),

    /** Measures the patches of all frames of a shot. */
    MEASURING("measuring the patches"),

    /** Recovers the curves. */
    SOLVING("solving"),

    /** Recovers them again without each fold of the chart, and from each shot alone. */
    VALIDATING("validating"),

    /** Compares other lamps with the named ones. */
    JUDGING("judging"),

    /** The result is there. */
    DONE("done"),
}
