package androidx.camera.core;

import android.graphics.Matrix;
import android.util.Size;
import java.util.concurrent.Executor;

/** The preview's frames for an app. */
public final class ImageAnalysis extends UseCase {
    private ImageAnalysis() {
    }

    public void clearAnalyzer() {
        throw new UnsupportedOperationException("a stub");
    }

    public boolean isOutputImageRotationEnabled() {
        throw new UnsupportedOperationException("a stub");
    }

    public void setAnalyzer(Executor executor, Analyzer analyzer) {
        throw new UnsupportedOperationException("a stub");
    }

    public interface Analyzer {
        void analyze(ImageProxy image);

        default Size getDefaultTargetResolution() {
            return null;
        }

        default int getTargetCoordinateSystem() {
            return 0;
        }

        default void updateTransform(Matrix matrix) {
        }
    }

    public static final class Builder implements ExtendableBuilder<ImageAnalysis> {
        @Override
        public ImageAnalysis build() {
            throw new UnsupportedOperationException("a stub");
        }
    }
}
