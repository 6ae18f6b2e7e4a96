package androidx.camera.core;

/** A builder that camera2's interop extends. */
public interface ExtendableBuilder<T> {
    T build();
}
