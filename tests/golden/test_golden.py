"""The golden vectors: strict in form, complete, true of the reference, and able to fail."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

from camssf.grid import WAVELENGTHS
from camssf.recovery.onnx_model import SHIPPED, load_model
from camssf.spectra import read_chart, read_lamp
from camssf_lab.learning.training import read_curves
from golden import compare, forms, generate, reading
from golden.forms import ROOT, GoldenError
from golden.reading import paths, read_case
from golden.running import Finding, findings, judge, run
from golden.stages import STAGES
from tests.support.problems import CURVES

Json = dict[str, Any]
CASES = {f"{path.parent.name}/{path.stem}": read_case(path) for path in paths()}
SOLVED = [name for name, case in CASES.items() if case["oracle"]]
MANIFEST = json.loads((ROOT / "manifest.json").read_text(encoding="utf-8"))


# -- form ---------------------------------------------------------------------------------------------------------


@pytest.mark.repository
def test_the_manifest_names_every_file() -> None:
    assert MANIFEST["format"] == 1
    assert len(CASES) >= 300
    found = {name: forms.digest((ROOT / "cases" / f"{name}.json").read_bytes()) for name in CASES}
    assert found == MANIFEST["cases"]
    tables = {f"spectra/{p.name}": forms.digest(p.read_bytes()) for p in (ROOT / "spectra").glob("*.json")}
    assert tables == MANIFEST["spectra"]
    photos = {p.name: forms.digest(p.read_bytes()) for p in (ROOT / "dng").iterdir()}
    assert photos == {name.removeprefix("dng/"): value for name, value in MANIFEST["dng"].items()}
    roles = {"mosaic": ("dng",), "pose": ("dng",), "patches": ("photo", "white", "dark"), "finder": ("dng",)}
    used = {case["inputs"].get(role) for case in CASES.values() for role in roles.get(case["stage"], ())}
    assert used - {None} == set(photos)
    truths = [case["truth"]["ssf"] for case in CASES.values() if case["truth"]]
    assert {form["camera"] for form in truths if "camera" in form} == set(forms.spectra("cameras")["values"])


@pytest.mark.repository
def test_the_files_were_made_by_these_sources() -> None:
    assert MANIFEST["generator"] == reading.generator_digest(), f"run `{generate.COMMAND}`"


def test_spectra_are_those_of_the_package() -> None:
    """Six decimals are stored, because the rounded numbers are the inputs; each file says where they come from."""
    known = {name: forms.spectra(name) for name in ("charts", "lamps", "modes", "cameras")}
    assert {table["licence"] for table in known.values() if table["origin"]} == {"BSD-3-Clause", "Apache-2.0"}
    tables = {"babelcolor": "classic24", "ohta": "classic24:ohta"}
    pairs = [(values, read_chart(tables[name]).values) for name, values in known["charts"]["values"].items()]
    pairs += [(values, read_lamp(name).values) for name, values in known["lamps"]["values"].items()]
    pairs += [
        (np.abs(values), abs(read_lamp(name).modes[:, ::10])) for name, values in known["modes"]["values"].items()
    ]
    pairs += [(values, read_curves(CURVES)[name]) for name, values in known["cameras"]["values"].items()]
    assert max(np.abs(np.array(stored) - values).max() for stored, values in pairs) <= 0.51e-6


def test_cases_belong_to_the_shipped_bases() -> None:
    stated = {name: load_model(name).metadata["basis_sha256"] for name in SHIPPED}
    seen = set()
    for name, case in CASES.items():
        basis = case["inputs"].get("basis")
        if basis in SHIPPED:
            seen.add(basis)
            assert case["basis_sha256"] == stated[basis], f"{name}: run `{generate.COMMAND}`"
    assert seen == set(SHIPPED)


# -- truth --------------------------------------------------------------------------------------------------------


@cache
def outputs_of(name: str, engine: str) -> Json:
    """What an engine gives for a case: solved once for all tests."""
    return run(CASES[name], engine)


def failures(names: list[str], engine: str = "reference") -> dict[str, list[Finding]]:
    """Limits that an engine does not keep, by the case's name."""
    failed = {}
    for name in names:
        case = CASES[name]
        success = case["expect"] == "success"
        found = judge(case, outputs_of(name, engine)) if success else findings(case, engine)
        if not found or [each for each in found if not each.holds or each.skipped not in ("", "needs metadata")]:
            failed[name] = found
    return failed


SLOW = ("calibrate", "choice", "colour", "light", "picture", "rivals", "spectrum")
"""Stages whose cases take a minute together: `python -m golden.generate --check`, which .ci/run runs, has them."""


@pytest.mark.parametrize("stage", sorted({case["stage"] for case in CASES.values()} - {*SLOW}))
def test_the_reference_keeps_every_limit(stage: str) -> None:
    assert not failures([name for name, case in CASES.items() if case["stage"] == stage])


def test_the_stored_solutions_prove_themselves() -> None:
    """Objective and gap, recomputed from the code without cvxpy; rounding adds to the gap's bound where it must."""
    bounds = {}
    for name in SOLVED:
        proofs = generate.proofs(CASES[name])
        for proof, stated in zip(proofs, CASES[name]["oracle"]["objective"], strict=True):
            assert proof.gap <= proof.bound, name
            assert proof.objective == pytest.approx(stated, rel=1e-10, abs=1e-300), name
        bounds[name] = max(proof.bound for proof in proofs)
    hard = {name for name, bound in bounds.items() if bound > 2 * generate.ORACLE_GAP}
    assert hard == {"ssf/gaussian-identical-patches", "ssf/cameras-l1-tiny"}
    assert max(bounds.values()) < 1e-8


# -- able to fail -------------------------------------------------------------------------------------------------


def test_drift_is_found_and_rounding_is_not() -> None:
    stored = CASES["ssf/cameras-nikon"]
    made = copy.deepcopy(stored)
    made["outputs"]["ssf"][300][1] *= 1 + 1e-14
    made["oracle"]["objective"][0] *= 1 + 1e-12
    assert generate.drift(stored, made) == []
    made["outputs"]["ssf"][300][1] *= 1 + 1e-6
    assert len(generate.drift(stored, made)) == 1
    for key, value in (("comment", "another"), ("inputs", {}), ("limits", [])):
        assert generate.drift(stored, stored | {key: value}) == [f"{key} differs"]


def test_what_a_row_expects_is_checked() -> None:
    scene = next(STAGES["verdict"].scenes())
    assert scene["outputs"] == {"status": "accepted", "codes": []}
    with pytest.raises(GoldenError, match=r"expected .*glare.*, computed .*\[\]"):
        generate.finish(scene | {"outputs": {"codes": ["glare"]}})
    with pytest.raises(GoldenError, match=r"inputs: unknown \['unamed'\]"):
        generate.finish(scene | {"inputs": scene["inputs"] | {"unamed": True}})


# -- metrics ------------------------------------------------------------------------------------------------------


CURVES_OF_PEAK = np.outer(np.linspace(0.5, 1.0, 681), np.ones(3))
BENT = np.where(((WAVELENGTHS >= 400.0) & (WAVELENGTHS < 430.0))[:, None], 0.0, np.ones((681, 3)))
BY_HAND: list[tuple[Callable[[Any, Any], float], Any, Any, float]] = [
    (compare.exact, [1, 2], [1, 2], 0.0),
    (compare.exact, [1, 2], [1, 3], np.inf),
    (compare.norm, [1.0, 10.0], [1.0, 10.5], 0.5 / 10.5),
    (compare.norm, [np.nan], [1.0], np.inf),
    (compare.norm, [1.0], [1.0, 1.0], np.inf),
    (compare.relative, [1.1, 10.0], [1.0, 10.0], 0.1),
    (compare.difference, [3, 5], [3, 7], 2.0),
    (compare.at_most, [1e-9, 3e-9], None, 3e-9),
    (compare.at_most, [np.nan], None, np.inf),
    (compare.peak, 4.0 * CURVES_OF_PEAK, CURVES_OF_PEAK[::10], 0.0),
    (compare.peak, CURVES_OF_PEAK, CURVES_OF_PEAK[::10] - 0.01, 0.01),
    (compare.peak, -CURVES_OF_PEAK, CURVES_OF_PEAK[::10], np.inf),
    (compare.rmse, BENT, np.ones((681, 3)), np.sqrt(60 / 601)),  # from 400 to 700 nm
]


def test_metrics_by_hand() -> None:
    for metric, found, expected, known in BY_HAND:
        assert metric(found, expected) == pytest.approx(known), (metric.__name__, found, expected)


def test_optimality_by_hand() -> None:
    """½ (x - 2)² + |x| has its optimum at 1 with objective 1.5; at x = 2 the dual bound is 0."""
    one = np.ones((1, 1))
    assert compare.optimality(one, np.array([2.0]), one, np.array([1.0]), 0.0, 1.0, False) == (1.5, 0.0)
    objective, gap = compare.optimality(one, np.array([2.0]), one, np.array([2.0]), 0.0, 1.0, False)
    assert (objective, gap) == (2.0, 1.0)
    assert compare.optimality(one, np.array([2.0]), one, np.array([-1.0]), 0.0, 1.0, True)[1] == np.inf
    # γ = 0: ½ ‖w‖² / λ₂ with w = b - x - λ₂ x = 2 at x = 0
    assert compare.optimality(one, np.array([2.0]), one, np.array([0.0]), 4.0, 0.0, False) == (2.0, 0.25)
