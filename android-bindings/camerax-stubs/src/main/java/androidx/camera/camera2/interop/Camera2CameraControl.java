package androidx.camera.camera2.interop;

import androidx.camera.core.CameraControl;
import com.google.common.util.concurrent.ListenableFuture;

/** Camera2's options of all requests of a camera. */
@ExperimentalCamera2Interop
public final class Camera2CameraControl {
    private Camera2CameraControl() {
    }

    public static Camera2CameraControl from(CameraControl cameraControl) {
        throw new UnsupportedOperationException("a stub");
    }

    public ListenableFuture<Void> setCaptureRequestOptions(CaptureRequestOptions bundle) {
        throw new UnsupportedOperationException("a stub");
    }

    public ListenableFuture<Void> clearCaptureRequestOptions() {
        throw new UnsupportedOperationException("a stub");
    }
}
