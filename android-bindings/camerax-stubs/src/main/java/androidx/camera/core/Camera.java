package androidx.camera.core;

/** A bound camera. */
public interface Camera {
    CameraInfo getCameraInfo();
}
