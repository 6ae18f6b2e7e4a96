"""Requirements, risks, tests and their results: `python -m tools.trace [--results DIR]` checks that none is missing.

Requirements are in tools/requirements.json. A test names those that it verifies: in Python by
`@pytest.mark.requirement("R-...")` or a file's `pytestmark`, in Kotlin by `@Tag("R-...")` on a class or a function.
Results are read from JUnit XML by pytest and Surefire. The command exits with 1 if a requirement has no test, a
marker or a row of the table in docs/claims.md names an unknown one, or, with results, if a requirement's test failed
or none ran. The site shows the table, with the results in out/results.
"""

from __future__ import annotations

import argparse
import ast
import json
import re
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import NamedTuple, TypeAlias
from xml.etree import ElementTree

from camssf import __version__
from tools.pages import markdown_table

ROOT = Path(__file__).parents[1]
REQUIREMENTS = Path(__file__).parent / "requirements.json"
RESULTS = ROOT / "out" / "results"
CLAIMS_PAGE = ROOT / "docs" / "claims.md"
COMMAND = "python -m tools.trace"
HEAD = ("requirement", "what", "if it did not hold", "tests", "last run")
CLAIMS = "## What is proven, and what is not"
NOT_RUN = "not run"
TAG = re.compile(r'@(?:[\w.]+\.)?Tag\("(R-[A-Z0-9-]+)"\)')
DECLARED = re.compile(r"^\s*(?:(?:internal|public|private|open|abstract) )*(class|fun) (`[^`]+`|\w+)")


@dataclass(frozen=True)
class Requirement:
    """One requirement.

    Attributes:
        name: R- and capital letters.
        text: one sentence.
        risk: what happens to whom if it does not hold.
    """

    name: str
    text: str
    risk: str


class Marked(NamedTuple):
    """A marked test, or all tests of a marked file or class.

    Attributes:
        requirement: name of the requirement.
        place: path of the file, relative to the repository.
        group: class name in JUnit XML: Python's module, Kotlin's class.
        test: name of the function; None for all.
    """

    requirement: str
    place: str
    group: str
    test: str | None


Results: TypeAlias = dict[tuple[str, str], Counter[str]]
"""How many cases of a group and test passed, **failed** or were skipped."""


def read_requirements(path: Path = REQUIREMENTS) -> list[Requirement]:
    """All requirements, in the file's order."""
    return [Requirement(**each) for each in json.loads(path.read_text("utf-8"))]


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
    """The markers in one Kotlin test file; tags are on the lines before their class or function."""
    (package,) = re.findall(r"^package (\S+)$", text, re.MULTILINE)
    tags: list[str] = []
    group = ""
    for line in text.splitlines():
        tags += TAG.findall(line)
        if declared := DECLARED.match(TAG.sub("", line)):
            kind, name = declared[1], declared[2].strip("`")
            if kind == "class" and not line.startswith(" "):
                group = f"{package}.{name}"
            yield from (Marked(tag, place, group, None if kind == "class" else name) for tag in tags)
            tags = []


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
            key = (case.get("classname", ""), _bare(case.get("name", "")))
            results.setdefault(key, Counter())["skipped" if "skipped" in children else failed] += 1
    return results


def _bare(name: str) -> str:
    """The name up to the first bracket, without parameters and suffixes of test runners."""
    return re.split(r"[\[({]", name, maxsplit=1)[0]


def counts(name: str, results: Results) -> Counter[str]:
    """The results of one requirement's tests; a test with two markers counts once."""
    tests = {(test.group, test.test and _bare(test.test)) for test in markers() if test.requirement == name}
    found = (count for (group, test), count in results.items() if tests & {(group, None), (group, test)})
    return sum(found, Counter[str]())


def in_words(count: Counter[str]) -> str:
    """The numbers that are not zero."""
    order = ("passed", "**failed**", "skipped")
    return ", ".join(f"{count[kind]} {kind}" for kind in order if count[kind]) or NOT_RUN


def claims(page: str) -> dict[str, str]:
    """The claims of the page's table, without markup, each with the requirement that its row names."""
    table = page.partition(CLAIMS)[2].partition("\n## ")[0]
    rows = [row.strip("| ").split(" | ") for row in table.splitlines() if row.startswith("| ")]
    return {re.sub(r"\*\*|`", "", first): last for first, *_, last in rows if first != "claim"}


def faults(results: Results | None) -> list[str]:
    """What is missing or wrong in the trace, each with what to do."""
    requirements = read_requirements()
    known, shown = {requirement.name for requirement in requirements}, {test.requirement for test in markers()}
    found = [
        f"{name} is there {n} times." for name, n in Counter(each.name for each in requirements).items() if n > 1
    ]
    found += [
        f"{name} has no test. Mark one: pytest.mark.requirement({name!r}) or @Tag({json.dumps(name)})."
        for name in sorted(known - shown)
    ]
    found += [
        f"{test.place} names {test.requirement}, which tools/requirements.json does not know."
        for test in markers()
        if test.requirement not in known
    ]
    found += [
        f"The claim {claim[:60]!r} names {name}, which tools/requirements.json does not know."
        for claim, name in claims(CLAIMS_PAGE.read_text("utf-8")).items()
        if name not in known
    ]
    if results is not None:
        ended = {requirement.name: counts(requirement.name, results) for requirement in requirements}
        found += [
            f"{name}: {in_words(count)}."
            for name, count in ended.items()
            if count["**failed**"] or not count["passed"]
        ]
    return found


def table(folder: Path = RESULTS) -> str:
    """When the tests of a folder's results ran, and the table of the requirements with what came of their tests."""
    files = result_files(folder)
    results = read_results(files)
    rows = []
    for each in read_requirements():
        places = dict.fromkeys(Path(test.place).name for test in markers() if test.requirement == each.name)
        names = ", ".join(f"`{name}`" for name in places)
        rows.append((each.name, each.text, each.risk, names, in_words(counts(each.name, results))))
    times = [path.stat().st_mtime for path in files]
    run = f"{datetime.fromtimestamp(max(times), UTC):%Y-%m-%d %H:%M} UTC, camssf {__version__}" if times else NOT_RUN
    return f"Last run: {run}.\n\n{markdown_table(HEAD, rows)}"


def main(argv: Sequence[str] | None = None) -> int:
    """Check the trace; returns 1 if there are faults."""
    command = argparse.ArgumentParser(prog=COMMAND, description=(__doc__ or "").partition("\n")[0])
    command.add_argument("--results", type=Path, nargs="*", default=[], help="JUnit XML, folders with TEST-*.xml")
    paths = command.parse_args(argv).results
    results = read_results(paths) if paths else None
    wrong = faults(results)
    for fault in wrong:
        print(fault, file=sys.stderr)
    requirements = read_requirements()
    cases = ""
    if results is not None:
        cases = f", {in_words(sum((counts(each.name, results) for each in requirements), Counter[str]()))}"
    marked = len({(test.place, test.test) for test in markers()})
    print(f"trace: {len(requirements)} requirements, {marked} markers{cases}, {len(wrong)} faults")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
