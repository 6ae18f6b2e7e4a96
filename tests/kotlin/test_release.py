"""What is refused when the Kotlin artefacts are signed and uploaded; `python -m tools.release` does sign them."""

import hashlib
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

BINDINGS = Path(__file__).parents[2] / "android-bindings"

pytestmark = pytest.mark.full
if shutil.which("mvn") is None or shutil.which("gpg") is None or sys.platform == "win32":
    pytest.skip("there is no Java build (mvn) or no gpg: signing is not rehearsed", allow_module_level=True)


def mvn(*words: str) -> subprocess.CompletedProcess[str]:
    command = ["mvn", "--batch-mode", "--no-transfer-progress", "-N", "-f", str(BINDINGS), *words]
    return subprocess.run(command, capture_output=True, text=True)


def version() -> str:
    text = (BINDINGS / "pom.xml").read_text("utf-8")
    return text.partition("<artifactId>camssf-parent</artifactId>")[2].partition("<version>")[2].partition("<")[0]


@pytest.mark.requirement("R-RELEASE")
def test_without_a_key_nothing_is_signed() -> None:
    done = mvn("antrun:run@bundle")
    assert done.returncode != 0
    assert "No key to sign with. Say which of gpg's secret keys: -Drelease.key=FINGERPRINT" in done.stdout


def test_the_self_test_app_is_an_asset_only_with_its_native_library(tmp_path: Path) -> None:
    apk = tmp_path / "built.apk"
    settings = ["antrun:run@asset", f"-Drelease.apk={apk}", f"-Drelease.out={tmp_path}"]
    asset = tmp_path / f"camssf-selftest-{version()}.apk"
    for name in ("classes.dex", "lib/arm64-v8a/libonnxruntime.so"):
        with zipfile.ZipFile(apk, "w") as archive:
            archive.writestr(name, name)
        done = mvn(*settings)
        assert (done.returncode == 0) == asset.is_file() == name.endswith(".so"), done.stdout
        assert ("without ONNX Runtime's Android library. Build it: mvn" in done.stdout) == name.endswith(".dex")
    said = Path(f"{asset}.sha256").read_text("utf-8").split()
    assert said == [hashlib.sha256(apk.read_bytes()).hexdigest(), f"*{asset.name}"]


def test_nothing_that_was_not_signed_is_uploaded(tmp_path: Path) -> None:
    done = mvn("antrun:run@upload", f"-Drelease.out={tmp_path}")
    assert done.returncode != 0
    assert "is not there. Sign it first" in done.stdout
