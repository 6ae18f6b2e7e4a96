package androidx.camera.core;

/** A bound camera. */
public interface Camera {
    CameraControl getCameraControl();

    CameraInfo getCameraInfo();
}
