package androidx.camera.camera2.interop;

import java.lang.annotation.Retention;
import java.lang.annotation.RetentionPolicy;

/** Marks all of camera2's interop. */
@Retention(RetentionPolicy.CLASS)
public @interface ExperimentalCamera2Interop {
}
