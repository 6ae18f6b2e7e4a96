"""The trace, the SOUP sheet, the SBOM and the pages about claims: whole, and in step with the code."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from packaging.utils import canonicalize_name

from camssf.files import write_file
from tools import closure, sbom, soup, trace
from tools.trace import Counts, Marked, Requirement

ROOT = Path(__file__).parents[1]
CLAIMS = (ROOT / "docs" / "claims.md").read_text("utf-8")
DOCS = ROOT / "docs"


# -- the trace ----------------------------------------------------------------------------------------------------


@pytest.mark.requirement("R-TRACE")
def test_every_requirement_has_a_test_and_every_claim_is_one(capsys: pytest.CaptureFixture[str]) -> None:
    """And the page says what the markers say."""
    assert trace.main(["--check"]) == 0, capsys.readouterr().err
    assert len(trace.claims(CLAIMS)) > 20


MARKED = """
import pytest
pytestmark = [pytest.mark.full, pytest.mark.requirement("R-FILE")]
# @pytest.mark.requirement("R-COMMENT")
@pytest.mark.full
@pytest.mark.requirement("R-ONE", "R-TWO")
def test_a(): pass
def test_b(): pass
"""
TAGGED = """package org.camssf.toy

/** Mentions nothing. */
@Tag("R-CLASS")
class ToyTest {
    @Test
    @Tag("R-WORDS")
    fun `in words, with (brackets)`() {
    }

    @Test
    fun plain() {
    }
}

@Tag("R-OTHER") internal class OtherTest
"""


def test_markers_are_read() -> None:
    assert set(trace.python_markers(MARKED, "tests/test_toy.py")) == {
        Marked("R-FILE", "tests/test_toy.py", "test_toy", None),
        Marked("R-ONE", "tests/test_toy.py", "test_toy", "test_a"),
        Marked("R-TWO", "tests/test_toy.py", "test_toy", "test_a"),
    }
    assert set(trace.kotlin_markers(TAGGED, "T.kt")) == {
        Marked("R-CLASS", "T.kt", "org.camssf.toy.ToyTest", None),
        Marked("R-WORDS", "T.kt", "org.camssf.toy.ToyTest", "in words, with (brackets)"),
        Marked("R-OTHER", "T.kt", "org.camssf.toy.OtherTest", None),
    }


XML = """<testsuites><testsuite>
<testcase classname="tests.test_toy" name="test_a[1-x]"/><testcase classname="tests.test_toy" name="test_a[2]"/>
<testcase classname="tests.test_toy" name="test_b"><failure message="no">x</failure></testcase>
<testcase classname="tests.test_toy" name="test_c"><skipped/></testcase>
<testcase classname="tests.test_toy2" name="test_a"><error/></testcase>
</testsuite></testsuites>"""
SUREFIRE = """<testsuite><testcase name="in words, with (brackets)" classname="org.camssf.toy.ToyTest"/>
<testcase name="plain()[2]" classname="org.camssf.toy.ToyTest"/></testsuite>"""


def test_results_are_counted(tmp_path: Path) -> None:
    (tmp_path / "deep").mkdir()
    write_file(tmp_path / "pytest.xml", XML)
    write_file(tmp_path / "deep" / "TEST-toy.xml", SUREFIRE)
    found = trace.read_results([tmp_path / "pytest.xml", tmp_path / "deep"])
    assert found == trace.read_results([tmp_path])
    python = list(trace.python_markers(MARKED, "tests/test_toy.py"))
    kotlin = list(trace.kotlin_markers(TAGGED, "T.kt"))

    def of(name: str) -> Counts:
        return trace.counts([each for each in [*python, *kotlin] if each.requirement == name], found)

    assert of("R-ONE") == Counts(passed=2)
    assert of("R-FILE") == Counts(passed=2, failed=1, skipped=1)
    assert of("R-WORDS") == Counts(passed=1)
    assert of("R-CLASS") == Counts(passed=2)
    assert str(of("R-OTHER")) == "not run"
    assert str(of("R-FILE")) == "2 passed, 1 **failed**, 1 skipped"


@pytest.mark.requirement("R-TRACE")
@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("no test", "R-B has no test"),
        ("unknown", "names R-Z, which"),
        ("unclaimed", "The claim 'It flies' is of no requirement"),
        ("twice", "is of R-A and R-B"),
        ("stale", "R-A claims 'It swims', and no row"),
    ],
)
def test_a_gap_is_seen(change: str, words: str) -> None:
    known = [Requirement("R-A", "x", "y", "It runs"), Requirement("R-B", "x", "y")]
    tests = [Marked("R-A", "tests/test_t.py", "test_t", None), Marked("R-B", "tests/test_t.py", "test_t", "test_u")]
    said = ["It runs fast"]
    assert trace.faults(known, tests, said) == []
    if change == "no test":
        tests.pop()
    elif change == "unknown":
        tests.append(Marked("R-Z", "tests/test_t.py", "test_t", "test_u"))
    elif change == "unclaimed":
        said.append("It flies")
    elif change == "twice":
        known[1] = Requirement("R-B", "x", "y", "It")
    else:
        known[0] = Requirement("R-A", "x", "y", "It swims")
    assert any(words in each for each in trace.faults(known, tests, said))


@pytest.mark.requirement("R-TRACE")
def test_a_run_that_failed_or_left_a_requirement_out_ends_with_1(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "trace.md"
    page.write_bytes(trace.PAGE.read_bytes())
    cases = []
    for each in trace.markers():
        group = each.group if "." in each.group else f"tests.{each.group}"
        cases.append(f'<testcase classname="{group}" name="{each.test or "test_any"}"/>')
    results = tmp_path / "all.xml"

    def ended(lines: list[str]) -> int:
        write_file(results, f"<testsuite>{''.join(lines)}</testsuite>")
        return trace.main(["--results", str(results), "--page", str(page)])

    assert ended(cases) == 0, capsys.readouterr().err
    assert "| 1 passed |" in page.read_text("utf-8")
    assert "0 faults" in capsys.readouterr().out
    spoilt = next(line for line in cases if "test_bands_cover" in line)
    assert ended([*(line for line in cases if line != spoilt), spoilt.replace("/>", "><failure/></testcase>")]) == 1
    assert "R-CAMERAS: 2 passed, 1 **failed**" in capsys.readouterr().err
    assert ended([line for line in cases if "test_layers" not in line]) == 1
    assert "R-LAYERS: not run" in capsys.readouterr().err


def test_the_page_keeps_its_results_when_only_the_tests_are_made_anew() -> None:
    page = f"a\n{trace.BEGIN}\n{trace.END}\nb"
    first = trace.written(page, [("R-A", "x", "y", "`t`")], "Last run: then.", {"R-A": "3 passed"})
    run, ended = trace.stored(first)
    assert (run, ended) == ("Last run: then.", {"R-A": "3 passed"})
    assert "| R-A | x | y | `u` | 3 passed |" in trace.written(first, [("R-A", "x", "y", "`u`")], run, ended)
    with pytest.raises(ValueError, match="no place"):
        trace.written("a", [], "", {})


def test_ci_checks_the_trace_with_its_own_results() -> None:
    text = (ROOT / ".ci" / "run").read_text("utf-8")
    (line,) = [line for line in text.splitlines() if line.startswith('run "trace"')]
    assert '--results "$log"/pytest*.xml android-bindings' in line
    assert 'PYTEST_ADDOPTS="-n 2 --junitxml=$log/pytest.xml"' in text
    assert 'PYTEST_ADDOPTS="-n 2 --junitxml=$log/pytest-full.xml"' in text


# -- what is not proven, and what may be claimed --------------------------------------------------------------------


@pytest.mark.requirement("R-UNPROVEN-CHART", "R-UNPROVEN-PHONES")
@pytest.mark.parametrize(("row", "anomaly"), [("Not proven: accuracy", "A-1"), ("Not proven: phones", "A-2")])
def test_what_is_unproven_is_said_everywhere(row: str, anomaly: str) -> None:
    assert any(claim.startswith(row) for claim in trace.claims(CLAIMS))
    assert re.search(rf"^\| {anomaly}: .*unproven", (DOCS / "anomalies.md").read_text("utf-8"), re.MULTILINE)
    assert anomaly in CLAIMS
    assert row.removeprefix("Not proven: ") in (ROOT / "README.md").read_text("utf-8")
    limits = (DOCS / "limits.md").read_text("utf-8")
    words = {"A-1": "on real captures is unproven", "A-2": "No chart photo from a phone was available"}
    assert words[anomaly] in limits


def test_every_unproven_claim_is_one_of_these() -> None:
    assert len([claim for claim in trace.claims(CLAIMS) if claim.startswith("Not proven")]) == 2


def test_anomalies_are_numbered_and_claims_name_requirements_that_are() -> None:
    numbers = re.findall(r"^\| A-(\d+):", (DOCS / "anomalies.md").read_text("utf-8"), re.MULTILINE)
    assert numbers == [str(at + 1) for at in range(len(numbers))]
    known = {each.name for each in trace.read_requirements()}
    told = set(re.findall(r"\bR-[A-Z-]+[A-Z]", CLAIMS))
    assert told
    assert told <= known


def test_the_missed_bars_of_the_pages_are_anomalies() -> None:
    """As the pages print them today; who mends one takes its row away."""
    anomalies = (DOCS / "anomalies.md").read_text("utf-8")
    solver = (DOCS / "solver.md").read_text("utf-8")
    for value, bar in re.findall(r"\| ([\d.]+) \| [\d.]+ \| ([\d.]+), missed \|", solver):
        assert re.search(rf"{value}\b.*bar {bar}", anomalies), (value, bar)
    colour = (DOCS / "colour.md").read_text("utf-8")
    missed = re.findall(r"chart in that light \| ([\d.]+) \| \*\*([\d.]+) / ([\d.]+)\*\*", colour)
    assert missed
    for bar, first, second in missed:
        assert re.search(rf"{first} and {second} \((?:aimed at )?{bar}\)", anomalies), (bar, first, second)
    (share,) = re.findall(r"severity 3 \(99 %\) is missed \(([\d.]+) %\)", (DOCS / "verdict.md").read_text("utf-8"))
    assert f"({share} %)" in anomalies


# -- SOUP and SBOM ------------------------------------------------------------------------------------------------


def pins() -> dict[str, str]:
    lines = (ROOT / "constraints.txt").read_text("utf-8").splitlines()
    pairs = [line.split("==") for line in lines if "==" in line and not line.startswith("#")]
    return {canonicalize_name(name): version for name, version in pairs}


@pytest.mark.requirement("R-SOUP")
def test_the_sheet_has_the_pinned_version_of_every_dependency() -> None:
    told = {name: version for name, (version, _) in soup.listed(soup.PAGE.read_text("utf-8"), "python").items()}
    pinned = pins()
    assert {name: pinned[name] for name in told} == told
    assert {each.name for each in closure.closure()} - {"colorama"} <= set(told)
    known = json.loads(soup.KNOWN.read_text("utf-8"))
    assert set(known["python"]) == set(told)


@pytest.mark.requirement("R-SOUP")
def test_kotlin_s_sheet_has_the_build_s_versions() -> None:
    told = {name: version for name, (version, _) in soup.listed(soup.PAGE.read_text("utf-8"), "kotlin").items()}
    pom = (ROOT / "android-bindings" / "pom.xml").read_text("utf-8")
    of = {name: re.findall(rf"<{re.escape(name)}>([^<]+)<", pom)[0] for name in (
        "kotlin.stdlib", "coroutines.version", "serialization.version", "onnxruntime.version",
    )}  # fmt: skip
    assert told["org.jetbrains.kotlin:kotlin-stdlib"] == of["kotlin.stdlib"]
    assert told["org.jetbrains.kotlinx:kotlinx-coroutines-core-jvm"] == of["coroutines.version"]
    assert told["org.jetbrains.kotlinx:kotlinx-serialization-json-jvm"] == of["serialization.version"]
    for name in ("onnxruntime", "onnxruntime-android"):
        assert told[f"com.microsoft.onnxruntime:{name}"] == of["onnxruntime.version"]


def test_no_licence_is_unstated_and_none_is_gpl() -> None:
    page = soup.PAGE.read_text("utf-8")
    licences = {
        name: licence for language in soup.MARKS for name, (_, licence) in soup.listed(page, language).items()
    }
    assert len(licences) > 40
    for name, licence in licences.items():
        own = licence.partition("; bundles ")[0]
        assert own != "not stated", name
        assert not re.search(r"(?<!L)GPL", own), name


def test_a_new_dependency_and_one_that_went_are_seen() -> None:
    found = {"a": ("1", "MIT"), "b": ("2", "MIT")}
    assert soup.faults(found, {"a": {}, "b": {}}) == []
    assert soup.faults(found, {"a": {}}) == ["b: add its purpose and known faults to tools/soup.json."]
    assert soup.faults(found, {"a": {}, "b": {}, "c": {}}) == ["c in tools/soup.json is no dependency."]


@pytest.mark.full
@pytest.mark.requirement("R-SOUP")
def test_the_sbom_is_cyclonedx_and_whole(tmp_path: Path) -> None:
    pytest.importorskip("cyclonedx", reason="cyclonedx is not installed (extra: dev)")
    from cyclonedx.schema import SchemaVersion
    from cyclonedx.validation.json import JsonStrictValidator

    out = tmp_path / "dist" / "sbom.json"
    assert sbom.main(["-o", str(out)]) == 0
    text = out.read_text("utf-8")
    assert JsonStrictValidator(SchemaVersion.V1_6).validate_str(text) is None
    found = json.loads(text)
    names = {each["name"] for each in found["components"]}
    assert {"numpy", "onnxruntime", "rawpy", "cryptography", "duckdb", "cffi"} <= names
    assert not names & {"pytest", "ruff", "torch", "cvxpy", "joserfc"}
    own = found["metadata"]["component"]["bom-ref"]
    tree = {each["ref"]: each["dependsOn"] for each in found["dependencies"]}
    reached, open_ = set(), [own]
    while open_:
        ref = open_.pop()
        if ref not in reached:
            reached.add(ref)
            open_ += tree[ref]
    assert reached == {own} | {each["bom-ref"] for each in found["components"]}
    sbom.main(["-o", str(out)])
    assert out.read_text("utf-8") == text


@pytest.mark.full
def test_a_broken_sbom_would_be_seen() -> None:
    pytest.importorskip("cyclonedx", reason="cyclonedx is not installed (extra: dev)")
    from cyclonedx.schema import SchemaVersion
    from cyclonedx.validation.json import JsonStrictValidator

    broken = sbom.document(closure.closure())
    broken["components"][0]["type"] = "nonsense"
    assert JsonStrictValidator(SchemaVersion.V1_6).validate_str(json.dumps(broken)) is not None
