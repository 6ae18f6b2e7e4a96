package androidx.camera.core;

import android.graphics.Bitmap;
import java.io.File;
import java.util.concurrent.Executor;

/** Photos. */
public final class ImageCapture extends UseCase {
    public static final int CAPTURE_MODE_MAXIMIZE_QUALITY = 0;
    public static final int FLASH_MODE_OFF = 2;
    public static final int OUTPUT_FORMAT_RAW = 2;

    private ImageCapture() {
    }

    public static ImageCaptureCapabilities getImageCaptureCapabilities(CameraInfo cameraInfo) {
        throw new UnsupportedOperationException("a stub");
    }

    public void takePicture(OutputFileOptions options, Executor executor, OnImageSavedCallback callback) {
        throw new UnsupportedOperationException("a stub");
    }

    public interface OnImageSavedCallback {
        default void onCaptureProcessProgressed(int progress) {
        }

        default void onCaptureStarted() {
        }

        void onError(ImageCaptureException exception);

        void onImageSaved(OutputFileResults results);

        default void onPostviewBitmapAvailable(Bitmap bitmap) {
        }
    }

    public static class OutputFileResults {
        OutputFileResults() {
        }
    }

    public static final class OutputFileOptions {
        OutputFileOptions() {
        }

        public static final class Builder {
            public Builder(File file) {
            }

            public OutputFileOptions build() {
                return new OutputFileOptions();
            }
        }
    }

    public static final class Builder implements ExtendableBuilder<ImageCapture> {
        @Override
        public ImageCapture build() {
            throw new UnsupportedOperationException("a stub");
        }

        public Builder setCaptureMode(int captureMode) {
            throw new UnsupportedOperationException("a stub");
        }

        public Builder setFlashMode(int flashMode) {
            throw new UnsupportedOperationException("a stub");
        }

        public Builder setOutputFormat(int outputFormat) {
            throw new UnsupportedOperationException("a stub");
        }
    }
}
