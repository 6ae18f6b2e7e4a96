"""What the Kotlin build counted, as VERIFICATION.md shows it: `python -m tools.verification [--check]`.

Reads what `mvn -f android-bindings verify` left: Surefire's reports and the repository folder.
"""

from __future__ import annotations

import re
import sys
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Sequence
from pathlib import Path

from tools.pages import filled, markdown_table, parser, write_or_check

BINDINGS = Path(__file__).parents[1] / "android-bindings"
PAGE = "VERIFICATION.md"
COMMAND = "python -m tools.verification"
SIZES = re.compile(
    r"an app's part: classes (?P<classes>\d+) kB, models, tables and rules (?P<data>\d+) kB"
    r"|dex of the smallest app (?P<dex>\d+)"
)


def suites(bindings: Path) -> dict[str, ET.Element]:
    """Surefire's reports by the full name of the test class.

    Raises:
        FileNotFoundError: a module with tests has no report.
    """
    modules = {path.parents[2] for path in bindings.glob("*/src/test/kotlin")}
    reports = [path for module in modules for path in module.glob("target/surefire-reports/TEST-*.xml")]
    if missing := sorted(module.name for module in modules - {path.parents[2] for path in reports}):
        raise FileNotFoundError(
            f"No reports of {', '.join(missing)} in {bindings}: run mvn -f android-bindings verify first."
        )
    return {suite.attrib["name"]: suite for suite in (ET.parse(path).getroot() for path in sorted(reports))}


def markdown(bindings: Path) -> str:
    """The counts and sizes of a build; sizes in whole 10 kB, since another JDK packs a little differently."""
    tests = suites(bindings)
    total = sum(int(suite.attrib["tests"]) for suite in tests.values())
    golden = tests["org.camssf.golden.GoldenTest"].attrib
    ran = int(golden["tests"]) - int(golden["skipped"])
    printed = "\n".join(out.text or "" for out in tests["org.camssf.packaging.ShrunkJarTest"].iter("system-out"))
    sizes = {name: int(size) for match in SIZES.finditer(printed) for name, size in match.groupdict().items() if size}
    repository = bindings / "packaging" / "target" / "repository"
    for name in ("core", "model"):
        named = re.compile(rf"camssf-{name}-[\d.]+(-SNAPSHOT)?\.jar")
        (jar,) = (path for path in repository.glob("**/*.jar") if named.fullmatch(path.name))
        sizes[name] = jar.stat().st_size // 1000
    pages = 0
    for path in repository.glob("**/*-javadoc.jar"):
        with zipfile.ZipFile(path) as archive:
            pages += sum(name.endswith(".html") for name in archive.namelist())
    rows = [
        ("golden cases that Kotlin ran", str(ran)),
        ("golden cases that it left to the model or to Python", golden["skipped"]),
        ("tests in Kotlin, the golden cases among them", str(total)),
        ("pages of KDoc", str(pages)),
        *(
            (words, f"{round(sizes[name], -1)} kB")
            for name, words in {
                "core": "jar of `camssf-core`",
                "model": "jar of `camssf-model`",
                "classes": "classes of an app that does what docs/android.md shows, colour too, after R8, compressed",
                "data": "its models, tables and rules",
                "dex": "dex of an app that reads a DNG and calibrates, after R8, not compressed",
            }.items()
        ),
    ]
    return markdown_table(("what", "number"), rows)


def main(argv: Sequence[str] | None = None) -> int:
    """Write the table, or say whether it is the build's."""
    check = parser(COMMAND, __doc__).parse_args(argv).check
    made = filled((BINDINGS / PAGE).read_text("utf-8"), {COMMAND: markdown(BINDINGS)})
    return write_or_check(COMMAND, BINDINGS, {PAGE: made}, check=check)


if __name__ == "__main__":
    sys.exit(main())
