package org.camssf

/** A channel of the camera; arrays have their columns in this order. */
public enum class Channel {
    /** The first column. */
    RED,

    /** The second column. */
    GREEN,

    /** The third column. */
    BLUE,
}
