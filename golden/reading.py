"""Reads golden cases and checks their form."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from camssf.errors import BY_CODE
from golden.compare import METRICS
from golden.contract import words
from golden.forms import ROOT, GoldenError, Json, digest, need
from golden.stages import STAGES

FORMAT = 1
FIELDS = words("format case stage comment expect requires basis_sha256 inputs outputs oracle truth limits")
CAPABILITIES = words("mosaic pose patches signals reference model verdict metadata colour finder")
"""Capabilities of a runner; format.md explains each."""


def check(case: Json) -> Json:
    """Return the case if it follows format 1.

    Raises:
        GoldenError: an unknown or missing key, or a value that is not allowed.
    """
    name, stage = case.get("case", ""), STAGES.get(case.get("stage", ""))
    if stage is None:
        raise GoldenError(f"{name}: there is no such stage")
    check_keys(name, case, FIELDS)
    need(case["format"] == FORMAT, f"{name}: format {case['format']!r} is not {FORMAT}")
    need(name.startswith(f"{stage.name}/"), f"{name}: does not belong to the stage {stage.name}")
    need(set(case["requires"]) <= set(CAPABILITIES), f"{name}: requires {case['requires']}")
    check_keys(f"{name}: inputs", case["inputs"], stage.inputs, stage.optional)
    if case["expect"] != "success":
        need(case["expect"] in BY_CODE, f"{name}: expects {case['expect']!r}")
        empty = case["outputs"] is None and case["oracle"] is None and case["truth"] is None and not case["limits"]
        need(empty, f"{name}: an error has no outputs, oracle, truth or limits")
        return case
    check_keys(f"{name}: outputs", case["outputs"], frozenset(stage.stored_outputs() or case["outputs"]))
    need(bool(case["limits"]), f"{name}: has no limits")
    for limit in case["limits"]:
        check_keys(f"{name}: limit", limit, words("value against metric bound requires"))
        need(limit["metric"] in METRICS, f"{name}: there is no metric {limit['metric']!r}")
        known = case[limit["against"]].get(limit["value"])
        need(known is not None, f"{name}: nothing to hold {limit} against")
    return case


def read_case(path: Path) -> Json:
    """Read and check one case."""
    case: Json = json.loads(path.read_text(encoding="utf-8"))
    need(case["case"] == f"{path.parent.name}/{path.stem}", f"{path.name}: calls itself {case['case']}")
    return check(case)


def paths() -> list[Path]:
    """All case files, in order."""
    return sorted((ROOT / "cases").glob("*/*.json"))


def generator_digest() -> str:
    """SHA-256 of the sources that write the cases."""
    sources = [(path.relative_to(ROOT).as_posix(), path.read_bytes()) for path in sorted(ROOT.rglob("*.py"))]
    return digest(b"".join(name.encode() + b"\0" + text.replace(b"\r\n", b"\n") for name, text in sources))


def check_keys(where: str, found: Any, needed: frozenset[str], optional: frozenset[str] = frozenset()) -> None:
    """Raise GoldenError for an unknown or a missing key."""
    unknown, missing = found.keys() - needed - optional, needed - found.keys()
    need(not unknown and not missing, f"{where}: unknown {sorted(unknown)}, missing {sorted(missing)}")
