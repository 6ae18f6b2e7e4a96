package androidx.camera.core;

/** Which camera to bind. */
public final class CameraSelector {
    public static final CameraSelector DEFAULT_BACK_CAMERA = new CameraSelector();

    private CameraSelector() {
    }
}
