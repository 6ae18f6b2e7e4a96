package androidx.camera.core;

/** What changes a bound camera. */
public interface CameraControl {
}
