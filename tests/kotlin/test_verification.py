"""The numbers of android-bindings/VERIFICATION.md come from the build's own output."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest

from tools import verification

SUITE = '<testsuite name="org.camssf.{0}" tests="{1}" skipped="{2}"><system-out>{3}</system-out></testsuite>'
SAID = (
    "an app's part: classes 775 kB, models, tables and rules 680 kB\n"
    "kB: jars of core and model 990 and 205, dex of the smallest app 434\n"
)


@pytest.fixture
def build(tmp_path: Path) -> Path:
    for module, suite in (
        ("golden", ("golden.GoldenTest", 12, 2, "")),
        ("packaging", ("packaging.ShrunkJarTest", 3, 0, SAID)),
    ):
        (tmp_path / module / "src" / "test" / "kotlin").mkdir(parents=True)
        reports = tmp_path / module / "target" / "surefire-reports"
        reports.mkdir(parents=True)
        (reports / "TEST-a.xml").write_text(SUITE.format(*suite), encoding="utf-8")
    for name, size in (("core", 946_000), ("model", 205_900)):
        folder = tmp_path / "packaging" / "target" / "repository" / name
        folder.mkdir(parents=True)
        (folder / f"camssf-{name}-0.1.0-SNAPSHOT.jar").write_bytes(bytes(size))
        with zipfile.ZipFile(folder / f"camssf-{name}-0.1.0-SNAPSHOT-javadoc.jar", "w") as archive:
            archive.writestr("index.html", "")
            archive.writestr("LICENSE", "")
    return tmp_path


def test_counts_and_sizes_are_the_builds(build: Path) -> None:
    numbers = [line.split("|")[2].strip() for line in verification.markdown(build).splitlines()[2:]]
    assert numbers == ["10", "2", "15", "2", "950 kB", "200 kB", "780 kB", "680 kB", "430 kB"]


def test_a_module_that_was_not_tested_is_named(build: Path) -> None:
    (build / "golden" / "target" / "surefire-reports" / "TEST-a.xml").unlink()
    with pytest.raises(FileNotFoundError, match=r"No reports of golden in .*: run mvn -f android-bindings verify"):
        verification.markdown(build)
