package androidx.camera.core;

/** The preview. */
public final class Preview extends UseCase {
    private Preview() {
    }

    public void setSurfaceProvider(SurfaceProvider surfaceProvider) {
        throw new UnsupportedOperationException("a stub");
    }

    public interface SurfaceProvider {
    }

    public static final class Builder implements ExtendableBuilder<Preview> {
        @Override
        public Preview build() {
            throw new UnsupportedOperationException("a stub");
        }
    }
}
