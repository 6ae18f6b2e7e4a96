"""The trace, the SOUP sheet, the SBOM and the pages about claims: whole, and in step with the code."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from packaging.utils import canonicalize_name

from tools import closure, sbom, soup, trace

ROOT = Path(__file__).parents[2]
CLAIMS = (ROOT / "docs" / "claims.md").read_text("utf-8")
DOCS = ROOT / "docs"

pytestmark = pytest.mark.repository


# -- the trace ----------------------------------------------------------------------------------------------------


@pytest.mark.requirement("R-TRACE")
def test_every_requirement_has_a_test_and_every_claim_is_one(capsys: pytest.CaptureFixture[str]) -> None:
    """And the page says what the markers say."""
    assert trace.main(["--check"]) == 0, capsys.readouterr().err
    assert len(trace.claims(CLAIMS)) > 20


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


def test_anomalies_are_numbered_and_claims_name_requirements_that_are() -> None:
    numbers = re.findall(r"^\| A-(\d+):", (DOCS / "anomalies.md").read_text("utf-8"), re.MULTILINE)
    assert numbers == [str(at + 1) for at in range(len(numbers))]
    known = {requirement.name for requirement in trace.read_requirements()}
    named = set(re.findall(r"\bR-[A-Z-]+[A-Z]", CLAIMS))
    assert named
    assert named <= known


# -- SOUP and SBOM ------------------------------------------------------------------------------------------------


def pins() -> dict[str, str]:
    lines = (ROOT / "constraints.txt").read_text("utf-8").splitlines()
    pairs = [line.split("==") for line in lines if "==" in line and not line.startswith("#")]
    return {canonicalize_name(name): version for name, version in pairs}


@pytest.mark.requirement("R-SOUP")
def test_the_sheet_has_the_pinned_version_of_every_dependency() -> None:
    listed = {name: version for name, (version, _) in soup.listed(soup.PAGE.read_text("utf-8"), "python").items()}
    pinned = pins()
    assert {name: pinned[name] for name in listed} == listed
    assert {each.name for each in closure.closure()} - {"colorama"} <= set(listed)
    known = json.loads(soup.KNOWN.read_text("utf-8"))
    assert set(known["python"]) == set(listed)


@pytest.mark.requirement("R-SOUP")
def test_kotlin_s_sheet_has_the_build_s_versions() -> None:
    listed = {name: version for name, (version, _) in soup.listed(soup.PAGE.read_text("utf-8"), "kotlin").items()}
    pom = (ROOT / "android-bindings" / "pom.xml").read_text("utf-8")
    of = {name: re.findall(rf"<{re.escape(name)}>([^<]+)<", pom)[0] for name in (
        "kotlin.stdlib", "coroutines.version", "onnxruntime.version",
    )}  # fmt: skip
    assert listed["org.jetbrains.kotlin:kotlin-stdlib"] == of["kotlin.stdlib"]
    assert listed["org.jetbrains.kotlinx:kotlinx-coroutines-core-jvm"] == of["coroutines.version"]
    assert not [name for name in listed if "serialization" in name]
    for name in ("onnxruntime", "onnxruntime-android"):
        assert listed[f"com.microsoft.onnxruntime:{name}"] == of["onnxruntime.version"]


def test_no_licence_is_unstated_and_none_is_gpl() -> None:
    page = soup.PAGE.read_text("utf-8")
    licences = {
        name: licence for language in soup.LANGUAGES for name, (_, licence) in soup.listed(page, language).items()
    }
    assert len(licences) > 40
    for name, licence in licences.items():
        own = licence.partition("; bundles ")[0]
        assert own != "not stated", name
        assert not re.search(r"(?<!L)GPL", own), name


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
    assert {"numpy", "onnxruntime", "rawpy", "cryptography", "joserfc", "duckdb", "cffi"} <= names
    assert not names & {"pytest", "ruff", "torch", "cvxpy", "jwcrypto"}
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
