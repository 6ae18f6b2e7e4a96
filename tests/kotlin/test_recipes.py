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

from tests.support.pages import ROOT, blocks, text_of

BINDINGS = Path(os.environ.get("CAMSSF_BINDINGS", ROOT / "android-bindings"))
REPOSITORY = Path(os.environ.get("CAMSSF_REPOSITORY", BINDINGS / "packaging" / "target" / "repository"))
ROBOLECTRIC = BINDINGS / "camera2" / "target"
JVM_PAGE, ANDROID_PAGE, LIVE_PAGE = map(text_of, ("docs/jvm.md", "docs/android.md", "docs/live.md"))

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
    said = run(command.replace("/path/to/camssf", str(ROOT)), folder)
    assert said.lower().startswith("accepted, red at 600 nm: 0."), said
    result = json.loads((folder / "result.json").read_text("utf-8"))
    assert result["verdict"]["status"] == "accepted"
    assert "answer" in result


@pytest.mark.requirement("R-RECIPE")
def test_a_new_android_module_by_the_page_alone(tmp_path: Path, cache: Path) -> None:
    """The page's code on the framework's classes; no Gradle, CameraX or phone's runtime."""
    artefacts = dict(re.findall(r'implementation\("org\.camssf:([\w-]+):([\w.-]+)"\)', ANDROID_PAGE))
    assert set(artefacts) == {"camssf-camera2", "camssf-camerax", "camssf-colour"}
    (camssf,) = set(artefacts.values())
    build = (ROOT / "android-bindings" / "pom.xml").read_text("utf-8")
    versions = dict(re.findall(r"<(robolectric|android|kotlin|junit|onnxruntime)\.version>([^<]+)<", build))
    folder = project(tmp_path / "screen", cache)
    # Maven compiles with no AAR: its classes are taken out. The stubs stand for CameraX.
    (aar,) = (REPOSITORY / "org" / "camssf" / "camssf-camera2").glob("*/*.aar")
    with zipfile.ZipFile(aar) as archive:
        archive.extract("classes.jar", folder)
    (stubs,) = (BINDINGS / "camerax-stubs" / "target").glob("camssf-camerax-stubs-*[0-9T].jar")
    begins = {
        "first": "PhotoSource.dng", "camera": "CaptureRequirements.check", "binding": "bindToLifecycle",
        "camerax": "awaitChart", "language": "inWords", "lock": "setRepeatingRequest", "lock_camerax": "camera.lock",
        "white": "LightWatch(", "live": "watch.look", "picture": "picture.strips", "preview": "RawPixels.of",
    }  # fmt: skip
    pages = [block for page in (ANDROID_PAGE, LIVE_PAGE) for block in blocks(page, "kotlin")]
    code = {name: next(block for block in pages if begin in block) for name, begin in begins.items()}
    assert set(blocks(LIVE_PAGE, "kotlin")) <= set(code.values())
    lines = [line for block in code.values() for line in block.splitlines()]
    imports = "\n".join(sorted({line for line in lines if line.startswith("import ")}))
    code = {name: re.sub(r"^import .*\n", "", block, flags=re.MULTILINE) for name, block in code.items()}
    places = {"camssf": camssf, "repository": REPOSITORY, "target": ROBOLECTRIC, "stubs": stubs, "imports": imports}
    values = versions | code | places | {"photo": ROOT / "golden" / "dng" / "chart-turned-0.dng"}
    for name in ("pom.xml", "src/main/kotlin/example/Screen.kt", "src/test/kotlin/example/ScreenTest.kt"):
        text = (Path(__file__).parent / "screen" / Path(name).name).read_text("utf-8")
        write(folder, name, re.sub("@([a-z0-9_]+)@", lambda place: str(values[place[1]]), text))
    run("mvn -q test", folder)
    assert "answer" in json.loads((folder / "result.json").read_text("utf-8"))
