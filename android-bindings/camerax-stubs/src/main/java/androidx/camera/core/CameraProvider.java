package androidx.camera.core;

/** What a provider offers of its cameras. */
public interface CameraProvider {
    default CameraInfo getCameraInfo(CameraSelector cameraSelector) {
        throw new UnsupportedOperationException("a stub");
    }
}
