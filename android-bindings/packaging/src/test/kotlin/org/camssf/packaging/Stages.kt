package org.camssf.packaging

import org.camssf.golden.GoldenFiles
import org.camssf.golden.GoldenRunner
import java.io.File
import kotlin.system.exitProcess

/** Golden cases of every stage on the shrunk jar: R8 may drop a class; numbers are GoldenTest's. */
internal object Stages {
    private const val EACH = 3

    /** The folder golden/. */
    @JvmStatic
    fun main(arguments: Array<String>) {
        val outcomes = GoldenRunner(GoldenFiles.of(File(arguments[0]))).use { runner ->
            runner.names().groupBy { it.substringBefore('/') }.values.flatMap { it.take(EACH) }.map { runner.run(it) }
        }
        for (outcome in outcomes) outcome.faults.forEach { println("FAULT ${outcome.case}: $it") }
        if (outcomes.any { it.faults.isNotEmpty() }) exitProcess(1)
    }
}
