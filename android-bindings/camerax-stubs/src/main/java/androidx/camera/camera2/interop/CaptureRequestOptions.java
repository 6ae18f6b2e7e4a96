package androidx.camera.camera2.interop;

import android.hardware.camera2.CaptureRequest;
import androidx.camera.core.ExtendableBuilder;

/** Camera2's keys with their values. */
@ExperimentalCamera2Interop
public class CaptureRequestOptions {
    private CaptureRequestOptions() {
    }

    public static final class Builder implements ExtendableBuilder<CaptureRequestOptions> {
        public <ValueT> Builder setCaptureRequestOption(CaptureRequest.Key<ValueT> key, ValueT value) {
            throw new UnsupportedOperationException("a stub");
        }

        @Override
        public CaptureRequestOptions build() {
            throw new UnsupportedOperationException("a stub");
        }
    }
}
