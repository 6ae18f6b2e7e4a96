package androidx.camera.core;

import androidx.lifecycle.LiveData;

/** A camera, bound or not. */
public interface CameraInfo {
    LiveData<ZoomState> getZoomState();
}
