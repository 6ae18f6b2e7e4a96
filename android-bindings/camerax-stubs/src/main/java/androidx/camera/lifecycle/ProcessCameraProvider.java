package androidx.camera.lifecycle;

import android.content.Context;
import androidx.camera.core.Camera;
import androidx.camera.core.CameraProvider;
import androidx.camera.core.CameraSelector;
import androidx.camera.core.UseCase;
import androidx.lifecycle.LifecycleOwner;
import com.google.common.util.concurrent.ListenableFuture;

/** Binds cameras to a lifecycle. */
public final class ProcessCameraProvider implements CameraProvider {
    private ProcessCameraProvider() {
    }

    public static ListenableFuture<ProcessCameraProvider> getInstance(Context context) {
        throw new UnsupportedOperationException("a stub");
    }

    public Camera bindToLifecycle(LifecycleOwner owner, CameraSelector cameraSelector, UseCase... useCases) {
        throw new UnsupportedOperationException("a stub");
    }
}
