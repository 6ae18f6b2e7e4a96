package androidx.camera.core;

import java.nio.ByteBuffer;

/** One image of an analysis. */
public interface ImageProxy extends AutoCloseable {
    @Override
    void close();

    int getFormat();

    int getHeight();

    ImageInfo getImageInfo();

    PlaneProxy[] getPlanes();

    int getWidth();

    interface PlaneProxy {
        ByteBuffer getBuffer();

        int getPixelStride();

        int getRowStride();
    }
}
