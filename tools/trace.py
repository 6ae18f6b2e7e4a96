"""Requirements, risks, tests and their results: `python -m tools.trace [--results DIR]` checks that none is missing.

Requirements are in tools/requirements.json. A test names those that it verifies: in Python by
`@pytest.mark.requirement("R-...")` or a file's `pytestmark`, in Kotlin by `@Tag("R-...")` on a class.
Results are read from JUnit XML by pytest and Surefire. The command exits with 1 if a requirement has no test, a
marker or a row of the table in docs/claims.md names an unknown one, or, with results, if a requirement's test failed
or none ran. The site shows the table, with the results in out/results.
"""

from __future__ import annotations

import ast
import json
import re
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import NamedTuple, TypeAlias
from xml.etree import ElementTree

from benchmarks.shared import command_parser
from camssf import __version__
from tools.pages import markdown_table

ROOT = Path(__file__).parents[1]
NOT_RUN = "not run"
TAG = re.compile(r'@(?:[\w.]+\.)?Tag\("(R-[A-Z0-9-]+)"\)')


class Marked(NamedTuple):
    """A marked test, or all tests of a marked file or class.

    Attributes:
        requirement: name of the requirement.
        place: path of the file, relative to the repository.
        group: class name in JUnit XML: Python's module, Kotlin's class.
        test: name of the function; None for all of the group.
    """

    requirement: str
    place: str
    group: str
    test: str | None


Results: TypeAlias = dict[tuple[str, str], Counter[str]]
"""How many cases of a group and test passed, **failed** or were skipped."""


def read_requirements() -> dict[str, dict[str, str]]:
    """What each requirement says (`text`), and what happens to whom if it does not hold (`risk`), by its name.

    Raises:
        ValueError: two requirements have one name.
    """
    rows = json.loads((ROOT / "tools" / "requirements.json").read_text("utf-8"))
    found = {row["name"]: row for row in rows}
    if len(found) < len(rows):
        raise ValueError("A name in tools/requirements.json is there twice.")
    return found


def python_markers(text: str, place: str) -> Iterator[Marked]:
    """The markers in one Python test file."""
    group = place.removesuffix(".py").replace("/", ".")
    for node in ast.parse(text).body:
        marks, test = [], None
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "pytestmark":
            marks = [node.value]
        elif isinstance(node, ast.FunctionDef):
            marks, test = node.decorator_list, node.name
        for call in (inner for mark in marks for inner in ast.walk(mark) if isinstance(inner, ast.Call)):
            if ast.unparse(call.func) == "pytest.mark.requirement":
                yield from (Marked(ast.literal_eval(name), place, group, test) for name in call.args)


def kotlin_markers(text: str, place: str) -> Iterator[Marked]:
    """The markers in one Kotlin test file.

    Raises:
        ValueError: one does not stand before a class.
    """
    (package,) = re.findall(r"^package (\S+)$", text, re.MULTILINE)
    marked = re.findall(r"((?:^@.*\n)+)(?:\w+ )*class (\w+)", text, re.MULTILINE)
    found = [Marked(tag, place, f"{package}.{name}", None) for marks, name in marked for tag in TAG.findall(marks)]
    if len(found) < len(TAG.findall(text)):
        raise ValueError(f"{place} has a tag that does not stand before a class.")
    yield from found


@cache
def markers() -> tuple[Marked, ...]:
    """The markers of all tests in both languages."""
    languages = (
        (python_markers, "tests/**/test_*.py"),
        (kotlin_markers, "android-bindings/*/src/test/kotlin/**/*.kt"),
    )
    return tuple(
        marker
        for read, pattern in languages
        for path in sorted(ROOT.glob(pattern))
        for marker in read(path.read_text("utf-8"), path.relative_to(ROOT).as_posix())
    )


def result_files(folder: Path) -> list[Path]:
    """Surefire's files anywhere below the folder, and pytest's files in it, one a run."""
    return sorted({*folder.glob("**/TEST-*.xml"), *folder.glob("pytest*.xml")})


def read_results(paths: Sequence[Path]) -> Results:
    """The results in JUnit XML files; for a folder, in all TEST-*.xml below it and its pytest*.xml."""
    results: Results = {}
    for file in [file for path in paths for file in (result_files(path) if path.is_dir() else [path])]:
        for case in ElementTree.parse(file).iter("testcase"):
            children = {child.tag for child in case}
            failed = "**failed**" if children & {"failure", "error"} else "passed"
            bare = re.split(r"[\[({]", case.get("name", ""))[0]  # without parameters and suffixes of test runners
            key = (case.get("classname", ""), bare)
            results.setdefault(key, Counter())["skipped" if "skipped" in children else failed] += 1
    return results


def counts(name: str, results: Results) -> Counter[str]:
    """The results of one requirement's tests; a test with two markers counts once."""
    tests = {(test.group, test.test) for test in markers() if test.requirement == name}
    found = (count for (group, test), count in results.items() if tests & {(group, None), (group, test)})
    return sum(found, Counter[str]())


def in_words(count: Counter[str]) -> str:
    """The numbers that are not zero."""
    order = ("passed", "**failed**", "skipped")
    return ", ".join(f"{count[kind]} {kind}" for kind in order if count[kind]) or NOT_RUN


def claims(page: str) -> dict[str, str]:
    """The claims of the page's table, without markup, each with the requirement that its row names."""
    table = page.partition("## What is proven, and what is not")[2].partition("\n## ")[0]
    rows = [row.strip("| ").split(" | ") for row in table.splitlines() if row.startswith("| ")]
    return {re.sub(r"\*\*|`", "", first): last for first, *_, last in rows if first != "claim"}


def faults(results: Results | None) -> list[str]:
    """What is missing or wrong in the trace, each with what to do."""
    known, shown = read_requirements(), {test.requirement for test in markers()}
    found = [
        f"{name} has no test. Mark one: pytest.mark.requirement({name!r}) or @Tag({json.dumps(name)})."
        for name in known
        if name not in shown
    ]
    named = [(test.place, test.requirement) for test in markers()]
    claimed = claims((ROOT / "docs" / "claims.md").read_text("utf-8"))
    named += [(f"The claim {claim[:60]!r}", name) for claim, name in claimed.items()]
    found += [
        f"{place} names {name}, which tools/requirements.json does not know."
        for place, name in named
        if name not in known
    ]
    ended = {} if results is None else {name: counts(name, results) for name in known}
    return found + [f"{name}: {in_words(n)}." for name, n in ended.items() if n["**failed**"] or not n["passed"]]


def table() -> str:
    """When the tests of the results in out/results ran, and the requirements with what came of their tests."""
    files = result_files(ROOT / "out" / "results")
    results = read_results(files)
    rows = []
    for name, each in read_requirements().items():
        places = dict.fromkeys(f"`{Path(test.place).name}`" for test in markers() if test.requirement == name)
        rows.append((name, each["text"], each["risk"], ", ".join(places), in_words(counts(name, results))))
    times = [path.stat().st_mtime for path in files]
    run = f"{datetime.fromtimestamp(max(times), UTC):%Y-%m-%d %H:%M} UTC, camssf {__version__}" if times else NOT_RUN
    head = ("requirement", "what", "if it did not hold", "tests", "last run")
    return f"Last run: {run}.\n\n{markdown_table(head, rows)}"


def main(argv: Sequence[str] | None = None) -> int:
    """Check the trace; returns 1 if there are faults."""
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("--results", type=Path, nargs="*", default=[], help="JUnit XML, folders with TEST-*.xml")
    paths = parser.parse_args(argv).results
    results = read_results(paths) if paths else None
    wrong, names = faults(results), read_requirements()
    for fault in wrong:
        print(fault, file=sys.stderr)
    cases = "" if results is None else f", {in_words(sum((counts(name, results) for name in names), Counter()))}"
    marked = len({(test.place, test.test) for test in markers()})
    print(f"trace: {len(names)} requirements, {marked} markers{cases}, {len(wrong)} faults")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
