package androidx.camera.core;

/** About one image. */
public interface ImageInfo {
    long getTimestamp();
}
