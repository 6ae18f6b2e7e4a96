package org.camssf

import java.lang.ref.PhantomReference
import java.lang.ref.ReferenceQueue
import java.util.Collections
import kotlin.concurrent.thread

/**
 * Releases what objects held that nobody closed before they became garbage, on a daemon thread. Java's own Cleaner
 * needs API 33.
 */
internal object Abandoned {
    private val queue = ReferenceQueue<Any>()

    /** A reference must itself be reachable to arrive in the queue. */
    private val watches = Collections.synchronizedSet(HashSet<Watch>())

    private val worker by lazy { thread(isDaemon = true, name = "camssf-abandoned") { work() } }

    /** Until the thread is interrupted, as Maven's exec plug-in does at the end of a program. */
    private fun work() {
        while (true) {
            try {
                (queue.remove() as Watch).release()
            } catch (_: InterruptedException) {
                return
            } catch (_: Exception) { // a logger's; an app must not die of it
                continue
            }
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
            worker
        }

        fun cancel() {
            watches -= this
        }

        internal fun release() {
            if (watches.remove(this)) release.invoke()
        }
    }
}
