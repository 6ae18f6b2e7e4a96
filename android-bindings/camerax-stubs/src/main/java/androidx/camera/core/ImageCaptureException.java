package androidx.camera.core;

/** No photo. */
public class ImageCaptureException extends Exception {
    public ImageCaptureException(int imageCaptureError, String message, Throwable cause) {
        super(message, cause);
    }
}
