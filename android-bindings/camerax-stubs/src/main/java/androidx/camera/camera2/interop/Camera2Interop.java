package androidx.camera.camera2.interop;

import android.hardware.camera2.CameraCaptureSession;
import android.hardware.camera2.CaptureRequest;
import androidx.camera.core.ExtendableBuilder;

/** Camera2's requests behind a use case. */
@ExperimentalCamera2Interop
public final class Camera2Interop {
    private Camera2Interop() {
    }

    public static final class Extender<T> {
        public Extender(ExtendableBuilder<T> baseBuilder) {
        }

        public <ValueT> Extender<T> setCaptureRequestOption(CaptureRequest.Key<ValueT> key, ValueT value) {
            throw new UnsupportedOperationException("a stub");
        }

        public Extender<T> setSessionCaptureCallback(CameraCaptureSession.CaptureCallback captureCallback) {
            throw new UnsupportedOperationException("a stub");
        }
    }
}
