"""The recipes of docs/jvm.md, android.md, live.md, word for word, from an empty folder to a first result.

They need `mvn -f android-bindings verify`, Java, and Maven Central for the Kotlin compilers that are in no cache.
"""

import json
import os
import re
import shutil
import subprocess
import zipfile
from pathlib import Path

import pytest

from tests.support.pages import blocks

ROOT = Path(__file__).parents[2]
BINDINGS = Path(os.environ.get("CAMSSF_BINDINGS", ROOT / "android-bindings"))
REPOSITORY = Path(os.environ.get("CAMSSF_REPOSITORY", BINDINGS / "packaging" / "target" / "repository"))
ROBOLECTRIC = BINDINGS / "camera2" / "target"
JVM_PAGE = (ROOT / "docs" / "jvm.md").read_text("utf-8")
ANDROID_PAGE = (ROOT / "docs" / "android.md").read_text("utf-8")
LIVE_PAGE = (ROOT / "docs" / "live.md").read_text("utf-8")

pytestmark = pytest.mark.full
if shutil.which("mvn") is None or shutil.which("java") is None:
    pytest.skip("there is no Java or no Maven: the recipes of the docs are not run", allow_module_level=True)
if not (REPOSITORY / "org" / "camssf" / "camssf-bom").is_dir():
    pytest.skip("no jar (mvn -f android-bindings verify): the recipes are not run", allow_module_level=True)


@pytest.fixture
def cache(tmp_path: Path) -> Path:
    """Maven's own cache, but for camssf: what another build installed there must not answer for these jars."""
    # As Maven asks for it: other people's jars stay where they are, by links, and what is fetched is kept there.
    common = Path(os.environ.get("MAVEN_CACHE", Path.home() / ".m2" / "repository"))
    own = tmp_path / "cache"
    (own / "org").mkdir(parents=True)
    (common / "org").mkdir(parents=True, exist_ok=True)
    for folder in (common, common / "org"):
        for entry in folder.iterdir():
            if entry.is_dir() and entry.name not in ("org", "camssf"):
                (own / entry.relative_to(common)).symlink_to(entry)
    return own


def project(folder: Path, cache: Path, *settings: str) -> Path:
    """An empty folder, in which Maven uses that cache and says what it does without colours."""
    shutil.copytree(BINDINGS / ".mvn", folder / ".mvn")  # a Java that compiles little
    words = [f"-Dmaven.repo.local={cache}", "--batch-mode", "--no-transfer-progress", *settings]
    (folder / ".mvn" / "maven.config").write_text("\n".join(words) + "\n", encoding="utf-8")
    return folder


def run(command: str, folder: Path) -> str:
    done = subprocess.run(["bash", "-euo", "pipefail", "-c", command], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]
    return re.sub(r"\x1b\[[\d;]*m", "", done.stdout)


def write(folder: Path, name: str, text: str) -> None:
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    there = "/path/to/camssf/android-bindings/packaging/target/repository"
    (folder / name).write_text(text.replace(there, str(REPOSITORY)), encoding="utf-8")


def kotlin_versions() -> list[str]:
    """Those that the page says it was tested with."""
    (said,) = re.findall(r"([\d.]+ and [\d.]+) are tested by this page's recipe", JVM_PAGE)
    return re.findall(r"\d+\.\d+\.\d+", said)


def test_the_page_names_the_oldest_compilers_and_its_own() -> None:
    (own,) = re.findall(r"<kotlin.version>([\d.]+)<", JVM_PAGE)
    assert kotlin_versions() == ["2.1.0", own]
    assert f"<kotlin.version>{own}<" in (ROOT / "android-bindings" / "pom.xml").read_text("utf-8")


@pytest.mark.requirement("R-RECIPE")
@pytest.mark.parametrize("kotlin", kotlin_versions())
def test_a_new_jvm_project_by_the_page_alone(kotlin: str, tmp_path: Path, cache: Path) -> None:
    folder = project(tmp_path / "first", cache, f"-Dkotlin.version={kotlin}")
    pom, _ = blocks(JVM_PAGE, "xml")
    (source,) = blocks(JVM_PAGE, "kotlin")
    (command,) = blocks(JVM_PAGE, "sh")
    assert JVM_PAGE.index("`pom.xml`") < JVM_PAGE.index(pom) < JVM_PAGE.index("`src/main/kotlin/First.kt`")
    write(folder, "pom.xml", pom)
    write(folder, "src/main/kotlin/First.kt", source)
    check_first_result(command, folder)


@pytest.mark.requirement("R-RECIPE")
def test_a_new_java_project_by_the_page_alone(tmp_path: Path, cache: Path) -> None:
    folder = project(tmp_path / "first", cache)
    pom, properties = blocks(JVM_PAGE, "xml")
    (source,) = blocks(JVM_PAGE, "java")
    (command,) = blocks(JVM_PAGE, "sh")
    (main,) = re.findall(r"with `(-Dexec.mainClass=First)`", JVM_PAGE)
    plugin = r" *<plugin>\n *<groupId>org.jetbrains.kotlin<(?s:.*?)</plugin>\n"
    removed = rf" *<sourceDirectory>.*</sourceDirectory>\n|{plugin}"
    pom, count = re.subn(removed, "", re.sub(r" *<kotlin.version>.*\n", properties, pom))
    assert count == 2
    write(folder, "pom.xml", pom)
    write(folder, "src/main/java/First.java", source)
    check_first_result(command.replace("-Dexec.mainClass=FirstKt", main), folder)


def check_first_result(command: str, folder: Path) -> None:
    """The page's command prints an accepted verdict and writes the result."""
    said = run(command.replace("/path/to/camssf", str(ROOT)), folder)
    assert said.lower().startswith("accepted, red at 600 nm: 0."), said
    result = json.loads((folder / "result.json").read_text("utf-8"))
    assert result["verdict"]["status"] == "accepted"
    assert "answer" in result


POM = """<project xmlns="http://maven.apache.org/POM/4.0.0">
  <modelVersion>4.0.0</modelVersion>
  <groupId>example</groupId>
  <artifactId>screen</artifactId>
  <version>1</version>
  <properties><project.build.sourceEncoding>UTF-8</project.build.sourceEncoding></properties>
  <repositories><repository><id>camssf</id><url>file://{repository}</url></repository></repositories>
  <dependencies>
    {dependencies}
  </dependencies>
  <build>
    <sourceDirectory>src/main/kotlin</sourceDirectory>
    <testSourceDirectory>src/test/kotlin</testSourceDirectory>
    <plugins>
      <plugin>
        <groupId>org.jetbrains.kotlin</groupId>
        <artifactId>kotlin-maven-plugin</artifactId>
        <version>{kotlin}</version>
        <executions>
          <execution><id>compile</id><goals><goal>compile</goal></goals></execution>
          <execution><id>test-compile</id><goals><goal>test-compile</goal></goals></execution>
        </executions>
        <configuration><jvmTarget>1.8</jvmTarget></configuration>
      </plugin>
      <plugin>
        <artifactId>maven-surefire-plugin</artifactId>
        <version>3.5.4</version>
        <configuration>
          <argLine>--add-opens=java.base/java.lang=ALL-UNNAMED --add-opens=java.base/java.io=ALL-UNNAMED</argLine>
          <additionalClasspathElements>
            <additionalClasspathElement>{robolectric}/monitor/classes.jar</additionalClasspathElement>
          </additionalClasspathElements>
          <systemPropertyVariables>
            <robolectric.offline>true</robolectric.offline>
            <robolectric.dependency.dir>{robolectric}/robolectric</robolectric.dependency.dir>
            <robolectric.graphicsMode>LEGACY</robolectric.graphicsMode>
            <robolectric.sqliteMode>LEGACY</robolectric.sqliteMode>
          </systemPropertyVariables>
        </configuration>
      </plugin>
    </plugins>
  </build>
</project>
"""
SCREEN = """package example

import android.content.ContentResolver
import android.content.Context
import android.graphics.Bitmap
import android.graphics.Color
import android.hardware.camera2.CameraCaptureSession
import android.hardware.camera2.CameraCharacteristics
import android.hardware.camera2.CameraDevice
import android.hardware.camera2.TotalCaptureResult
import android.media.Image
import android.media.ImageReader
import android.net.Uri
import android.os.Handler
import android.widget.ImageView
import androidx.camera.core.Camera
import androidx.camera.core.CameraSelector
import androidx.camera.core.ImageAnalysis
import androidx.camera.core.ImageCapture
import androidx.camera.core.Preview
import androidx.camera.lifecycle.ProcessCameraProvider
import androidx.lifecycle.LifecycleOwner
import java.io.File
{imports}

class Screen(private val contentResolver: ContentResolver, private val filesDir: File) {{
    private val cacheDir = filesDir
    val shown = ArrayList<String>()

    private fun show(vararg what: Any?) {{
        shown += what.joinToString(" ")
    }}

    private fun log(words: String) = show(words)

    suspend fun chosen(
        uri: Uri, x1: Double, y1: Double, x2: Double, y2: Double, x3: Double, y3: Double, x4: Double, y4: Double,
    ) {{
{first}
    }}

    fun bound(context: Context, owner: LifecycleOwner, provider: ProcessCameraProvider, preview: Preview) {{
{binding}
    }}

    suspend fun photographed(camera: ChartCamera, analysis: ImageAnalysis, capture: ImageCapture) {{
{camerax}
    }}

    fun photographed(
        characteristics: CameraCharacteristics, device: CameraDevice, reader: ImageReader,
        session: CameraCaptureSession, callback: CameraCaptureSession.CaptureCallback, handler: Handler,
        image: Image, result: TotalCaptureResult,
        corners: Corners,
    ) {{
{camera}
    }}

    fun repeated(
        characteristics: CameraCharacteristics, device: CameraDevice, reader: ImageReader,
        session: CameraCaptureSession, callback: CameraCaptureSession.CaptureCallback, handler: Handler,
    ) {{
{lock}
    }}

    suspend fun locked(camera: ChartCamera, bound: Camera, capture: ImageCapture) {{
{lock_camerax}
    }}

    fun live(
        first: Mosaic, frame: Mosaic, whiteArea: Region, stripArea: Region, previewArea: Region, view: ImageView,
        x: Int, y: Int,
    ) {{
{white}
{live}
{picture}
{preview}
    }}

{language}
}}
"""
SCREEN_TEST = """package example

import android.net.Uri
import android.widget.ImageView
import java.io.File
import kotlinx.coroutines.runBlocking
import org.camssf.photo.PhotoSource
import org.camssf.photo.Region
import org.junit.Assert.assertTrue
import org.junit.Test
import org.junit.runner.RunWith
import org.robolectric.RobolectricTestRunner
import org.robolectric.RuntimeEnvironment
import org.robolectric.annotation.Config

@RunWith(RobolectricTestRunner::class)
@Config(sdk = [35])
class ScreenTest {{
    @Test
    fun firstResult() {{
        val app = RuntimeEnvironment.getApplication()
        val photo = File(app.filesDir, "photo.dng")
        File("{photo}").copyTo(photo)
        val screen = Screen(app.contentResolver, app.filesDir)
        runBlocking {{ screen.chosen(Uri.fromFile(photo), {corners}) }}
        assertTrue("${{screen.shown}}", screen.shown.single().startsWith("red at 600 nm 0."))
        val result = File(app.filesDir, "result.json").readText()
        assertTrue(result, "\\"curves\\":" in result)
        File("result.json").writeText(result)
        screen.shown.clear()
        val mosaic = PhotoSource.of(photo).read(null)
        val area = Region.ofSize(left = 22, top = 94, width = 16, height = 16)
        screen.live(mosaic, mosaic, area, area, area, ImageView(app), 30, 100)
        assertTrue("${{screen.shown}}", screen.shown.size == 2 && screen.shown[1].startsWith("L* is uncertain by "))
    }}
}}
"""


def dependency(coordinates: str, more: str = "") -> str:
    group, name, version = coordinates.split(":")
    return (
        f"<dependency><groupId>{group}</groupId><artifactId>{name}</artifactId><version>{version}</version>"
        f"{more}</dependency>"
    )


def excluding(*groups: str) -> str:
    """These groups' artefacts left out: no registry here has them."""
    excluded = "".join(
        f"<exclusion><groupId>{group}</groupId><artifactId>*</artifactId></exclusion>" for group in groups
    )
    return f"<exclusions>{excluded}</exclusions>"


def versions_of_the_build(*names: str) -> dict[str, str]:
    text = (ROOT / "android-bindings" / "pom.xml").read_text("utf-8")
    return {name: re.findall(rf"<{name}\.version>([^<]+)<", text)[0] for name in names}


@pytest.mark.requirement("R-RECIPE")
def test_a_new_android_module_by_the_page_alone(tmp_path: Path, cache: Path) -> None:
    """The page's code on the framework's classes; no Gradle, CameraX or phone's runtime."""
    asked = dict(
        reversed(re.match(r"(.*?:(.*?):.*)", found).groups())  # type: ignore[union-attr]
        for found in re.findall(r'implementation\("(org\.camssf:[\w.:-]+)"\)', ANDROID_PAGE)
    )
    assert set(asked) == {"camssf-camera2", "camssf-camerax", "camssf-colour"}
    of = versions_of_the_build("robolectric", "android", "kotlin", "junit", "onnxruntime")
    graphics = (
        "<scope>test</scope><exclusions><exclusion><groupId>org.robolectric</groupId>"
        "<artifactId>nativeruntime-dist-compat</artifactId></exclusion></exclusions>"
    )
    folder = project(tmp_path / "screen", cache)
    # Maven compiles with no AAR: its classes are taken out. The stubs stand for CameraX.
    (aar,) = (REPOSITORY / "org" / "camssf" / "camssf-camera2").glob("*/*.aar")
    with zipfile.ZipFile(aar) as archive:
        archive.extract("classes.jar", folder)
    (stubs,) = (BINDINGS / "camerax-stubs" / "target").glob("camssf-camerax-stubs-*[0-9T].jar")
    dependencies = [
        dependency(asked["camssf-camera2"], f"<type>aar</type>{excluding('com.microsoft.onnxruntime')}"),
        dependency(asked["camssf-camerax"], excluding("androidx.camera", "com.microsoft.onnxruntime")),
        *[dependency(asked["camssf-colour"].replace("colour", name)) for name in ("colour", "passport", "testing")],
        dependency("local:camera2:1", f"<scope>system</scope><systemPath>{folder / 'classes.jar'}</systemPath>"),
        dependency("local:stubs:1", f"<scope>system</scope><systemPath>{stubs}</systemPath>"),
        dependency(f"com.microsoft.onnxruntime:onnxruntime:{of['onnxruntime']}", "<scope>test</scope>"),
        dependency(f"org.junit.vintage:junit-vintage-engine:{of['junit']}", "<scope>test</scope>"),
        dependency(f"org.robolectric:robolectric:{of['robolectric']}", graphics),
        dependency(f"org.robolectric:android-all:{of['android']}", "<scope>provided</scope>"),
    ]
    begins = {
        "first": "PhotoSource.dng",
        "camera": "CaptureRequirements.check",
        "binding": "bindToLifecycle",
        "camerax": "awaitChart",
        "language": "inWords",
        "lock": "setRepeatingRequest",
        "lock_camerax": "camera.lock",
        "white": "LightWatch(",
        "live": "watch.look",
        "picture": "picture.strips",
        "preview": "RawPixels.of",
    }
    pages = [block for page in (ANDROID_PAGE, LIVE_PAGE) for block in blocks(page, "kotlin")]
    code = {name: next(block for block in pages if begin in block) for name, begin in begins.items()}
    assert set(blocks(LIVE_PAGE, "kotlin")) <= set(code.values())
    lines = [line for block in code.values() for line in block.splitlines()]
    imports = "\n".join(sorted({line for line in lines if line.startswith("import ")}))
    code = {name: re.sub(r"^import .*\n", "", block, flags=re.MULTILINE) for name, block in code.items()}
    pom = POM.format(
        repository=REPOSITORY, robolectric=ROBOLECTRIC, kotlin=of["kotlin"], dependencies="\n    ".join(dependencies)
    )
    write(folder, "pom.xml", pom)
    write(folder, "src/main/kotlin/example/Screen.kt", SCREEN.format(imports=imports, **code))

    corners = "22.44, 17.44, 156.56, 22.44, 162.56, 116.56, 16.44, 109.56"
    photo = ROOT / "golden" / "dng" / "chart-turned-0.dng"
    write(folder, "src/test/kotlin/example/ScreenTest.kt", SCREEN_TEST.format(photo=photo, corners=corners))
    run("mvn -q test", folder)
    assert "answer" in json.loads((folder / "result.json").read_text("utf-8"))
