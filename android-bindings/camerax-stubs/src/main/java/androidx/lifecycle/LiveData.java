package androidx.lifecycle;

/** A value that changes. */
public abstract class LiveData<T> {
    public T getValue() {
        throw new UnsupportedOperationException("a stub");
    }
}
