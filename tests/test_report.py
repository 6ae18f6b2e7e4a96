"""The report: JSON that its schema accepts, CSV, PNG, a page that a browser likes, all or none on disk."""

import copy
import csv
import errno
import html
import io
import json
import math
import os
import re
import shutil
import subprocess
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import camssf
from camssf.documents import page as _page
from camssf.documents import report as report_module
from camssf.documents.report import NAMES, Report, read_document, report
from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS

jsonschema = pytest.importorskip("jsonschema")

Document = dict[str, Any]
SCHEMA = json.loads((Path(camssf.__file__).parent / "data" / "result.schema.json").read_text("utf-8"))
VALIDATOR = jsonschema.Draft202012Validator(SCHEMA)
WIDTH, HEIGHT = 4032, 3024
CHANNELS = ("red", "green", "blue")


# A realistic document, from tables and formulas


@cache
def spectra() -> tuple[np.ndarray, np.ndarray, list[str], dict[str, np.ndarray], np.ndarray]:
    """Nikon curves (681, 3), reflectances (24, 681), names, lamps, CIE 1931 (681, 3), all on the grid."""
    import colour

    def on_grid(sd: Any) -> np.ndarray:
        columns = np.atleast_2d(np.asarray(sd.values, dtype=float).T)
        inside = [np.interp(WAVELENGTHS, sd.wavelengths, c, left=0, right=0) for c in columns]
        return np.array(inside)

    camera = on_grid(colour.MSDS_CAMERA_SENSITIVITIES["Nikon 5100 (NPL)"]).T
    table = colour.SDS_COLOURCHECKERS["BabelColor Average"]
    lamps = {name: on_grid(colour.SDS_ILLUMINANTS[name])[0] for name in ("D55", "A", "D65")}
    observer = on_grid(colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]).T
    reflectance = np.array([on_grid(sd)[0] for sd in table.values()])
    return camera / camera.max(axis=0), reflectance, list(table), lamps, observer


def curves(values: np.ndarray) -> Document:
    return {"wavelength_nm": WAVELENGTHS.tolist()} | {c: values[:, i].tolist() for i, c in enumerate(CHANNELS)}


def srgb(linear: np.ndarray) -> np.ndarray:
    linear = np.clip(linear, 0, 1)
    return np.clip(np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055), 0, 1)


def quadrangles() -> tuple[np.ndarray, np.ndarray]:
    """Corners (4, 2) and patches (24, 4, 2) of a tilted chart; the camera was held upright: orientation 6."""
    tilt = np.array([[20.0, 385.0, 1180.0], [-372.0, 40.0, 2560.0], [0.012, 0.022, 1.0]])
    i = np.arange(24)
    x, y = i % 6 + 0.08, i // 6 + 0.08
    square = np.array([[0, 0], [0.84, 0], [0.84, 0.84], [0, 0.84]])
    flat = np.stack([x, y], axis=-1)[:, None, :] + square
    outer = np.array([[0.08, 0.08], [5.92, 0.08], [5.92, 3.92], [0.08, 3.92]])

    def project(p: np.ndarray) -> np.ndarray:
        q = np.concatenate([p, np.ones((*p.shape[:-1], 1))], axis=-1) @ tilt.T
        return q[..., :2] / q[..., 2:]

    return project(outer), project(flat)


@cache
def _document(lamps: tuple[str, ...]) -> Document:
    truth, reflectance, names, powers, observer = spectra()
    u = (WAVELENGTHS - 380) / 340
    wobble = 1 + 0.05 * np.cos(np.outer(u, [9, 13, 11]) * np.pi) + 0.02 * np.sin(np.outer(u, [23, 19, 29]))
    found = truth * wobble + 0.006 * np.cos(np.outer(u, [31, 37, 41])) ** 2
    found /= found.max(axis=0)
    std = 0.008 + 0.035 * np.sqrt(found) * (0.6 + np.abs(np.outer(u - 0.5, [1, 1, 1])))
    to_rgb = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.204, 1.057]])
    day = powers["D65"][:, None] * observer
    linear = reflectance @ day / day[:, 1].sum() @ to_rgb.T
    corners, patches = quadrangles()
    shots, squares = [], []
    for j, lamp in enumerate(lamps):
        light = powers[lamp][:, None]
        signal = reflectance @ (light * truth) / (light * truth).sum(axis=0)
        signal *= 1 + 0.004 * np.sin(np.arange(72).reshape(24, 3) * 2.3 + j)
        predicted = reflectance @ (light * found) / (light * found).sum(axis=0)
        unseen = predicted * (1 + 0.006 * np.cos(np.arange(72).reshape(24, 3) * 1.7))
        squares.append(((unseen - signal) / signal) ** 2)
        display = np.linalg.lstsq(signal, linear, rcond=None)[0]
        white = np.array([11800.0, 14200.0, 9100.0])
        entries = [
            {
                "name": name,
                "used": i != 18,
                "reflectance_srgb": srgb(linear[i]).tolist(),
                "measured_srgb": srgb(signal[i] @ display).tolist(),
                "synthetic_srgb": srgb(unseen[i] @ display).tolist(),
                "signal": signal[i].tolist(),
                "predicted": predicted[i].tolist(),
                "unseen": None if i == 18 else unseen[i].tolist(),
                "standard_error": (0.0004 + 0.004 * signal[i]).tolist(),
                "clipped": [0.0, 0.012 if i == 18 else 0.0, 0.0],
                "dead": [0.0004, 0.0, 0.0011],
                "gradient": (0.01 * np.sin([i, i + 1, i + 2])).tolist(),
                "chart": (512 + signal[i] * white).tolist(),
                "white": (512 + white).tolist(),
                "dark": [512.0, 512.25, 511.5],
            }
            for i, name in enumerate(names)
        ]
        shots.append(
            {
                "lamp": {"name": lamp, "tolerance": 0.02, "source": f"CIE illuminant {lamp}, colour-science."},
                "white_reference": "white frame",
                "dark_reference": "dark frame" if j == 0 else "black level",
                "photo": {
                    "name": f"IMG_20261103_1204{j}.dng",
                    "width": WIDTH,
                    "height": HEIGHT,
                    "orientation": 6,
                    "exposure": 0.008,
                    "iso": 100.0,
                    "gain_map": True,
                    "sha256": f"{j}a" * 32,
                    "camera": "NIKON CORPORATION NIKON D5100",
                },
                "white": {"name": f"white_{j}.dng", "sha256": f"{j}b" * 32},
                "dark": {"name": "dark_0.dng", "sha256": "0c" * 32} if j == 0 else None,
                "pose": {
                    "layout": "classic24",
                    "corners": corners.tolist(),
                    "patches": patches.tolist(),
                    "quarter_turns": 1,
                    "method": "detected",
                    "score": 0.987,
                    "notes": ["Two charts are in view; the one with the better agreement was taken."],
                },
                "saturation": 15520.0,
                "patches": entries,
            }
        )
    seen = (WAVELENGTHS >= 400) & (WAVELENGTHS <= 700)
    files = {s[k]["name"]: s[k]["sha256"] for s in shots for k in ("photo", "white", "dark") if s[k]}
    return {
        "format": "camssf-result/1",
        "generator": {"name": "camssf", "version": "0.1.0"},
        "camera": {"make": "NIKON CORPORATION", "model": "NIKON D5100"},
        "chart": {
            "name": "classic24",
            "table": "BabelColor Average",
            "layout": "classic24",
            "source": "Mean of 30 charts measured by BabelColor, from colour-science.",
        },
        "basis": "cameras",
        "engine": "onnx",
        "ssf": curves(found),
        "ssf_std": curves(std),
        "channel_gain": [0.8310, 1.0, 0.6408],
        "code_covariance": covariance()[np.tril_indices(72)].tolist(),
        "gap": [3.1e-18, 3.1e-18, 3.1e-18],
        "layers_gap": [4.2e-18],
        "finish_steps": [0],
        "evidence": 212.375,
        "prior_scale": 1.0,
        "choice": [
            {"basis": "phones", "prior_scale": 1.0, "log_evidence": 205.5, "probability": 0.02},
            {"basis": "phones", "prior_scale": 2.0, "log_evidence": 204.25, "probability": 0.0003},
            {"basis": "cameras", "prior_scale": 1.0, "log_evidence": 212.375, "probability": 0.9727},
            {"basis": "cameras", "prior_scale": 2.0, "log_evidence": 208.0, "probability": 0.007},
        ],
        "gamma": [0.05, 0.05, 0.05],
        "l2": 1.0,
        "shots": shots,
        "scores": {
            "rmsre_percent": (100 * np.sqrt(np.mean(squares, axis=(0, 1)))).tolist(),
            "rmse": np.sqrt(np.mean((found - truth)[seen] ** 2, axis=0)).tolist(),
            "delta_e00": 0.93,
            "unseen": "leave one out: each patch predicted by a fit to the others",
        },
        "truth": {"name": "Nikon 5100 (NPL), measured", "ssf": curves(truth)},
        "verdict": {
            "status": "doubtful",
            "reasons": [
                {
                    "code": "overexposed",
                    "message": "IMG_20261103_12040.dng: 1.2 % of the green samples of the white patch are clipped.",
                    "advice": "Halve the exposure time and take the photo again.",
                    "value": 0.012,
                    "threshold": 0.01,
                }
            ],
        },
        "assumptions": [
            {"code": "lens_shading", "message": "The lens-shading map was not applied; the white frame does it."},
            {"code": "chart_tolerance", "message": "The chart's table was taken to be right to 3 %."},
        ],
        "hashes": {"inputs": files, "model": "0d" * 32},
    }


def covariance() -> np.ndarray:
    """Of 3 x 24 coefficients, as a solution has it: digits of all sizes."""
    root = np.sin(np.add.outer(np.arange(72.0), 1.7 * np.arange(9.0)) ** 2)
    return np.asarray(0.03 * root @ root.T + 0.2 * np.eye(72))


def document(*lamps: str) -> Document:
    return copy.deepcopy(_document(lamps or ("D55",)))


def refused(*, shots: bool = False) -> Document:
    made = document()
    for key in (
        *("ssf", "ssf_std", "code_covariance", "channel_gain", "gap", "layers_gap", "finish_steps", "evidence"),
        *("gamma", "l2", "scores", "truth", "prior_scale", "choice"),
    ):
        del made[key]
    for patch in made["shots"][0]["patches"]:
        patch |= {"measured_srgb": None, "synthetic_srgb": None, "predicted": None, "unseen": None}
    made["shots"] = made["shots"] if shots else []
    made["verdict"] = {
        "status": "refused",
        "reasons": [
            {
                "code": "chart_not_found",
                "message": "chart.dng: no ColorChecker lies in the photo.",
                "advice": "Fill a quarter of the frame with the chart, or give its corners with --corners.",
                "value": None,
                "threshold": None,
            }
        ],
    }
    return made


@cache
def preview() -> bytes:
    """A small rendering of the photo as the sensor saw it."""
    import cv2

    scale = 4
    y, x = np.mgrid[0 : HEIGHT // scale, 0 : WIDTH // scale]
    fall = 1 - 0.35 * (((x / x.max() - 0.5) ** 2 + (y / y.max() - 0.5) ** 2) / 0.5)
    image = np.full((*fall.shape, 3), (96, 110, 122), np.float64)
    corners, patches = quadrangles()
    rim = (corners - corners.mean(axis=0)) * 1.06 + corners.mean(axis=0)
    cv2.fillConvexPoly(image, np.round(rim / scale).astype(np.int32), (26, 25, 25), cv2.LINE_AA)
    for patch, quad in zip(_document(("D55",))["shots"][0]["patches"], patches, strict=True):
        bgr = tuple(255 * v for v in patch["reflectance_srgb"][::-1])
        cv2.fillConvexPoly(image, np.round(quad / scale).astype(np.int32), bgr, cv2.LINE_AA)
    sound, data = cv2.imencode(".jpg", np.clip(image * fall[..., None], 0, 255).astype(np.uint8))
    assert sound
    return bytes(data)


# JSON


def test_the_schema_is_sound_and_versioned() -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    assert SCHEMA["$id"].endswith(":1")
    assert SCHEMA["properties"]["format"]["const"] == "camssf-result/1"

    def words(schema: Any) -> set[str]:
        if not isinstance(schema, dict):
            return set()
        found = set(schema)
        for key in ("properties", "$defs"):
            for entry in schema.get(key, {}).values():
                found |= words(entry)
        for key in ("if", "then", "else", "items", "additionalProperties"):
            found |= words(schema.get(key))
        for entry in schema.get("anyOf", ()):
            found |= words(entry)
        return found

    assert words(SCHEMA) <= report_module._WORDS


def test_every_field_says_what_it_holds() -> None:
    def silent(schema: Document, where: str) -> list[str]:
        known = {**schema.get("properties", {}), **schema.get("$defs", {})}
        found = [
            f"{where}.{key}"
            for key, entry in known.items()
            if "description" not in entry
            and "description" not in SCHEMA["$defs"].get(entry.get("$ref", "").rpartition("/")[2], {})
        ]
        return found + [line for key, entry in known.items() for line in silent(entry, f"{where}.{key}")]

    assert silent(SCHEMA, "") == []


@pytest.mark.parametrize("make", [document, lambda: document("D55", "A"), refused, lambda: refused(shots=True)])
def test_json_is_what_the_schema_says_and_loses_nothing(make: Any) -> None:
    made = make()
    written = report(made).result_json
    VALIDATOR.validate(json.loads(written))
    assert json.loads(written) == made
    assert written.endswith(b"}\n")


def test_json_keeps_arrays_of_numbers_on_one_line() -> None:
    lines = report(document()).result_json.decode().splitlines()
    assert sum(line.count(",") >= 680 for line in lines) == 13  # ssf, ssf_std, truth: 4 lines each; covariance
    assert len(lines) < 700


def shuffled(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: shuffled(value[key]) for key in sorted(value, reverse=True)}
    return [shuffled(entry) for entry in value] if isinstance(value, list) else value


def test_the_same_document_gives_the_same_bytes() -> None:
    first, second = report(document(), [preview()]), report(shuffled(document()), [preview()])
    assert list(shuffled(document())) != list(document())
    assert first == second


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [path, *(place for key, entry in inside for place in places(entry, (*path, key)))]


def small() -> Document:
    made = refused(shots=True)
    made["shots"][0]["patches"] = made["shots"][0]["patches"][:1]
    made["shots"][0]["pose"]["patches"] = made["shots"][0]["pose"]["patches"][:1]
    return made


ODD = st.sampled_from(
    [
        *(None, True, False, 0, 1, -1, 4.0, 0.5, 7, 1e13, -1e13, 10**400),
        *("", "x", "refused", "accepted", "a" * 64, "A" * 64, "x" * 5000),
        *([], [0, 0, 0], [0.1, 0.2, 1.5], [None] * 3, [[0, 0]] * 4, {}, {"name": "x"}),
    ]
)


@pytest.mark.slow
@settings(max_examples=300, deadline=None, derandomize=True)
@given(data=st.data())
def test_the_check_agrees_with_a_full_validator(data: st.DataObject) -> None:
    """One field replaced, removed or added: jsonschema and the compact check give the same answer."""
    made = small()
    *way, last = data.draw(st.sampled_from(places(made)[1:]))
    parent = made
    for key in way:
        parent = parent[key]
    deed = data.draw(st.sampled_from(["replace", "replace", "replace", "remove", "add"]))
    if deed == "replace":
        parent[last] = data.draw(ODD)
    elif deed == "remove":
        del parent[last]
    elif isinstance(parent, dict):
        parent[data.draw(st.sampled_from(["other", "ssf", "ssf_std", "truth"]))] = data.draw(ODD)
    else:
        parent.append(data.draw(ODD))
    try:
        report_module._check(made, SCHEMA, "")
        sound = True
    except report_module._BrokenError:
        sound = False
    assert sound == VALIDATOR.is_valid(made)


def broken(path: str, value: Any) -> Document:
    made = document()
    spot: Any = made
    *way, last = [int(key) if key.isdigit() else key for key in path.split(".")]
    for key in way:
        spot = spot[key]
    spot[last] = value
    return made


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        ("shots.0.patches.3.signal", [0.1, 0.2], r"shots\[0\]\.patches\[3\]\.signal must be at least 3 entries"),
        ("shots.0.patches.3.clipped.1", 1.5, r"shots\[0\]\.patches\[3\]\.clipped\[1\] must be at most 1"),
        ("ssf.red.17", math.nan, r"ssf\.red\[17\] must be a finite number"),
        ("ssf_std.blue.0", -math.inf, r"ssf_std\.blue\[0\] must be a finite number"),
        ("l2", True, r"l2 must be of type number, is True"),
        ("gamma.0", np.float32(1), r"gamma\[0\] must be of type number"),
        ("format", "camssf-result/2", r'format must be "camssf-result/1", is \'camssf-result/2\''),
        ("created", "today", r"has an unknown key, 'created'"),
        ("verdict.status", "splendid", r"verdict\.status must be \"accepted\" or"),
        ("verdict.reasons", [], r"verdict\.reasons must be at least 1 entries"),
        ("verdict.status", "refused", r"ssf must be missing here"),
        ("shots", [], r"shots must be at least 1"),
        ("shots.0.photo.sha256", "0" * 63, r"sha256 must be at least 64 characters"),
        ("shots.0.photo.orientation", 9, r"orientation must be at most 8"),
        ("ssf.wavelength_nm.5", 400.0, r"ssf\.wavelength_nm must be 380 to 720 nm"),
        ("truth.ssf.wavelength_nm.5", 400.0, r"truth\.ssf\.wavelength_nm must be 380 to 720 nm"),
        ("layers_gap", [0.0, 0.0], r"layers_gap must hold one number a problem, 1 or 3 of them, holds 2"),
        ("finish_steps", [0, 0, 0], r"finish_steps must hold one number a problem, 1 or 3 of them, holds 3"),
        ("finish_steps.0", 1.5, r"finish_steps\[0\] must be of type integer"),
        ("finish_steps.0", -1, r"finish_steps\[0\] must be at least 0"),
        ("evidence", math.inf, r"evidence must be a finite number"),
        ("code_covariance", [1.0] * 7, r"code_covariance must be the triangle of a matrix of 3 r rows, holds 7"),
        ("code_covariance", [1.0] * 10, r"code_covariance must be the triangle of a matrix of 3 r rows, holds 10"),
        ("code_covariance.5", -1e-9, r"code_covariance\[5\] must not be negative, it is a variance"),
        ("ssf.green", [0.5] * 681, r"ssf\.green must have peak 1, has 0\.5"),
        ("shots.0.pose.patches", [[[0, 0], [1, 0], [1, 1], [0, 1]]], r"pose\.patches must hold 24 entries"),
    ],
)
def test_a_broken_document_is_named_by_its_place(path: str, value: Any, words: str) -> None:
    with pytest.raises(InvalidArgument, match=words) as caught:
        report(broken(path, value))
    assert caught.value.advice


def test_an_integer_too_long_to_print_is_refused() -> None:
    with pytest.raises(InvalidArgument, match=r"l2 must be at most 1000000000000\.0, is a huge integer"):
        report(broken("l2", 10**5000))


def test_the_covariance_comes_back_from_its_triangle() -> None:
    """Entry (i, j), j <= i, is number i (i + 1) / 2 + j, as the schema says; every digit is kept."""
    found = json.loads(report(document()).result_json)["code_covariance"]
    i, j = np.tril_indices(72)
    assert np.array_equal(np.array(found)[i * (i + 1) // 2 + j], covariance()[i, j])
    assert len(found) == 72 * 73 // 2


def test_a_document_of_before_the_proof_is_still_shown() -> None:
    made = document()
    for key in ("code_covariance", "layers_gap", "finish_steps", "evidence", "prior_scale", "choice"):
        del made[key]
    assert "The proof:" not in report(made).html
    assert "Which basis answered" not in report(made).html
    VALIDATOR.validate(made)


def test_the_page_says_which_basis_answered() -> None:
    """With what odds, and why; nothing where the basis was told."""
    page = report(document()).html
    assert "<h2>Which basis answered</h2>" in page
    assert "The signals speak for cameras, 48 : 1 against phones, so it answers alone." in page
    assert "The file&#x27;s word for the maker" in page
    assert "With a probability of 0.7 % the camera lies further out" in page
    assert '<th scope="row">phones</th><td>2</td><td>\u22128.1</td><td>&lt; 0.1 %</td>' in page
    assert '<th scope="row">cameras</th><td>1</td><td>0.0</td><td>97.3 %</td>' in page
    assert "Which basis answered" not in report(document() | {"choice": []}).html
    assert "Which basis answered" not in report(refused()).html


@pytest.mark.parametrize(
    ("gaps", "steps", "near", "walked"),
    [
        ([4.2e-18], [0], "4.2 × 10<sup>\u221218</sup>", "had nothing to do."),
        ([3e-9], [1], "3.0 × 10<sup>\u22129</sup>", "took 1 step to it."),
        ([3e-9], [17], "3.0 × 10<sup>\u22129</sup>", "took 17 steps to it."),
        ([-1e-17], [0], "0", "had nothing to do."),
        ([0.2, 0.013, 0.4], [5, 0, 11], "0.40", "took 5, 0, 11 steps to it (red, green, blue)."),
    ],
)
def test_the_page_says_what_the_proof_is(gaps: list[float], steps: list[int], near: str, walked: str) -> None:
    page = report(document() | {"layers_gap": gaps, "finish_steps": steps}).html
    line = next(line for line in page.splitlines() if "The proof:" in line)
    assert f"came within {near} of the optimum (relative duality gap); the exact finish {walked}" in line


def test_a_document_without_curves_must_be_refused() -> None:
    made = document()
    del made["ssf"], made["gap"]
    with pytest.raises(InvalidArgument, match="the document lacks ssf, gap"):
        report(made)
    with pytest.raises(InvalidArgument, match="must be of type object"):
        report([])  # type: ignore[arg-type]


def test_read_document_gives_back_what_was_written(tmp_path: Path) -> None:
    report(document()).save(tmp_path)
    again = read_document(tmp_path / "result.json")
    assert again == document()
    assert report(again) == report(document())


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is not sound JSON"),
        (b'{"format": "camssf-res', "is not sound JSON"),
        (b"\xff\xfe{}", "is not sound JSON"),
        (b"[" * 100_000, "is not sound JSON"),
        (b'{"l2": NaN}', "NaN is not a number"),
        (b'{"l2": -Infinity}', "-Infinity is not a number"),
        (b'{"l2": 1, "l2": 2}', "the same key twice"),
        (b'{"l2": ' + b"9" * 5000 + b"}", "is not sound JSON"),
        (b"[]", "must be of type object"),
        (b'{"format": "camssf-patches/1"}', "lacks generator"),
    ],
)
def test_read_document_refuses_what_is_no_result(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "result.json"
    path.write_bytes(content)
    with pytest.raises(InvalidArgument, match=words) as caught:
        read_document(path)
    assert "result.json" in caught.value.message


def test_read_document_refuses_numbers_beyond_floats(tmp_path: Path) -> None:
    text = report(document()).result_json.replace(b'"l2": 1.0', b'"l2": 1e999')
    (tmp_path / "result.json").write_bytes(text)
    with pytest.raises(InvalidArgument, match="l2 must be a finite number"):
        read_document(tmp_path / "result.json")


def test_read_document_refuses_missing_huge_and_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for path in (tmp_path / "missing.json", tmp_path, "a\0b"):
        with pytest.raises(InvalidArgument, match="cannot be read"):
            read_document(path)
    monkeypatch.setattr(report_module, "LARGEST_DOCUMENT", 100)
    (tmp_path / "big.json").write_bytes(b" " * 101)
    with pytest.raises(InvalidArgument, match="larger than 100 bytes"):
        read_document(tmp_path / "big.json")


# CSV and PNG


def test_csv_reads_back() -> None:
    made = document()
    made["ssf"]["blue"][-1] = -1e-12
    text = report(made).ssf_csv
    assert text is not None
    rows = list(csv.reader(io.StringIO(text)))
    assert rows[0] == ["wavelength_nm", "red", "green", "blue", "red_std", "green_std", "blue_std"]
    values = np.array(rows[1:], dtype=float)
    assert values.shape == (681, 7)
    np.testing.assert_array_equal(values[:, 0], WAVELENGTHS)
    want = np.array([made[key][c] for key in ("ssf", "ssf_std") for c in CHANNELS]).T
    np.testing.assert_allclose(values[:, 1:], want, rtol=0, atol=5.1e-10)
    assert all(re.fullmatch(r"\d{3}\.\d(,-?\d\.\d{9}){6}", line) for line in text.splitlines()[1:])
    assert "-0.000000000" not in text


def test_csv_without_bands() -> None:
    for made in (document(), document()):
        made["ssf_std"] = None
        text = report(made).ssf_csv
        assert text is not None
        assert text.splitlines()[0] == "wavelength_nm,red,green,blue"
        del made["ssf_std"]
        assert report(made).ssf_csv == text


@pytest.mark.slow
def test_png_shows_curves_bands_and_truth() -> None:
    import cv2

    def pixels(made: Document) -> np.ndarray:
        data = report(made).ssf_png
        assert data is not None
        return np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)).astype(int)

    def share(image: np.ndarray, rgb: tuple[int, int, int]) -> int:
        return int((np.abs(image - rgb[::-1]).max(axis=-1) < 12).sum())

    made = document()
    full = pixels(made)
    assert full.shape == (810, 1440, 3)
    del made["truth"]
    untrue = pixels(made)
    made["ssf_std"] = None
    bare = pixels(made)
    for hue in ((184, 50, 42), (35, 121, 74), (42, 87, 176)):
        assert share(bare, hue) > 1000
    ink = (36, 38, 43)
    assert share(full, ink) > share(untrue, ink) + 500
    pale = (245, 228, 227)  # the red's band on white, 16 %: 255 - 0.16 (255 - 184)
    assert share(untrue, pale) > share(bare, pale) + 1000


# The page

_TAGS = """html head meta title link style body main header footer section div p h1 h2 h3 ul li dl dt dd span strong
small code sub sup br table caption thead tbody tr th td details summary figure figcaption
svg g path line rect circle text tspan polygon image use clippath"""
TAGS = frozenset(_TAGS.split())


class Page(HTMLParser):
    """Tags, attributes and text of a page; text in a style element is left out."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.words: list[str] = []
        self.feed(page)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in ("meta", "link", "br"):
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag, f"</{tag}> closes nothing"

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] not in ("style", "title"):
            self.words.append(data)

    @property
    def text(self) -> str:
        return re.sub(r"\s+", " ", " ".join(self.words))


def test_page_is_well_formed_and_accessible() -> None:
    page = Page(report(document("D55", "A"), [preview(), None]).html)
    assert page.open == []
    tags = [tag for tag, _ in page.tags]
    assert set(tags) <= TAGS
    assert ("html", {"lang": "en-GB"}) in page.tags
    assert tags.count("h1") == 1
    assert tags.count("table") == tags.count("caption") >= 6
    for tag, attributes in page.tags:
        if attributes.get("role") == "img" or tag == "image":
            assert tag == "image" or attributes["aria-label"]
    ids = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
    assert len(ids) == len(set(ids))


def test_page_needs_nothing_else() -> None:
    made = report(document("D55", "A"), [preview(), preview()]).html
    for _, attributes in Page(made).tags:
        assert "src" not in attributes
        for key in ("href", "xlink:href"):
            assert (attributes.get(key) or "#").startswith(("#", "data:"))
    assert not re.search(r"@import|url\((?!#)|https?://", made)


def test_page_tells_the_document_s_numbers() -> None:
    made = document()
    page = Page(report(made, [preview()]).html)
    error = sum(made["scores"]["rmsre_percent"]) / 3
    assert f"{error:.2f} %" in page.text
    assert "NIKON D5100" in page.text
    assert "D55" in page.text
    assert "BabelColor Average" in page.text
    reason = made["verdict"]["reasons"][0]
    for words in (reason["message"], reason["advice"], "value 0.012", "limit 0.01", made["truth"]["name"]):
        assert words in page.text
    for entry in made["assumptions"]:
        assert entry["message"] in page.text
    for digest in (*made["hashes"]["inputs"].values(), made["hashes"]["model"]):
        assert digest in page.text
    order = [
        "Doubtful",
        "Spectral sensitivity red",
        "Measured against",
        "Residuals",
        "on the photo",
        "What was assumed",
    ]
    found = [page.text.find(words) for words in [*order, "Details", "Hashes"]]
    assert found == sorted(found)
    assert found[0] > 0


def test_page_says_what_the_curves_are_worth_for_colour() -> None:
    """Its numbers are those of `quality_of`, and the matrix keeps white."""
    from camssf.colour import quality_of, white_of
    from camssf.spectra import read_lamp

    given = document("D55")
    shown = report(given).html
    found = quality_of(np.array([given["ssf"][c] for c in CHANNELS]).T, "A")
    assert f"Sensitivity metamerism index {found.smi:.0f} " in shown
    assert f"under A {found.matrix.delta_e00['matrix']:.2f} by a matrix" in shown
    rows = re.findall(r"[XYZ] from A&#x27;s camera RGB</th>((?:<td>.*?</td>)+)", shown)
    numbers = [[float(n.replace("\u2212", "-")) for n in re.findall(r"<td>(.*?)</td>", row)] for row in rows]
    assert np.abs(np.sum(numbers, axis=1) - white_of(read_lamp("A").values)).max() < 1e-3
    assert "worth for colour" not in report(refused()).html


def test_page_without_bands_says_so() -> None:
    made = document()
    made["ssf_std"] = None
    page = Page(report(made).html)
    assert "so it gives no band" in page.text
    assert "half-width" not in page.text
    assert not [a for _, a in page.tags if (a.get("class") or "").startswith("band")]
    assert "half-width" in Page(report(document()).html).text


def test_curves_are_drawn_to_scale() -> None:
    made = document()
    page = Page(report(made).html)
    wide = next(i for i, (_, a) in enumerate(page.tags) if a.get("class") == "plot wide")
    for colour in CHANNELS:
        line = next(a["d"] for _, a in page.tags[wide:] if a.get("class") == f"curve {colour}")
        points = np.array([pair.split(",") for pair in (line or "")[1:].split("L")], dtype=float)
        for drawn, meant in ((points[:, 0], WAVELENGTHS[::2]), (points[:, 1], np.array(made["ssf"][colour])[::2])):
            fit = np.polynomial.Polynomial.fit(meant, drawn, 1)
            assert np.abs(fit(meant) - drawn).max() < 0.06  # half of the last digit, px
        assert points[:, 0].min() >= 0
        assert np.ptp(points[:, 0]) > 1000
        assert points[np.argmax(made["ssf"][colour][::2]), 1] == points[:, 1].min()  # up is more


def test_tiles_carry_measured_left_and_synthetic_right() -> None:
    made = document()
    page = Page(report(made).html)
    at = [i for i, (_, a) in enumerate(page.tags) if a.get("class") == "tile"]
    assert len(at) == 24
    for i, patch in zip(at, made["shots"][0]["patches"], strict=True):
        for step, key in ((1, "measured_srgb"), (2, "synthetic_srgb")):
            want = "".join(f"{round(255 * v):02x}" for v in patch[key])
            assert page.tags[i + step][1]["style"] == f"background:#{want}"
        assert patch["name"] in (page.tags[i][1]["aria-label"] or "")
    assert any(a.get("style") == "--columns:6" for _, a in page.tags)


def test_residuals_are_predicted_minus_measured() -> None:
    made = document()
    patches = made["shots"][0]["patches"]
    patches[5]["unseen"] = [2.5 * v for v in patches[5]["signal"]]  # + 150 %: beyond any scale
    patches[6]["signal"] = [0.0, 0.1, 0.1]  # no light, no relative error
    page = report(made).html
    rows = re.findall(r'<tr><th scope="row"><span class="swatch".*?</tr>', page, re.DOTALL)
    assert len(rows) == 24
    for patch, row in zip(patches, rows, strict=True):
        shown = re.findall(r'class="value">([^<]*)<', row)
        guess = patch["unseen"] or patch["predicted"]
        want = [100 * (g - y) / y for g, y in zip(guess, patch["signal"], strict=True) if y > 0]
        assert [float(v.replace("\u2212", "-")) for v in shown] == pytest.approx(want, abs=0.051)
        assert ("hollow" in row) == (patch["unseen"] is None)
        assert ("not fitted" in row) == (not patch["used"])
    assert rows[5].count("<path") == 3
    assert rows[6].count("–</td>") == 1
    # A dot left of the middle is a negative residual.
    for x, shown in re.findall(r'<circle class="full" cx="([\d.]+)%".*?class="value">([^<]*)<', page, re.DOTALL):
        value = float(shown.replace("\u2212", "-"))
        assert value == 0 or (float(x) > 50) == (value > 0)


def test_a_bar_holds_noise_and_what_the_prediction_leaves_open() -> None:
    plain, banded = document(), document()
    patches = banded["shots"][0]["patches"]
    for patch in patches:
        patch["predicted_std"], patch["unseen_std"] = [0.5] * 3, None if patch["unseen"] is None else [1.0] * 3
    assert "measurement's own noise" in report(plain).html
    page = report(banded).html
    assert "measurement's own noise" not in page
    unseen = sum(patch["unseen"] is not None for patch in patches)
    assert f"Of {3 * unseen} unseen values 100% lie within their bars." in page
    _, half = _page._errors(banded["shots"][0])
    for i, patch in enumerate(patches):
        size = 0.5 if patch["unseen"] is None else 1.0
        for c in range(3):
            by_hand = 100 * 1.96 * np.hypot(size, patch["standard_error"][c]) / patch["signal"][c]
            assert half[i, c] == pytest.approx(by_hand, rel=1e-4)
    jsonschema.validate(banded, SCHEMA)


DISPLAY = {
    1: lambda a: a,
    2: np.fliplr,
    3: lambda a: np.rot90(a, 2),
    4: np.flipud,
    5: np.transpose,
    6: lambda a: np.rot90(a, -1),
    7: lambda a: np.rot90(a, 2).T,
    8: lambda a: np.rot90(a, 1),
}
"""What each TIFF orientation does to the stored rows and columns (TIFF 6.0, tag 274)."""


@pytest.mark.parametrize("orientation", range(1, 9))
def test_outlines_follow_the_orientation(orientation: int) -> None:
    stored = np.zeros((5, 7))
    stored[1, 4] = 1
    shown = DISPLAY[orientation](stored)
    (row,), (column,) = np.nonzero(shown)
    point = _page._upright([4, 1], 7, 5, orientation)
    assert point.tolist() == [column + 0.5, row + 0.5]  # the middle of that pixel


@pytest.mark.parametrize("orientation", [1, 6])
def test_the_photo_is_drawn_once_and_turned_with_its_outlines(orientation: int) -> None:
    made = document()
    made["shots"][0]["photo"]["orientation"] = orientation
    page = Page(report(made, [preview()]).html)
    images = [a for tag, a in page.tags if tag == "image"]
    assert len(images) == 1
    assert (images[0]["width"], images[0]["height"]) == ("4032", "3024")
    a, b, c, d, e, f = (int(v) for v in (images[0]["transform"] or "")[7:-1].split())
    outlines = [tag["points"] for name, tag in page.tags if name == "polygon"]
    assert len(outlines) == 25
    quad = np.array(made["shots"][0]["pose"]["patches"][0]) + 0.5
    want = np.stack([a * quad[:, 0] + c * quad[:, 1] + e, b * quad[:, 0] + d * quad[:, 1] + f], axis=-1)
    drawn = np.array([pair.split(",") for pair in (outlines[1] or "").split()], dtype=float)
    np.testing.assert_allclose(drawn, want, atol=0.051)
    size = (4032, 3024) if orientation == 1 else (3024, 4032)
    assert any(a.get("viewbox") == f"0 0 {size[0]} {size[1]}" for _, a in page.tags)


@pytest.mark.parametrize(("columns", "rows"), [(6, 4), (14, 10), (1, 1), (4, 1)])
@pytest.mark.parametrize("turns", range(4))
def test_columns_come_from_the_outlines(columns: int, rows: int, turns: int) -> None:
    i = np.arange(columns * rows)
    centres = np.stack([i % columns, i // columns], axis=-1) @ np.linalg.matrix_power([[0, 1], [-1, 0]], turns)
    quads = centres[:, None] + np.array([[0, 0], [0.8, 0.1], [0.9, 0.9], [0, 0.8]])
    assert _page._columns(quads.tolist()) == columns


HOSTILE = (
    "<script>alert(1)</script>\"'>&$\\frac{<img src=x onerror=alert(2)>]]>--> \x00\x1b\u202e漢\U0001f4f7\ud800 ${x}"
)


def hostile(value: Any, words: str) -> Any:
    """Every free text of a document replaced."""
    kept = {
        "format",
        "generator",
        "engine",
        "white_reference",
        "dark_reference",
        "method",
        "status",
        "sha256",
        "model",
    }
    if isinstance(value, dict):
        if "inputs" in value:
            return {"inputs": {words: "0" * 64}, "model": None}
        return {
            key: words if key == "model" and "make" in value else entry if key in kept else hostile(entry, words)
            for key, entry in value.items()
        }
    if isinstance(value, list):
        return [hostile(entry, words) for entry in value]
    return words if isinstance(value, str) else value


def test_hostile_text_stays_text(tmp_path: Path) -> None:
    made = hostile(document("D55", "A"), HOSTILE)
    made["verdict"]["status"] = "doubtful"
    result = report(made, [preview()])
    page = Page(result.html)
    assert page.open == []
    assert {tag for tag, _ in page.tags} <= TAGS
    assert not [key for _, attributes in page.tags for key in attributes if key.startswith("on")]
    shown = re.sub("[\x00\x1b\u202e\ud800]", "\ufffd", HOSTILE)
    assert page.text.count(shown) > 30
    assert not re.search("[\x00\x1b\u202e\ud800]", result.html)
    result.save(tmp_path)
    again = read_document(tmp_path / "result.json")
    assert again["camera"]["make"] == HOSTILE.replace("\ud800", "\ufffd")
    VALIDATOR.validate(again)


def test_odd_numbers_still_draw() -> None:
    """Signed and tiny curves, huge bands, a chart of no size: nothing breaks, no nan or inf is drawn."""
    made = document()
    wave = np.cos(WAVELENGTHS / 9)
    made["ssf"]["red"] = (wave / wave.max() * 1).tolist()
    made["ssf_std"]["green"] = [1e12] * 681
    made["scores"] |= {"rmsre_percent": [1e9, 0.0, 1e-9], "rmse": None, "delta_e00": 0}
    pose = made["shots"][0]["pose"]
    pose |= {"corners": [[5, 5]] * 4, "patches": [[[5, 5]] * 4] * 24}
    made["shots"][0]["photo"] |= {"exposure": 0, "iso": None, "width": 4032.0}
    for patch in made["shots"][0]["patches"]:
        patch |= {"signal": [2e-6, 0, -1], "unseen": [1e12, 1e12, 1e12]}
    made["truth"]["ssf"]["blue"] = [0] * 681
    result = report(made)
    assert not re.search(r'="[^"]*\b(nan|inf)\b', result.html)
    assert result.ssf_png is not None


# Refused


@pytest.mark.parametrize("shots", [False, True])
def test_a_refused_capture_says_why(shots: bool) -> None:
    made = refused(shots=shots)
    result = report(made, [preview()] if shots else [])
    assert result.ssf_csv is None
    assert result.ssf_png is None
    VALIDATOR.validate(json.loads(result.result_json))
    page = Page(result.html)
    reason = made["verdict"]["reasons"][0]
    for words in ("Refused", reason["message"], reason["advice"], "chart_not_found", "What was assumed", "Hashes"):
        assert words in page.text
    assert ("on the photo" in page.text) == shots
    for words in ("Residuals", "synthetic", "RMSRE"):
        assert words not in page.text


# On disk


def state(folder: Path) -> dict[str, bytes | None]:
    return {str(p.relative_to(folder)): p.read_bytes() if p.is_file() else None for p in folder.rglob("*")}


@cache
def results() -> tuple[Report, Report, Report]:
    other = document()
    other["camera"]["model"] = "another"
    return report(document()), report(other), report(refused())


def test_save_leaves_four_files(tmp_path: Path) -> None:
    first, second, _ = results()
    paths = first.save(tmp_path / "a" / "b")
    assert [path.name for path in paths] == list(NAMES)
    assert state(tmp_path / "a" / "b") == {
        "result.json": first.result_json,
        "ssf.csv": (first.ssf_csv or "").encode(),
        "ssf.png": first.ssf_png,
        "report.html": first.html.encode(),
    }
    second.save(str(tmp_path / "a" / "b"))
    assert state(tmp_path / "a" / "b")["result.json"] == second.result_json


def test_a_refused_result_takes_older_curves_away(tmp_path: Path) -> None:
    first, _, refusal = results()
    first.save(tmp_path)
    (tmp_path / "notes.txt").write_text("mine")
    assert [path.name for path in refusal.save(tmp_path)] == ["result.json", "report.html"]
    assert sorted(state(tmp_path)) == ["notes.txt", "report.html", "result.json"]


@pytest.mark.parametrize("earlier", [False, True])
@pytest.mark.parametrize("which", ["result", "refusal"])
@pytest.mark.parametrize("error", [OSError(errno.ENOSPC, "No space left on device"), KeyboardInterrupt()])
@pytest.mark.parametrize("call", ["write", "replace"])
@pytest.mark.parametrize("turn", range(4))
def test_save_is_all_or_none(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    earlier: bool,
    which: str,
    error: BaseException,
    call: str,
    turn: int,
) -> None:
    first, second, refusal = results()
    coming = second if which == "result" else refusal
    folder = tmp_path / "deep" / "out"
    if earlier:
        first.save(folder)
    before = state(tmp_path)
    name = "fsync" if call == "write" else "replace"
    real, calls = getattr(os, name), 0

    def failing(*args: Any) -> Any:
        nonlocal calls
        calls += 1
        if calls == turn + 1:
            raise error
        return real(*args)

    monkeypatch.setattr(os, name, failing)
    if turn >= (4 if which == "result" else 2):
        coming.save(folder)  # there is no such call: nothing fails
        return
    with pytest.raises(InvalidArgument if isinstance(error, OSError) else KeyboardInterrupt):
        coming.save(folder)
    monkeypatch.undo()
    assert calls >= turn + 1
    assert state(tmp_path) == before


def test_a_real_limit_on_file_size_leaves_nothing(tmp_path: Path) -> None:
    resource = pytest.importorskip("resource", reason="no limits on file size on this system")
    first, _, _ = results()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(first.result_json) // 2, hard))
    try:
        with pytest.raises(InvalidArgument, match="cannot be written") as caught:
            first.save(tmp_path / "out")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert "nothing was left behind" in caught.value.advice
    assert state(tmp_path) == {}


def test_save_refuses_what_is_in_the_way(tmp_path: Path) -> None:
    first, _, refusal = results()
    (tmp_path / "file").write_text("mine")
    (tmp_path / "out" / "ssf.png").mkdir(parents=True)
    before = state(tmp_path)
    for result, folder in ((first, "file"), (first, "out"), (refusal, "out"), (first, "file/below"), (first, "a\0b")):
        with pytest.raises(InvalidArgument):
            result.save(tmp_path / folder)
        assert state(tmp_path) == before


def test_previews_must_be_pictures() -> None:
    with pytest.raises(InvalidArgument, match="Preview 1 is not a JPEG or PNG"):
        report(document(), [b"GIF89a"])
    with pytest.raises(InvalidArgument, match="2 previews for 1 shots"):
        report(document(), [None, preview()])


# In a browser


def browse(page: Path, profile: Path) -> tuple[str, list[str]]:
    """The page's DOM after loading and what it wrote to the console."""
    browser = next(
        filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable"))),
        None,
    )
    if browser is None:
        pytest.skip("no Chromium on this machine: the page is not checked in a browser")
    flags = "headless no-sandbox disable-gpu disable-quic no-first-run disable-background-networking "
    flags += "disable-component-update disable-sync enable-logging=stderr v=0 virtual-time-budget=5000 dump-dom"
    run = subprocess.run(
        [browser, *(f"--{flag}" for flag in flags.split()), f"--user-data-dir={profile}", page.as_uri()],
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    return run.stdout, [line for line in run.stderr.splitlines() if "CONSOLE" in line]


@pytest.mark.slow
def test_the_page_in_a_browser(tmp_path: Path) -> None:
    """No word on the console; no sideways scrolling at phone and desktop width, long names included."""
    long = hostile(document(), "A_name_without_a_gap_" * 20)
    pages = {
        "two shots": report(document("D55", "A"), [preview(), None]).html.replace("<details>", "<details open>"),
        "refused": report(refused()).html,
        "long names": report(long, [preview()]).html.replace("<details>", "<details open>"),
        "control": "<!DOCTYPE html><div style='width:1500px'>too wide</div>",
    }
    frames = "".join(
        f'<iframe title="{name}" style="border:0;width:{width}px;height:900px" srcdoc="{html.escape(page)}"></iframe>'
        for name, page in pages.items()
        for width in (390, 1280)
    )
    measure = """<pre id="found"></pre><script>
    addEventListener("load", () => {
      const found = [...document.querySelectorAll("iframe")].map(f => {
        const root = f.contentDocument.documentElement;
        return [f.title, root.clientWidth, root.scrollWidth, root.scrollHeight];
      });
      document.getElementById("found").textContent = JSON.stringify(found);
      console.log("measured");
    });</script>"""
    harness = tmp_path / "harness.html"
    harness.write_text(f"<!DOCTYPE html><meta charset=utf-8><title>widths</title>{frames}{measure}", "utf-8")
    dom, console = browse(harness, tmp_path / "profile")
    assert len(console) == 1, console
    assert "measured" in console[0]
    found = re.search(r'<pre id="found">(.*?)</pre>', dom)
    assert found is not None
    widths = {(name, client): (scroll, height) for name, client, scroll, height in json.loads(found[1])}
    assert len(widths) == 8
    for (name, client), (scroll, height) in widths.items():
        assert (scroll > client) == (name == "control"), f"{name} at {client} px is {scroll} px wide"
        assert name in ("control", "refused") or height > 2000
    report(document(), [preview()]).save(tmp_path / "out")
    dom, console = browse(tmp_path / "out" / "report.html", tmp_path / "profile2")
    assert console == []
    assert "NIKON D5100" in dom
    assert "0.8310" in dom
    assert "\u2212" in dom  # read as UTF-8
