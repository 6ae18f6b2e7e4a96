package org.camssf

import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import org.junit.jupiter.api.io.TempDir
import java.io.ByteArrayOutputStream
import java.io.File
import java.net.URLClassLoader
import javax.tools.ToolProvider

/** An app in Java: it compiles as a Java programmer would write it, without `INSTANCE`, `Unit` and `Companion`. */
class JavaTest {
    @TempDir
    private lateinit var folder: File

    @Test
    fun `a calibration from Java`() {
        val source = File(folder, "FromJava.java").apply { writeText(SOURCE) }
        val said = ByteArrayOutputStream()
        val words = listOf("-Xlint:all,-path,-processing", "-Werror", "-proc:none", "-d", folder.path)
        val status = ToolProvider.getSystemJavaCompiler()
            .run(null, said, said, *(words + listOf("-cp", CLASSES, source.path)).toTypedArray())
        assertEquals(0, status, "$said")
        URLClassLoader(arrayOf(folder.toURI().toURL()), javaClass.classLoader).use { loader ->
            val run = loader.loadClass("FromJava").getMethod("run", String::class.java)
            val photo = File(System.getProperty("camssf.root"), "golden/dng/chart-turned-0.dng")
            val found = run.invoke(null, photo.path) as String
            assertTrue(Regex("(accepted|doubtful) 0\\.\\d+ 681 1\\.0").matches(found), found)
        }
    }

    private companion object {
        val CLASSES: String = System.getProperty("java.class.path")
        const val SOURCE = """
            import java.io.File;
            import java.util.ArrayList;
            import java.util.Collections;
            import java.util.List;
            import org.camssf.*;
            import org.camssf.photo.*;
            import org.camssf.spectra.*;

            public final class FromJava {
                public static String run(String path) throws InterruptedException {
                    Corners corners = Corners.of(22.44, 17.44, 156.56, 22.44, 162.56, 116.56, 16.44, 109.56);
                    Shot shot = new Shot(PhotoSource.of(new File(path)), Lamp.read("E"), corners);
                    Capture capture = new Capture(shot, ChartTable.read("classic24"));
                    List<Progress> steps = new ArrayList<>();
                    List<String> lines = new ArrayList<>();
                    CalibrationOptions options = new CalibrationOptions.Builder().progress(steps::add).build();
                    try (SsfCalibrator calibrator =
                            new SsfCalibrator.Builder().basis("phones").logger(lines::add).openBlocking()) {
                        CalibrationResult found = calibrator.calibrateBlocking(capture, options);
                        if (found instanceof Refused) return ((Refused) found).getError().getAdvice();
                        double red = ((Recovered) found).curve(Channel.RED).at(600.0);
                        String word = found.getVerdict().getOutcome().getWord();
                        double end = steps.get(steps.size() - 1).getPart();
                        return word + " " + red + " " + Grid.wavelengths.getSize() + " " + end;
                    } catch (UnreadableRaw error) {
                        throw Refusal.of("unsupported_raw.big_tiff", Collections.singletonMap("file", path));
                    } catch (Misuse error) {
                        throw new IllegalStateException(error.getReason().getMessage(), error);
                    }
                }
            }
        """
    }
}
