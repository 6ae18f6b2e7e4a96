"""Requirements, risks, tests and their results: `python -m tools.trace [--results DIR]` checks that none is missing.

Requirements are in tools/requirements.json. A test names those that it verifies: in Python by
`@pytest.mark.requirement("R-...")` or a file's `pytestmark`, in Kotlin by `@Tag("R-...")` on a class or a function.
Results are read from JUnit XML by pytest and Surefire. The command exits with 1 if a requirement has no test, a
marker names an unknown requirement, a row of the table in docs/claims.md belongs to no requirement, or, with
results, if a requirement's test failed or none ran. The site shows the table, with the results in out/results.
"""

from __future__ import annotations

import argparse
import ast
import json
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
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
        claim: beginning of the row in the table of docs/claims.md, without markup; None if it has no row.
    """

    name: str
    text: str
    risk: str
    claim: str | None = None


@dataclass(frozen=True)
class Marked:
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

    def __str__(self) -> str:
        """The test as the page shows it."""
        name = Path(self.place).name
        return f"`{name}`" if self.test is None else f"`{name}`: {self.test}"


@dataclass(frozen=True)
class Counts:
    """Numbers of test cases by their result."""

    passed: int = 0
    failed: int = 0
    skipped: int = 0

    def __add__(self, other: Counts) -> Counts:
        """The sum of both."""
        return Counts(self.passed + other.passed, self.failed + other.failed, self.skipped + other.skipped)

    def __str__(self) -> str:
        """The numbers that are not zero, in words."""
        said = [(self.passed, "passed"), (self.failed, "**failed**"), (self.skipped, "skipped")]
        return ", ".join(f"{count} {word}" for count, word in said if count) or NOT_RUN


Results = Mapping[tuple[str, str], Counts]
"""Results by group and test, without parameters."""


def read_requirements(path: Path = REQUIREMENTS) -> list[Requirement]:
    """All requirements, in the file's order."""
    found = [Requirement(**each) for each in json.loads(path.read_text("utf-8"))]
    names = [each.name for each in found]
    if len(set(names)) < len(names):
        raise ValueError(f"{path.name} names a requirement twice")
    return found


def _named(node: ast.expr) -> list[str]:
    """The requirements in `pytest.mark.requirement(...)`, or in a list of such calls."""
    if isinstance(node, ast.List | ast.Tuple):
        return [name for elt in node.elts for name in _named(elt)]
    if not (isinstance(node, ast.Call) and ast.unparse(node.func) == "pytest.mark.requirement"):
        return []
    return [str(ast.literal_eval(argument)) for argument in node.args]


def python_markers(text: str, place: str) -> Iterator[Marked]:
    """The markers in one Python test file."""
    group = place.removesuffix(".py").replace("/", ".")
    for node in ast.parse(text).body:
        if isinstance(node, ast.Assign) and [ast.unparse(target) for target in node.targets] == ["pytestmark"]:
            yield from (Marked(name, place, group, None) for name in _named(node.value))
        if isinstance(node, ast.FunctionDef):
            for decorator in node.decorator_list:
                yield from (Marked(name, place, group, node.name) for name in _named(decorator))


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
def markers(root: Path = ROOT) -> tuple[Marked, ...]:
    """The markers of all tests in both languages."""
    python = sorted((root / "tests").glob("**/test_*.py"))
    kotlin = sorted((root / "android-bindings").glob("*/src/test/kotlin/**/*.kt"))
    found = [marker for path in python for marker in python_markers(path.read_text("utf-8"), _place(path, root))]
    found += [marker for path in kotlin for marker in kotlin_markers(path.read_text("utf-8"), _place(path, root))]
    return tuple(found)


def _place(path: Path, root: Path) -> str:
    return path.relative_to(root).as_posix()


def _inside(folder: Path) -> list[Path]:
    """Surefire's files anywhere below the folder, and pytest's files in it, one a run."""
    return sorted({*folder.glob("**/TEST-*.xml"), *folder.glob("pytest*.xml")})


def read_results(paths: Sequence[Path]) -> Results:
    """The results in JUnit XML files; for a folder, in all TEST-*.xml below it and its pytest*.xml."""
    files = [file for path in paths for file in (_inside(path) if path.is_dir() else [path])]
    found: dict[tuple[str, str], Counts] = {}
    for file in files:
        for case in ElementTree.parse(file).iter("testcase"):
            said = {child.tag for child in case}
            one = Counts(
                passed=not said & {"failure", "error", "skipped"},
                failed=bool(said & {"failure", "error"}),
                skipped="skipped" in said,
            )
            group = case.get("classname", "")
            key = (group, _bare(case.get("name", "")))
            found[key] = found.get(key, Counts()) + one
    return found


def _bare(name: str) -> str:
    """The name up to the first bracket, without parameters and suffixes of test runners."""
    return re.split(r"[\[({]", name, maxsplit=1)[0]


def counts(tests: Sequence[Marked], results: Results) -> Counts:
    """The results of one requirement's tests; a test with two markers counts once."""
    keys = {
        (group, test)
        for group, test in results
        if any(group == each.group and (each.test is None or _bare(each.test) == test) for each in tests)
    }
    return sum((results[key] for key in keys), Counts())


def claims(page: str) -> list[str]:
    """The first cells of the page's table of claims, without markup."""
    table = page.partition(CLAIMS)[2].partition("\n## ")[0]
    cells = [row.split(" | ")[0].removeprefix("| ") for row in table.splitlines() if row.startswith("| ")]
    return [re.sub(r"\*\*|`", "", cell) for cell in cells if cell != "claim"]


def faults(requirements: Sequence[Requirement], tests: Sequence[Marked], said: Sequence[str]) -> list[str]:
    """What is missing or wrong in the trace, each with what to do."""
    known, shown = {requirement.name for requirement in requirements}, {test.requirement for test in tests}
    found = [
        f"{name} has no test. Mark one: pytest.mark.requirement({name!r}) or @Tag({json.dumps(name)})."
        for name in sorted(known - shown)
    ]
    found += [
        f"{test.place} names {test.requirement}, which tools/requirements.json does not know."
        for test in tests
        if test.requirement not in known
    ]
    claimed = {requirement.name: requirement.claim for requirement in requirements if requirement.claim is not None}
    for row in said:
        owners = [name for name, claim in claimed.items() if row.startswith(claim)]
        if len(owners) != 1:
            who = " and ".join(owners) or "no requirement"
            found.append(f"The claim {row[:60]!r} is of {who}: one in tools/requirements.json must claim it.")
    found += [
        f"{name} claims {claim!r}, and no row of docs/claims.md begins so."
        for name, claim in claimed.items()
        if not any(row.startswith(claim) for row in said)
    ]
    return found


def described(requirements: Sequence[Requirement], tests: Sequence[Marked]) -> list[tuple[str, str, str, str]]:
    """Name, text, risk and files with tests of each requirement."""
    rows = []
    for requirement in requirements:
        files = dict.fromkeys(Path(test.place).name for test in tests if test.requirement == requirement.name)
        rows.append((requirement.name, requirement.text, requirement.risk, ", ".join(f"`{name}`" for name in files)))
    return rows


def table(results: Path = RESULTS) -> str:
    """When the tests of a folder's results ran, and the table of the requirements with what came of their tests."""
    files = _inside(results)
    found, tests = read_results(files), markers()
    rows = [
        (*row, str(counts([test for test in tests if test.requirement == row[0]], found)))
        for row in described(read_requirements(), tests)
    ]
    when = datetime.fromtimestamp(max(path.stat().st_mtime for path in files), UTC) if files else None
    run = f"{when:%Y-%m-%d %H:%M} UTC, camssf {__version__}" if when else NOT_RUN
    return f"Last run: {run}.\n\n{markdown_table(HEAD, rows)}"


def main(argv: Sequence[str] | None = None) -> int:
    """Check the trace; returns 1 if there are faults."""
    command = argparse.ArgumentParser(prog=COMMAND, description=(__doc__ or "").partition("\n")[0])
    command.add_argument("--results", type=Path, nargs="*", default=[], help="JUnit XML, folders with TEST-*.xml")
    options = command.parse_args(argv)
    requirements, tests = read_requirements(), markers()
    wrong = faults(requirements, tests, claims(CLAIMS_PAGE.read_text("utf-8")))
    total = Counts()
    if options.results:
        results = read_results(options.results)
        found = {
            requirement.name: counts([test for test in tests if test.requirement == requirement.name], results)
            for requirement in requirements
        }
        wrong += [f"{name}: {each}." for name, each in found.items() if each.failed or not each.passed]
        total = sum(found.values(), Counts())
    for each in wrong:
        print(each, file=sys.stderr)
    marked = len({(each.place, each.test) for each in tests})
    cases = f", {total}" if options.results else ""
    print(f"trace: {len(requirements)} requirements, {marked} markers{cases}, {len(wrong)} faults")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
