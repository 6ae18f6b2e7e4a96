package org.camssf

import java.util.concurrent.locks.ReentrantLock
import kotlin.concurrent.withLock

/** An [SsfCalibrator] was closed: before a call, or while the call ran, which then ends without a result. */
public class CalibratorClosed internal constructor() :
    IllegalStateException("This SsfCalibrator was closed. Open another.")

/**
 * Lets runs through until it is shut, and shuts when the last has left.
 *
 * @param release what all runs need; called once.
 */
internal class Gate(private val release: () -> Unit) {
    private val lock = ReentrantLock()
    private val left = lock.newCondition()
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
                left.signalAll()
            }
        }
    }

    /** Waits until nobody is inside; a thread that is inside itself cannot, and the last to leave releases. */
    fun close(): Unit = lock.withLock {
        shut = true
        if (Thread.currentThread() in inside) return
        while (inside.isNotEmpty()) left.awaitUninterruptibly()
        releaseOnce()
    }

    private fun releaseOnce() {
        if (released) return
        released = true
        release()
    }
}
