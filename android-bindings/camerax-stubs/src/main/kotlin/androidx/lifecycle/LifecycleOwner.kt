package androidx.lifecycle

import kotlinx.coroutines.CoroutineScope

/** The coroutines of an owner, cancelled when it ends. */
public abstract class LifecycleCoroutineScope : CoroutineScope

/** The scope of this owner. */
public val LifecycleOwner.lifecycleScope: LifecycleCoroutineScope
    get() = throw UnsupportedOperationException("a stub")
