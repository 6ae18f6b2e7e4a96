"""Result documents like those of a calibration, from tables and formulas: doubtful, refused, of an unnamed light."""

from __future__ import annotations

import copy
from datetime import UTC, datetime
from functools import cache
from typing import Any

import numpy as np

from camssf.documents.excerpt import excerpt
from camssf.documents.passport import Passport
from camssf.grid import WAVELENGTHS
from camssf.photo.read.unit import Unit
from camssf.report.provenance import Provenance, Signature
from camssf.rules import rules
from camssf.spectra import read_camera, read_chart, read_lamp
from camssf.spectra.surfaces import observer

Document = dict[str, Any]
WIDTH, HEIGHT = 4032, 3024
CHANNELS = ("red", "green", "blue")


@cache
def spectra() -> tuple[np.ndarray, np.ndarray, list[str], dict[str, np.ndarray], np.ndarray]:
    """Nikon curves (681, 3), reflectances (24, 681), names, lamps, CIE 1931 (681, 3), all on the grid."""
    chart = read_chart("classic24")
    lamps = {name: read_lamp(name).values for name in ("D55", "A", "D65")}
    return read_camera("Nikon D850").values, chart.values, list(chart.patches), lamps, observer("1931")


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
    truth, reflectance, names, powers, cie = spectra()
    u = (WAVELENGTHS - 380) / 340
    wobble = 1 + 0.05 * np.cos(np.outer(u, [9, 13, 11]) * np.pi) + 0.02 * np.sin(np.outer(u, [23, 19, 29]))
    found = truth * wobble + 0.006 * np.cos(np.outer(u, [31, 37, 41])) ** 2
    found /= found.max(axis=0)
    std = 0.008 + 0.035 * np.sqrt(found) * (0.6 + np.abs(np.outer(u - 0.5, [1, 1, 1])))
    to_rgb = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.204, 1.057]])
    day = powers["D65"][:, None] * cie
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
                "lamp": {
                    "name": lamp,
                    "tolerance": 0.02,
                    "source": f"CIE illuminant {lamp}, colour-science.",
                    "power": (powers[lamp] / powers[lamp].mean()).tolist(),
                },
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
                    "camera": "NIKON CORPORATION NIKON D850",
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
        "camera": {"make": "NIKON CORPORATION", "model": "NIKON D850"},
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
            {"basis": "phones", "log_evidence": 205.5, "probability": 0.02},
            {"basis": "cameras", "log_evidence": 212.375, "probability": 0.9797},
            {"basis": "ryyb", "log_evidence": 202.5, "probability": 0.0003},
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
        "truth": {"name": "Nikon D850, measured", "ssf": curves(truth)},
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
            "checks": checks(len(lamps)),
        },
        "uncertainty": {
            "half_width": 0.036,
            "alone": [0.05, 0.06][: len(lamps)] if len(lamps) > 1 else [],
            "budget": [
                {"source": "noise", "size": "standard errors, median 0.10%", "share": [0.08, 0.06, 0.11]},
                {"source": "chart", "size": "3.0% a patch, smooth over 100 nm", "share": [0.41, 0.38, 0.3]},
                {"source": "white", "size": "1.0%, smooth over 100 nm", "share": [0.01, 0.01, 0.02]},
                {"source": "lamp", "size": "2.0%, smooth over 60 nm", "share": [0.1, 0.15, 0.17]},
                {"source": "unseen", "size": "what no patch has seen", "share": [0.4, 0.4, 0.4]},
            ],
        },
        "assumptions": [
            {"code": "lens_shading", "message": "The lens-shading map was not applied; the white frame does it."},
            {"code": "chart_tolerance", "message": "The chart's table was taken to be right to 3 %."},
        ],
        "hashes": {"inputs": files, "model": "0d" * 32},
    }


def checks(shots: int, *, unnamed: bool = False) -> list[Document]:
    """One number of each limit of the rules, all held but the clipped patch's: as many as a verdict can weigh."""
    variants = (
        "unusual_",
        "lamp_residual_camera",
        "white_balance_mismatch_unnamed",
        "band_ratio_typical",
    )  # other limits of a check
    variants += ("chart_fading",)  # weighed for a camera of no family alone
    variants += () if unnamed else ("unnamed", "band_ratio")
    bounds = {name.partition(".")[2]: each for name, each in rules().numbers.items() if each.makes == "doubtful"}
    bounds = {name: each for name, each in bounds.items() if not name.startswith(variants)}
    found = []
    for name, bound in bounds.items():
        above = bound.beyond == "above"
        whole = name in (
            "goodness_of_fit", "improbable_curves", "lamp_residual", "chart_fading", "other_makers", "unnamed",
            "band_ratio", "vague", "rival",
        )  # fmt: skip
        for shot in [None] if whole else range(1, shots + 1):
            inside = bound.value * (0.31 if above else 1.23)
            found.append(
                {
                    "name": name,
                    "shot": shot,
                    "value": bound.value * 1.2 if (name, shot) == ("dirty", 1) else inside,
                    "limit": bound.value,
                    "refuses": rules().number(f"verdict.{bound.refuses}") if bound.refuses else None,
                    "beyond": bound.beyond,
                }
            )
    return found


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
        *("gamma", "l2", "scores", "truth", "prior_scale", "choice", "uncertainty"),
    ):
        del made[key]
    for patch in made["shots"][0]["patches"]:
        patch |= {"measured_srgb": None, "synthetic_srgb": None, "predicted": None, "unseen": None}
    made["shots"] = made["shots"] if shots else []
    made["verdict"] = {
        **({"checks": made["verdict"]["checks"]} if shots else {}),
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


def unplaced() -> Document:
    """A refusal that found no chart, and so has nothing but the photo."""
    made = refused(shots=True)
    made["shots"][0] |= {"pose": None, "patches": []}
    del made["verdict"]["checks"]
    return made


def unnamed() -> Document:
    """Of an unnamed light."""
    made = document()
    made["verdict"]["checks"] = checks(1, unnamed=True)
    power = np.array(made["shots"][0]["lamp"].pop("power"))
    made["shots"][0]["lamp"] |= {"name": "auto", "tolerance": None, "source": "Nobody named the light."}
    made["shots"][0]["light"] = {
        "kinds": {"daylight": 0.93, "white-led": 0.04, "fluorescent": 0.03, "bulb": 0.0},
        "wavelength_nm": WAVELENGTHS.tolist(),
        "power": power.tolist(),
        "std": (0.6 * np.exp(-(((WAVELENGTHS - 400) / 60) ** 2)) + 0.05).tolist(),
        "kelvin": 5480.0,
        "kelvin_std": 210.0,
    }
    made["choice"] = [
        each | {"kinds": [kind], "probability": each["probability"] * share}
        for each in made["choice"]
        for kind, share in made["shots"][0]["light"]["kinds"].items()
    ]
    return made


UNIT = Unit("NIKON CORPORATION", "NIKON D850", serial="6001234", lens="AF-S 50mm f/1.8G", aperture=5.6)


def passport(made: Document) -> Passport:
    return Passport(
        id="0123456789abcdef" * 2,
        issued=datetime(2026, 11, 22, 9, 30, tzinfo=UTC),
        begins=datetime(2026, 11, 23, tzinfo=UTC),
        ends=datetime(2027, 11, 23, tzinfo=UTC),
        unit=UNIT,
        captured="2026-11-03T12:04:00+01:00",
        chart_serial="CC-77",
        lamp_serials=("L-1",) * len(made["shots"]),
        software="0.1.0",
        result_sha256="5e" * 32,
        result=excerpt(made),
    )


def known(made: Document, *, verified: bool = True) -> Provenance:
    """A signed result, beside another one of the same unit."""
    other = document("A")
    other["channel_gain"] = [0.84, 1.0, 0.65]
    nudged = 0.98 * np.array(other["ssf"]["green"]) + 0.02 * np.roll(other["ssf"]["green"], 20)
    other["ssf"]["green"] = (nudged / nudged.max()).tolist()
    signature = Signature(passport(made), "K" * 43, verified)
    return Provenance(unit=Unit(focal_length=50.0), signature=signature, other=other, other_name="2025/result.json")


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
