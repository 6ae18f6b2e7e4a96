"""The golden vectors: strict in form, complete, true of the reference, and able to fail."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np
import pytest

from camssf.grid import WAVELENGTHS
from camssf.recovery.basis import interpolate, read_basis
from camssf.recovery.onnx_model import SHIPPED, load_model
from camssf.recovery.rows import anchor
from camssf.spectra import read_chart, read_lamp
from camssf_lab.learning.training import read_curves
from golden import compare, forms, generate, reading
from golden.forms import ROOT, GoldenError, resolve
from golden.products import build_rows, raw_signals
from golden.reading import check, paths, read_case
from golden.running import Finding, findings, judge, run
from golden.scenes import scene
from golden.stages import STAGES
from tests.golden import views
from tests.support.problems import CURVES

Json = dict[str, Any]
CASES = {f"{path.parent.name}/{path.stem}": read_case(path) for path in paths()}
SOUND = [name for name, case in CASES.items() if case["expect"] == "success"]
SOLVED = [name for name in SOUND if CASES[name]["oracle"]]
MANIFEST = json.loads((ROOT / "manifest.json").read_text(encoding="utf-8"))


# -- form ---------------------------------------------------------------------------------------------------------


@pytest.mark.repository
def test_the_manifest_names_every_file() -> None:
    assert MANIFEST["format"] == 1
    assert MANIFEST["count"] == len(CASES) >= 60
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
        basis = case["source"]["basis"]
        if basis in SHIPPED:
            seen.add(basis)
            assert case["source"]["basis_sha256"] == stated[basis], f"{name}: run `{generate.COMMAND}`"
    assert seen == set(SHIPPED)


BREAKS: dict[str, Callable[[Json], object]] = {
    "unknown field": lambda c: c.update(extra=1),
    "missing field": lambda c: c.pop("comment"),
    "another format": lambda c: c.update(format=2),
    "another stage": lambda c: c.update(stage="choice"),
    "unknown error": lambda c: c.update(expect="sorry"),
    "unknown capability": lambda c: c["requires"].append("gpu"),
    "unknown input": lambda c: c["inputs"].update(seed=1),
    "missing input": lambda c: c["inputs"].pop("lamp"),
    "unknown output": lambda c: c["outputs"].update(time=1.0),
    "no limits": lambda c: c.update(limits=[]),
    "unknown metric": lambda c: c["limits"][0].update(metric="allclose"),
    "nothing to compare with": lambda c: c["limits"][0].update(value="phase"),
    "error with outputs": lambda c: c.update(expect="blurred"),
}


@pytest.mark.parametrize("name", BREAKS)
def test_the_format_is_strict(name: str) -> None:
    case = copy.deepcopy(CASES["ssf/cameras-nikon"])
    check(case)
    BREAKS[name](case)
    with pytest.raises(GoldenError):
        check(case)


@pytest.mark.parametrize("form", [{"random": 3}, {"chart": "babelcolor"}, {"lamps": ["D55"], "scale": 2.0}])
def test_unknown_input_forms_are_errors(form: Json) -> None:
    with pytest.raises(GoldenError):
        resolve(form)


# -- truth --------------------------------------------------------------------------------------------------------


def by_model(case: Json) -> bool:
    """Whether the shipped ONNX model can run the case; the other cases are single steps of the reference."""
    return "model" in case["requires"]


@cache
def outputs_of(name: str) -> Json:
    """What the reference gives for a case: solved once for all tests."""
    return run(CASES[name])


def failures(names: list[str]) -> dict[str, list[Finding]]:
    """Limits that the reference does not keep, by the case's name."""
    failed = {}
    for name in names:
        case = CASES[name]
        found = judge(case, outputs_of(name)) if case["expect"] == "success" else findings(case)
        if not found or [each for each in found if not each.holds or each.skipped not in ("", "needs metadata")]:
            failed[name] = found
    return failed


SLOW = ("calibrate", "choice", "colour", "light", "picture", "rivals", "spectrum")
"""Stages whose cases take seconds together: the full run has them."""


def stages_of(cases: Mapping[str, Json]) -> list[Any]:
    """The stages of cases as parameters."""
    names = sorted({case["stage"] for case in cases.values()})
    return [pytest.param(name, marks=pytest.mark.full if name in SLOW else ()) for name in names]


STEPS = {name: case for name, case in CASES.items() if not by_model(case)}
"""The cases that the ONNX model cannot run."""


@pytest.mark.parametrize("stage", stages_of(STEPS))
def test_the_reference_keeps_every_limit_of_its_steps(stage: str) -> None:
    assert not failures([name for name, case in STEPS.items() if case["stage"] == stage])


@pytest.mark.full
@pytest.mark.parametrize("stage", sorted({case["stage"] for case in CASES.values() if by_model(case)}))
def test_the_reference_keeps_every_limit_that_the_model_keeps(stage: str) -> None:
    """The default run has the model alone (test_onnx.py) on these."""
    assert not failures([name for name, case in CASES.items() if case["stage"] == stage and by_model(case)])


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


NONE = {"chart_tolerance": 0.0, "white_tolerance": 0.0}
BOTH = {"lamps": ["D55", "A"]}
ROWS: dict[str, Json] = {
    "chart": BOTH | {"white_tolerance": 0.0},
    "white": {"lamps": ["D55", "FL2"], "chart_tolerance": 0.0},
    "lamp": NONE | {"lamps": ["A", "LED-B3"], "lamp_tolerance": 0.02},
    "two-lamps": BOTH | {"lamp_tolerance": 0.02, "patches": list(range(7, 19))},
    "diagonal": NONE,
}


@pytest.mark.parametrize("name", ROWS)
def test_rows_and_covariance_by_their_integrals(name: str) -> None:
    """Against loops over docs/maths.md's formulas with the exact kernel exp(-½ (Δλ / ℓ)²): all channels' rows."""
    inputs = scene(name, "", {"patches": [15, 14, 13, 19], "noise": "usual"} | ROWS[name])["inputs"]
    g = {key: value if key == "basis" else resolve(value) for key, value in inputs.items()}
    g["signals"] = raw_signals(g)
    made = build_rows(g)
    basis, nodes = anchor(read_basis("cameras"), g["white_reflectance"] * g["lamp"][0]), WAVELENGTHS[::10]
    red = 1.0 + 1.6 / (1.0 + np.exp((650.0 - nodes) / 8.0))
    straight = interpolate(np.eye(69))  # (681, 69)
    kernel = {scale: np.exp(-0.5 * ((nodes[:, None] - nodes) / scale) ** 2) for scale in (25.0, 60.0, 100.0)}
    k, n, _ = g["signals"].shape
    N, r = 3 * k * n, basis.dictionary.shape[2]
    A, sigma, target, parts = np.zeros((N, 3 * r)), np.zeros((N, N)), np.zeros(N), []
    own_error = np.zeros(N)
    for row, (c, j, i) in enumerate(np.ndindex(3, k, n)):
        mu, L, R, y = basis.mean[c], g["lamp"][j], g["reflectance"][i], g["signals"][j, i, c]
        white_signal = 0.5 * np.sum(g["white_reflectance"] * L * mu)
        fold = R * L * 0.5 / white_signal
        fold_white = g["white_reflectance"] * L * 0.5 / white_signal
        A[row, r * c : r * (c + 1)] = (fold - y * fold_white) @ basis.dictionary[c]
        target[row] = -(fold - y * fold_white) @ mu
        expected, tau = fold @ mu, g["chart_tolerance"][i]
        parts.append(
            (
                c, i, j, expected,
                tau * 0.6 * (fold @ straight) * mu[::10] * red,
                tau / 3 * (L * 0.5 / white_signal @ straight) * mu[::10] * red,
                tau * 70 * (np.gradient(R, 0.5) * L * 0.5 / white_signal @ straight) * mu[::10] * red,
                g["white_tolerance"] * expected * (fold_white @ straight) * mu[::10],
                g["lamp_tolerance"][j] * ((fold - expected * fold_white) @ straight) * mu[::10],
            )
        )  # fmt: skip
        noise = max(g["standard_error"][j, i, c] ** 2, 1e-8)
        sigma[row, row] = noise
        own_error[row] = max(g["standard_error"][j, i, c] ** 2 + (tau * y / 20) ** 2, 1e-8) - noise
    of_charts, patch = np.diag(own_error), np.array([part[1] for part in parts])
    for p, (c, i, j, expected, chart, floor, edge, white, lamp) in enumerate(parts):
        for q, (c2, i2, j2, expected2, chart2, floor2, edge2, white2, lamp2) in enumerate(parts):
            of_chart = chart @ kernel[100.0] @ chart2 + floor @ kernel[25.0] @ floor2 + edge @ kernel[25.0] @ edge2
            of_charts[p, q] += (i == i2) * (1.0 if c == c2 else 0.7) * of_chart
            sigma[p, q] += white @ kernel[100.0] @ white2
            sigma[p, q] += (j == j2) * (lamp @ kernel[60.0] @ lamp2 + 1e-4 * expected * expected2)
    assert compare.norm(made.matrix, A[None]) < 1e-11
    assert compare.norm(made.target, target[None]) < 1e-11
    scale = np.ones(n)
    for _ in range(3):
        inverse = np.linalg.inv(sigma + scale[patch] * of_charts + A @ A.T)
        e, grown = inverse @ target, scale.copy()
        for i in range(n):
            own = np.ix_(patch == i, patch == i)
            part = scale[i] * of_charts[own]
            q, t = e[patch == i] @ part @ e[patch == i], np.sum(part * inverse[own])
            grown[i] = np.clip(scale[i] * (6.0 + q) / (6.0 + t), 1.0, 16.0)
        scale = grown
    # The product smooths white noise on points ℓ/2 apart instead: 1e-3 at the ends of the grid
    assert compare.norm(made.covariance, (sigma + scale[patch] * of_charts)[None]) < 2e-3


DRAWN = {f"turned-{turns}": views.turned(24, turns) for turns in range(4)} | {
    "half-a-patch-together": views.turned(24, 0),
    "tilted": views.TILTED,
    "reduced-2": views.turned(90, 1, margin=90),
    "reduced-3": views.turned(128, 1, margin=128),
}


@pytest.mark.parametrize("name", DRAWN)
def test_poses_are_where_the_chart_was_drawn(name: str) -> None:
    """To a fiftieth of the pitch; the drawing's own inverse says where."""
    outputs, view = CASES[f"pose/{name}"]["outputs"], DRAWN[name]
    quads = view.quads()
    pitch = np.linalg.norm(quads[1].mean(axis=0) - quads[0].mean(axis=0))
    assert np.linalg.norm(np.array(outputs["corners"]) - view.corners(), axis=1).max() < 0.02 * pitch
    assert np.linalg.norm(np.array(outputs["quads"]) - quads, axis=2).max() < 0.03 * pitch
    if name.startswith("turned"):
        assert outputs["quarter_turns"] == int(name[-1])


def test_gain_maps_are_applied_where_they_lie() -> None:
    applied, stored = (CASES[f"patches/shading-{word}"]["outputs"] for word in ("applied", "stored"))
    gain = (np.array(applied["chart_mean"]) - 256) / (np.array(stored["chart_mean"]) - 256)  # the black level
    # the map of the red positions: 1 + (3 i + 2 j) / 32, i and j linear in the place of the patch's centre
    centres = views.turned(24, 0).quads().mean(axis=1) + 0.5
    width, height = views.turned(24, 0).size
    red = 1 + (3 * 3 * centres[:, 1] / height + 2 * 4 * centres[:, 0] / width) / 32
    assert gain[:, 0] == pytest.approx(red, rel=1e-5)
    assert gain[:, 2] == pytest.approx(red + 3 / 32, rel=1e-5)


def test_the_zero_code_is_the_basis_mean() -> None:
    case, mean = CASES["ssf/cameras-zero-code"], read_basis("cameras").mean
    assert not np.any(case["outputs"]["code"])
    assert compare.peak(case["outputs"]["ssf"], (mean.T / mean.max(axis=1))[::10]) < 1e-11  # twelve digits


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
    scene = next(iter(STAGES["verdict"].cases()))
    assert scene["outputs"] == {"status": "accepted", "codes": []}
    with pytest.raises(GoldenError, match="codes against outputs"):
        generate.finish(scene | {"outputs": {"codes": ["glare"]}})


@pytest.mark.full
def test_nothing_drifted(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """A case whose inputs are the stored ones is not run again: its outputs are those of the tests above."""
    pytest.importorskip("cvxpy", reason="cvxpy is not installed (extra: test): the oracle cannot be asked anew")

    def known(made: Json) -> Json:
        name = made["case"]
        same = name in SOUND and made["inputs"] == CASES[name]["inputs"]
        return outputs_of(name) if same else run(made)

    monkeypatch.setattr(generate, "run", known)
    assert generate.main(["--check"]) == 0, capsys.readouterr().out
    assert "0 drifted" in capsys.readouterr().out


# -- metrics ------------------------------------------------------------------------------------------------------


def test_metrics_by_hand() -> None:
    assert compare.exact([1, 2], [1, 2]) == 0
    assert compare.exact([1, 2], [1, 3]) == np.inf
    assert compare.exact([1, 2], [[1, 2]]) == np.inf
    assert compare.norm([1.0, 10.0], [1.0, 10.5]) == pytest.approx(0.5 / 10.5)
    assert compare.norm([0.25, 0.0], [0.0, 0.0]) == 0.25
    assert compare.norm([np.nan], [1.0]) == np.inf
    assert compare.norm([1.0], [1.0, 1.0]) == np.inf
    assert compare.relative([1.1, 10.0], [1.0, 10.0]) == pytest.approx(0.1)
    assert compare.at_most([1e-9, 3e-9]) == 3e-9
    assert compare.at_most([np.nan]) == np.inf
    matrix = np.arange(36.0).reshape(6, 6)
    matrix = matrix + matrix.T
    known = np.stack([matrix[:, :2].sum(1), matrix[:, 2:4].sum(1), matrix[:, 4:].sum(1)], axis=1)
    assert compare.sums(matrix, known) == 0
    matrix[0, 5] = matrix[5, 0] = matrix[0, 5] + 1.0
    assert compare.sums(matrix, known) == pytest.approx(1.0 / known.max())
    matrix[0, 5] += 1e-6 * matrix.max()
    assert compare.sums(matrix, known) == np.inf  # not symmetric
    assert compare.sums(matrix[:5], known) == np.inf
    assert compare.sums(known, known) == 0
    curves = np.outer(np.linspace(1.0, 2.0, 681), [1.0, 2.0, 4.0])
    nodes = curves[::10] / curves.max(axis=0)
    assert compare.peak(4 * curves, nodes) < 1e-15
    assert compare.peak(nodes, nodes) == 0
    nodes[10, 0] -= 0.01
    assert compare.peak(curves, nodes) == pytest.approx(0.01)
    assert compare.peak(-curves, nodes) == np.inf


def test_rmse_counts_400_to_700_nm() -> None:
    flat = np.ones((681, 3))
    bent = flat.copy()
    bent[:40] = 0.0  # below 400 nm
    bent[641:] = 0.0  # above 700 nm
    assert compare.rmse(bent, flat) == 0
    bent[40:641:2, 0] = 0.5
    count = len(range(40, 641, 2))
    assert compare.rmse(bent, flat) == pytest.approx(np.sqrt(0.25 * count / 601) / 3)


def test_optimality_by_hand() -> None:
    """½ (x - 2)² + |x| has its optimum at 1 with objective 1.5; at x = 2 the dual bound is 0."""
    one = np.ones((1, 1))
    assert compare.optimality(one, np.array([2.0]), one, np.array([1.0]), 0.0, 1.0, False) == (1.5, 0.0)
    objective, gap = compare.optimality(one, np.array([2.0]), one, np.array([2.0]), 0.0, 1.0, False)
    assert (objective, gap) == (2.0, 1.0)
    assert compare.optimality(one, np.array([2.0]), one, np.array([-1.0]), 0.0, 1.0, True)[1] == np.inf
    # γ = 0: ½ ‖w‖² / λ₂ with w = b - x - λ₂ x = 2 at x = 0
    assert compare.optimality(one, np.array([2.0]), one, np.array([0.0]), 4.0, 0.0, False) == (2.0, 0.25)
