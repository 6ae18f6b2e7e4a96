package org.camssf.golden

import java.io.File
import kotlin.system.exitProcess

/**
 * The golden cases of some stages, up to the first that fails: what a mutation run over rules.json asks for each mutant
 * (`python -m tools.mutate_rules --kotlin`): the folder of the cases, then the stages. Status 0 if all hold, 3 if one
 * does not, and its fault on the last line; the JVM's own failures give 1.
 */
internal object Stages {
    @JvmStatic
    fun main(arguments: Array<String>) {
        val stages = arguments.drop(1)
        GoldenRunner(GoldenFiles.of(File(arguments[0]))).use { runner ->
            val names = runner.names()
            val cases = stages.flatMap { stage ->
                names.filter { it.startsWith("$stage/") }.ifEmpty { throw GoldenError("there is no stage $stage") }
            }
            for (name in cases) {
                val fault = try {
                    runner.run(name).faults.firstOrNull()
                } catch (error: RuntimeException) {
                    error.toString()
                }
                if (fault != null) {
                    println("$name: $fault")
                    exitProcess(3)
                }
            }
        }
    }
}
