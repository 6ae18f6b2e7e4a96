package org.camssf.model

import java.io.InputStream

/** The model files that this jar carries. */
public object Models {
    /**
     * The file of this name, opened; the caller closes it.
     *
     * @throws IllegalStateException if the jar was stripped of it (an app's packaging rules can do that).
     */
    public fun open(name: String): InputStream =
        checkNotNull(Models::class.java.getResourceAsStream("/org/camssf/model/$name")) {
            "$name is missing from the app: keep the resources org/camssf/model/* when packaging."
        }
}
