package androidx.camera.camera2.interop;

import androidx.camera.core.CameraInfo;

/** Camera2's id of a camera. */
@ExperimentalCamera2Interop
public final class Camera2CameraInfo {
    private Camera2CameraInfo() {
    }

    public static Camera2CameraInfo from(CameraInfo cameraInfo) {
        throw new UnsupportedOperationException("a stub");
    }

    public String getCameraId() {
        throw new UnsupportedOperationException("a stub");
    }
}
