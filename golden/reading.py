"""Reads golden cases and checks every key strictly."""

from __future__ import annotations

import json
from collections.abc import Collection
from pathlib import Path
from typing import Any

from camssf import errors
from golden.compare import METRICS
from golden.contract import words
from golden.forms import ROOT, GoldenError, Json, digest, need
from golden.stages import STAGES

FORMAT = 1
FIELDS = words("format case stage comment expect requires source inputs outputs oracle truth limits")
CAPABILITIES = (
    "mosaic",
    "pose",
    "patches",
    "signals",
    "reference",
    "model",
    "verdict",
    "metadata",
    "colour",
    "finder",
)
"""Capabilities of a runner; format.md explains each."""
ORACLE = words("solver polished x objective gap ssf")
FRAME, MORE = words("mean standard_error clipped"), words("count dead greens")
"""Statistics of a frame, and more of them for the verdict."""


def codes() -> set[str]:
    """All error codes of `camssf.errors`."""
    kinds = [kind for kind in vars(errors).values() if isinstance(kind, type)]
    return {kind.code for kind in kinds if issubclass(kind, errors.CalibrationError)} - {errors.CalibrationError.code}


def check(case: Json) -> Json:
    """Return the case if it follows format 1.

    Raises:
        GoldenError: an unknown or missing key, or a value that is not allowed.
    """
    _keys("the case", case, FIELDS)
    name, stage = case["case"], case["stage"]
    need(case["format"] == FORMAT, f"{name}: format {case['format']!r} is not {FORMAT}")
    need(stage in STAGES, f"{name}: there is no stage {stage!r}")
    need(isinstance(name, str) and name.startswith(f"{stage}/"), f"{name}: does not belong to the stage {stage}")
    need(isinstance(case["comment"], str) and bool(case["comment"]), f"{name}: has no comment")
    need(case["expect"] == "success" or case["expect"] in codes(), f"{name}: expects {case['expect']!r}")
    need(set(case["requires"]) <= set(CAPABILITIES), f"{name}: requires {case['requires']}")
    _keys(f"{name}: source", case["source"], words("generator basis basis_sha256 spectra"))
    _keys(f"{name}: inputs", case["inputs"], STAGES[stage].inputs, STAGES[stage].optional)
    for shot in case["inputs"].get("shots", []):
        _keys(f"{name}: shot", shot, words("chart white dark black saturation"))
        for frame in ("chart", "white", "dark"):
            if shot[frame] is not None:
                _keys(f"{name}: {frame}", shot[frame], FRAME | MORE if stage == "verdict" else FRAME)
    if case["expect"] != "success":
        empty = case["outputs"] is None and case["oracle"] is None and case["truth"] is None and not case["limits"]
        need(empty, f"{name}: an error has no outputs, oracle, truth or limits")
        return case
    _keys(f"{name}: outputs", case["outputs"], STAGES[stage].stored_outputs() or case["outputs"])
    if case["oracle"] is not None:
        _keys(f"{name}: oracle", case["oracle"], ORACLE)
    if case["truth"] is not None:
        _keys(f"{name}: truth", case["truth"], words("ssf measured"))
    need(bool(case["limits"]), f"{name}: has no limits")
    for limit in case["limits"]:
        _keys(f"{name}: limit", limit, words("value against metric bound requires"))
        _keys(f"{name}: bound", limit["bound"], words("float64"))
        need(limit["against"] in ("outputs", "oracle", "truth"), f"{name}: compares against {limit['against']!r}")
        need(limit["metric"] in METRICS, f"{name}: there is no metric {limit['metric']!r}")
        need(set(limit["requires"]) <= set(CAPABILITIES), f"{name}: limit requires {limit['requires']}")
        known = case[limit["against"]]
        need(known is not None and known.get(limit["value"]) is not None, f"{name}: nothing to hold {limit} against")
        need(not (limit["against"] == "oracle" and limit["value"] == "x"), f"{name}: codes are never compared")
    return case


def read_case(path: Path) -> Json:
    """Read and check one case."""
    try:
        case: Json = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise GoldenError(f"{path.name}: not readable as JSON ({error})") from error
    check(case)
    need(case["case"] == f"{path.parent.name}/{path.stem}", f"{path.name}: calls itself {case['case']}")
    return case


def paths() -> list[Path]:
    """All case files, in order."""
    return sorted((ROOT / "cases").glob("*/*.json"))


def generator_digest() -> str:
    """SHA-256 of the sources that write the cases."""
    sources = [(path.relative_to(ROOT).as_posix(), path.read_bytes()) for path in sorted(ROOT.rglob("*.py"))]
    return digest(b"".join(name.encode() + b"\0" + text.replace(b"\r\n", b"\n") for name, text in sources))


def _keys(where: str, found: Any, needed: Collection[str], optional: Collection[str] = ()) -> None:
    need(isinstance(found, dict), f"{where} is no object")
    unknown, missing = set(found) - set(needed) - set(optional), set(needed) - set(found)
    need(not unknown and not missing, f"{where}: unknown {sorted(unknown)}, missing {sorted(missing)}")
