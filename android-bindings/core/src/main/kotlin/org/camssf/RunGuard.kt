package org.camssf

import java.util.concurrent.locks.ReentrantLock
import kotlin.concurrent.withLock

/** Thrown by calls to an [SsfCalibrator] after its `close`, and by calls that were running when it was closed. */
public class CalibratorClosed internal constructor() :
    IllegalStateException("This SsfCalibrator was closed. Open another.")

/**
 * Counts running calls, rejects new ones after [close], and releases a shared resource after the last call.
 *
 * @param release releases what all calls need; called once.
 */
internal class RunGuard(private val release: () -> Unit) {
    private val lock = ReentrantLock()
    private val callEnded = lock.newCondition()
    private val inside = ArrayList<Thread>()
    private var released = false

    @Volatile
    private var shut = false

    /** @throws CalibratorClosed after [close]. */
    fun check() {
        if (shut) throw CalibratorClosed()
    }

    fun <T> through(work: () -> T): T {
        lock.withLock {
            check()
            inside += Thread.currentThread()
        }
        try {
            return work()
        } finally {
            lock.withLock {
                inside.remove(Thread.currentThread())
                if (shut && inside.isEmpty()) releaseOnce()
                callEnded.signalAll()
            }
        }
    }

    /**
     * Rejects new calls, waits until all running ones have ended, and releases. If this thread is itself inside a
     * call, it does not wait: the last call to end releases.
     */
    fun close(): Unit = lock.withLock {
        shut = true
        if (Thread.currentThread() in inside) return
        while (inside.isNotEmpty()) callEnded.awaitUninterruptibly()
        releaseOnce()
    }

    private fun releaseOnce() {
        if (released) return
        released = true
        release()
    }
}
