"""The trace, the SOUP sheet, the SBOM and the pages about claims: whole, and in step with the code."""

import json
import re
from pathlib import Path

import pytest

from tests.support.pages import pins, text_of
from tools import sbom, soup, trace

CLAIMS = text_of("docs/claims.md")

pytestmark = pytest.mark.repository


@pytest.mark.requirement("R-TRACE")
def test_every_requirement_has_a_test_and_every_claim_is_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert trace.main([]) == 0, capsys.readouterr().err
    assert len(trace.claims(CLAIMS)) > 20


@pytest.mark.requirement("R-UNPROVEN-CHART", "R-UNPROVEN-PHONES")
@pytest.mark.parametrize(("row", "anomaly"), [("Not proven: accuracy", "A-1"), ("Not proven: phones", "A-2")])
def test_what_is_unproven_is_said_everywhere(row: str, anomaly: str) -> None:
    assert any(claim.startswith(row) for claim in trace.claims(CLAIMS))
    said = row.removeprefix("Not proven: ")
    assert re.search(rf"^\| {anomaly}: {said}.* unproven", text_of("docs/limits.md"), re.MULTILINE)
    assert anomaly in CLAIMS
    assert said in text_of("README.md")


def test_anomalies_are_numbered_and_claims_name_requirements_that_are() -> None:
    numbers = re.findall(r"^\| A-(\d+):", text_of("docs/limits.md"), re.MULTILINE)
    assert numbers == [str(at + 1) for at in range(len(numbers))]
    named = set(re.findall(r"\bR-[A-Z-]+[A-Z]", CLAIMS))
    assert named
    assert named <= set(trace.read_requirements())


@pytest.mark.requirement("R-SOUP")
def test_the_sheet_has_every_dependency_and_each_is_pinned() -> None:
    found = sbom.closure()
    assert soup.faults(found, soup.read_known()["python"]) == []
    assert set(found) <= set(pins())
    table = soup.table("python")
    assert [name for name in found if f"{name} " not in table] == []


@pytest.mark.parametrize(
    ("licence", "faults"),
    [("MIT OR Apache-2.0", 0), ("LGPL-2.1-or-later", 0), ("GPL-3.0-only", 1), ("not stated", 1)],
)
def test_no_licence_and_the_gpl_are_faults(licence: str, faults: int) -> None:
    assert len(soup.faults({"a": ("1", licence)}, {"a": {}})) == faults


@pytest.mark.full
@pytest.mark.requirement("R-SOUP")
def test_the_sbom_is_cyclonedx_and_whole(tmp_path: Path) -> None:
    pytest.importorskip("cyclonedx", reason="cyclonedx is not installed (extra: dev)")
    from cyclonedx.schema import SchemaVersion
    from cyclonedx.validation.json import JsonStrictValidator

    out = tmp_path / "dist" / "sbom.json"
    sbom.main(["-o", str(out)])
    text = out.read_text("utf-8")
    assert JsonStrictValidator(SchemaVersion.V1_6).validate_str(text) is None
    found = json.loads(text)
    names = {each["name"] for each in found["components"]}
    assert {"numpy", "onnxruntime", "rawpy", "cryptography", "joserfc", "duckdb", "cffi"} <= names
    assert not names & {"pytest", "ruff", "torch", "cvxpy", "jwcrypto"}
    sbom.main(["-o", str(out)])
    assert out.read_text("utf-8") == text
