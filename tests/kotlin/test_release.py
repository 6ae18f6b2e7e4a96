"""Signing and upload of the Kotlin artefacts: refused by name without keys, and whole with a throwaway one."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest

BINDINGS = Path(__file__).parents[2] / "android-bindings"
FILES = ("camssf-core-{}.jar", "camssf-core-{}.pom", "camssf-core-{}-sources.jar")

ENVIRONMENT = os.environ | {"MAVEN_OPTS": "-XX:TieredStopAtLevel=1 -XX:+UseSerialGC"}
"""A Java that compiles little: each build here is short."""

pytestmark = pytest.mark.full
if shutil.which("mvn") is None or shutil.which("gpg") is None or sys.platform == "win32":
    pytest.skip("there is no Java build (mvn) or no gpg: signing is not rehearsed", allow_module_level=True)


@pytest.fixture(scope="module")
def key() -> Iterator[tuple[str, dict[str, str]]]:
    """A throwaway key's fingerprint, and an environment in which gpg knows no other."""
    folder = Path(tempfile.mkdtemp(prefix="gpg"))  # gpg's agent has a socket in it, whose path must be short
    environment = {**ENVIRONMENT, "GNUPGHOME": str(folder)}
    make = ["gpg", "--batch", "--pinentry-mode", "loopback", "--passphrase", "", "--quick-gen-key", "throwaway"]
    subprocess.run(make, env=environment, check=True, capture_output=True)
    done = subprocess.run(
        ["gpg", "--batch", "--list-secret-keys", "--with-colons"], env=environment, capture_output=True, text=True
    ).stdout
    yield next(line.split(":")[9] for line in done.splitlines() if line.startswith("fpr:")), environment
    subprocess.run(["gpgconf", "--kill", "all"], env=environment, capture_output=True)
    shutil.rmtree(folder)


def mvn(*words: str, environment: dict[str, str] | None = None) -> subprocess.CompletedProcess[str]:
    command = ["mvn", "--batch-mode", "--no-transfer-progress", "-N", "-f", str(BINDINGS), *words]
    return subprocess.run(command, capture_output=True, text=True, env=environment or ENVIRONMENT)


def version() -> str:
    text = (BINDINGS / "pom.xml").read_text("utf-8")
    return text.partition("<artifactId>camssf-parent</artifactId>")[2].partition("<version>")[2].partition("<")[0]


@pytest.mark.requirement("R-RELEASE")
def test_without_a_key_nothing_is_built() -> None:
    done = mvn("-Prelease", "verify")
    assert done.returncode != 0
    assert "No key to sign with. Say which of gpg's secret keys: -Drelease.key=FINGERPRINT" in done.stdout
    assert "kotlin-maven-plugin" not in done.stdout


def test_a_key_that_gpg_has_not(key: tuple[str, dict[str, str]]) -> None:
    _, environment = key
    done = mvn("-Prelease", "validate", "-Drelease.key=ABCDEF", "-Drelease.rehearsal=true", environment=environment)
    assert done.returncode != 0
    assert "gpg has no secret key ABCDEF" in done.stdout


def test_a_snapshot_is_not_signed(key: tuple[str, dict[str, str]]) -> None:
    name, environment = key
    done = mvn("-Prelease", "validate", f"-Drelease.key={name}", environment=environment)
    assert (done.returncode != 0) == version().endswith("-SNAPSHOT")
    assert ("is a snapshot, which Maven Central does not take" in done.stdout) == version().endswith("-SNAPSHOT")


@pytest.mark.requirement("R-RELEASE")
def test_with_a_key_every_file_is_signed_and_summed(key: tuple[str, dict[str, str]], tmp_path: Path) -> None:
    name, environment = key
    place = Path("org/camssf/camssf-core") / version()
    repository = tmp_path / "repository"
    (repository / place).mkdir(parents=True)
    files = [place / file.format(version()) for file in FILES]
    for at, file in enumerate(files):
        (repository / file).write_bytes(bytes([at]) * 1000)
    settings = [f"-Drelease.key={name}", "-Drelease.rehearsal=true", f"-Drelease.repository={repository}"]
    done = mvn("antrun:run@bundle", *settings, f"-Drelease.out={tmp_path}", environment=environment)
    assert done.returncode == 0, done.stdout[-3000:]
    (bundle,) = tmp_path.glob("camssf-*-bundle.zip")
    with zipfile.ZipFile(bundle) as archive:
        names = {each for each in archive.namelist() if not each.endswith("/")}
        archive.extractall(tmp_path / "out")
    assert names == {f"{file.as_posix()}{end}" for file in files for end in ("", ".asc", ".md5", ".sha1")}
    for file in files:
        there = tmp_path / "out" / file
        content = there.read_bytes()
        assert content == (repository / file).read_bytes()
        for kind in ("md5", "sha1"):
            said = Path(f"{there}.{kind}").read_text("utf-8").strip()
            assert said == hashlib.new(kind, content).hexdigest()
        checked = ["gpg", "--batch", "--verify", f"{there}.asc", str(there)]
        assert subprocess.run(checked, env=environment, capture_output=True).returncode == 0
    refused = mvn("antrun:run@upload", f"-Drelease.out={tmp_path}")
    assert refused.returncode != 0
    assert "No token for Maven Central" in refused.stdout


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
