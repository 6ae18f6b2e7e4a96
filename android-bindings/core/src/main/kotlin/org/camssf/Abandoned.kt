package org.camssf

import java.lang.ref.PhantomReference
import java.lang.ref.ReferenceQueue
import java.util.Collections

/**
 * Releases what objects held that nobody closed before they became garbage, on a daemon thread. Java's own Cleaner
 * needs API 33.
 */
internal object Abandoned {
    private val queue = ReferenceQueue<Any>()

    /** A reference must itself be reachable to arrive in the queue. */
    private val watches = Collections.synchronizedSet(HashSet<Watch>())

    private val thread by lazy {
        Thread({ while (true) (queue.remove() as Watch).release() }, "camssf-abandoned").apply {
            isDaemon = true
            start()
        }
    }

    /**
     * Watches an object until [cancel].
     *
     * @param release called once, if the object becomes garbage before; it must not refer to the object.
     */
    class Watch(owner: Any, private val release: () -> Unit) : PhantomReference<Any>(owner, queue) {
        init {
            watches += this
            thread
        }

        fun cancel() {
            watches -= this
        }

        internal fun release() {
            if (watches.remove(this)) release.invoke()
        }
    }
}
