package androidx.camera.core;

/** The zoom of a camera. */
public interface ZoomState {
    float getZoomRatio();
}
