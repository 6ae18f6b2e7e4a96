package androidx.lifecycle;

/** What lives and ends. */
public interface LifecycleOwner {
}
