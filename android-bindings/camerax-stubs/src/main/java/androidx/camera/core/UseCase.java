package androidx.camera.core;

/** What a camera is bound for. */
public abstract class UseCase {
}
