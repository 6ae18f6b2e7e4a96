package org.camssf.photo.dng

import com.sun.management.ThreadMXBean
import org.camssf.RawError
import org.camssf.photo.Region
import java.lang.management.ManagementFactory
import java.util.Random
import kotlin.system.exitProcess

/**
 * Seeded damage to the variants: the reader may read a file or refuse it by a [RawError], and nothing else.
 *
 * `java -Xmx128m -cp ... org.camssf.photo.dng.Fuzz 100000 0` runs so many files from that seed on, and prints what came out.
 */
internal class Fuzz(private val corpus: List<ByteArray> = Variants.all.map { it.bytes }) {
    val refused = LinkedHashMap<String, Int>()
    var read = 0
        private set
    var slowest = 0L
        private set
    var slowestSeed = 0L
        private set

    /** Most bytes that a read allocated, garbage included. */
    var hungriest = 0L
        private set
    var hungriestSeed = 0L
        private set
    private val memory = ManagementFactory.getThreadMXBean() as ThreadMXBean

    /** File number `seed`; the same bytes on every machine. */
    fun damaged(seed: Long): ByteArray {
        val random = Random(seed * 0x9E3779B97F4A7C15uL.toLong() + 1)
        var bytes = corpus[random.nextInt(corpus.size)].copyOf()
        repeat(1 + random.nextInt(1 + random.nextInt(8))) { bytes = damage(bytes, random) }
        return bytes
    }

    /** One blow; the directories at the file's end and the header get as many as all the samples. */
    private fun damage(bytes: ByteArray, random: Random): ByteArray {
        if (bytes.size < 16) return bytes
        val at = when (random.nextInt(8)) {
            0 -> random.nextInt(8)

            1, 2, 3 -> bytes.size - 1 - random.nextInt(minOf(600, bytes.size - 8))

            4 -> random.nextInt(minOf(120, bytes.size))

            // the first piece, a JPEG's header
            else -> random.nextInt(bytes.size)
        }
        when (random.nextInt(24)) {
            in 0..6 -> bytes[at] = (bytes[at].toInt() xor (1 shl random.nextInt(8))).toByte()

            in 7..9 -> bytes[at] = random.nextInt(256).toByte()

            in 10..12 -> put(bytes, at, 2, SHORTS[random.nextInt(SHORTS.size)], random.nextBoolean())

            in 13..15 -> put(bytes, at, 4, WORDS[random.nextInt(WORDS.size)], random.nextBoolean())

            in 16..18 -> put(bytes, at, 4, random.nextInt(2 * bytes.size), random.nextBoolean())

            19 -> return bytes.copyOf(if (random.nextInt(4) == 0) at else bytes.size - random.nextInt(8))

            in 20..22 -> { // a piece from elsewhere, maybe of another file
                val other = if (random.nextBoolean()) bytes else corpus[random.nextInt(corpus.size)]
                val length = 1 + random.nextInt(24)
                val from = random.nextInt(maxOf(1, other.size - length))
                for (i in 0 until length) if (at + i < bytes.size) bytes[at + i] = other[from + i]
            }

            else -> { // bytes too many or too few
                val shift = random.nextInt(17) - 8
                return if (shift >= 0) {
                    bytes.copyOf(at) + ByteArray(shift) + bytes.copyOfRange(at, bytes.size)
                } else {
                    bytes.copyOf(at) + bytes.copyOfRange(minOf(at - shift, bytes.size), bytes.size)
                }
            }
        }
        return bytes
    }

    private fun put(bytes: ByteArray, at: Int, length: Int, value: Int, littleEndian: Boolean) {
        for (i in 0 until length) {
            val shift = 8 * if (littleEndian) i else length - 1 - i
            if (at + i < bytes.size) bytes[at + i] = (value ushr shift).toByte()
        }
    }

    /**
     * Reads file number `seed`, every third time a part of it.
     *
     * @throws IllegalStateException for anything but samples or a [RawError], with the seed.
     */
    fun once(seed: Long) {
        val file = damaged(seed)
        val thread = Thread.currentThread().id
        val before = memory.getThreadAllocatedBytes(thread)
        val start = System.nanoTime()
        try {
            val whole = seed % 3 != 0L
            val found = DngReader.read(DngSource.of(file, "fuzz.dng"), if (whole) null else Region(0, 0, 9, 20))
            check(found.samples.size == found.region.width * found.region.height) {
                "seed $seed: samples are missing"
            }
            val sensor = found.sensor
            val levels = sensor.sharedBlack + sensor.white
            check(levels.all { it.isFinite() } && sensor.white > 0) { "seed $seed: levels are no numbers" }
            read++
        } catch (error: RawError) {
            check(error.message.isNotEmpty() && error.advice.isNotEmpty()) { "seed $seed: no words" }
            // numbers out, so that reasons can be counted
            val reason = error.code + ": " + error.message.removePrefix("fuzz.dng ").replace(Regex("-?[0-9]+"), "#")
            refused[reason] = (refused[reason] ?: 0) + 1
        } catch (error: Throwable) {
            throw IllegalStateException("seed $seed: $error", error)
        }
        val time = System.nanoTime() - start
        val bytes = memory.getThreadAllocatedBytes(thread) - before
        if (bytes > hungriest) {
            hungriest = bytes
            hungriestSeed = seed
        }
        if (time > slowest) {
            slowest = time
            slowestSeed = seed
        }
    }

    companion object {
        private val SHORTS = intArrayOf(0, 1, 2, 7, 8, 9, 12, 16, 17, 255, 256, 4096, 32767, 32768, 65535)
        private val WORDS =
            intArrayOf(0, 1, -1, Int.MAX_VALUE, Int.MIN_VALUE, 65535, 65536, 1 shl 24, 1 shl 29, 0x55555555)

        /** Arguments: how many, the first seed. */
        @JvmStatic
        fun main(arguments: Array<String>) {
            val count = arguments.getOrElse(0) { "100000" }.toLong()
            val first = arguments.getOrElse(1) { "0" }.toLong()
            val fuzz = Fuzz()
            val start = System.nanoTime()
            var now = first
            val watch = Thread {
                var last = -1L
                while (true) {
                    Thread.sleep(10_000)
                    if (now == last) {
                        println("seed $now hangs")
                        Runtime.getRuntime().halt(2)
                    }
                    last = now
                }
            }
            watch.isDaemon = true
            watch.start()
            while (now < first + count) {
                fuzz.once(now++)
                if ((now - first) % 10_000 == 0L) System.err.println("${now - first} files")
            }
            val megabytes = Runtime.getRuntime().maxMemory() shr 20
            val seconds = (System.nanoTime() - start) / 1_000_000_000
            println("$count files from seed $first, heap of $megabytes MB, $seconds s")
            println("read ${fuzz.read}, refused ${fuzz.refused.values.sum()}, nothing else")
            println("slowest ${fuzz.slowest / 1_000_000} ms, seed ${fuzz.slowestSeed}")
            println("hungriest ${fuzz.hungriest shr 10} KiB, seed ${fuzz.hungriestSeed}")
            for ((reason, times) in fuzz.refused.entries.sortedByDescending { it.value }) {
                println("%7d  %s".format(times, reason))
            }
            if (fuzz.slowest > 2_000_000_000) exitProcess(1)
        }
    }
}
