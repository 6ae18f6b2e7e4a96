package androidx.camera.core;

import java.util.Set;

/** What a camera can write. */
public interface ImageCaptureCapabilities {
    Set<Integer> getSupportedOutputFormats();
}
