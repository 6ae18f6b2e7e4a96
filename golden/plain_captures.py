"""Captures in plain numbers, as a case of the stage `verdict` gives them, clean but for what is said.

Nothing is solved: the curves are those of a measured camera, the predictions are its signals, and the signals differ
from them as the case says.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from camssf.grid import WAVELENGTHS, Floats
from camssf.spectra.charts import faded
from golden.forms import Json, camera, chart, lamp

CAMERA, LAMPS = "Nikon D5100", ("D55", "A")
BLACK, SPAN, WELL, COUNT = 512.0, 12000.0, 8000.0, 400
"""Black level and range of the white, DN; electrons at full range; number of samples in a patch."""
PATCH = np.arange(24)
COLUMN, ROW = PATCH % 6, PATCH // 6


def capture(
    signals: Floats,
    *,
    white: int | None = None,
    dark: bool = True,
    level: float = 1.0,
    used: int = 24,
    error: float = 1.0,
    exact: bool = False,
    moved: float | None = None,
    **photo: Any,
) -> Json:
    """The inputs of `judge` for a capture that is clean but for what is said.

    Args:
        signals: (24, 3) of one shot, (2, 24, 3) of two.
        white: the patch in place of the white frames; None if there are white frames.
        dark: whether there are dark frames.
        level: of the white, as a fraction of a clean capture's.
        used: how many patches are used, the first ones.
        error: factor of the signals' standard errors.
        exact: the solution of each shot alone, or of a single shot, predicts its signals exactly.
        moved: by how many nm the raw white says the blue curve has moved since the first shot, a previous result's.
        photo: what is unusual about the chart photo (`statistics`).
    """
    y, patch = np.round(signals.reshape(-1, 24, 3), 7), white is not None
    k, span = len(y), level * SPAN
    fitted = y if exact and k == 1 else predicted(k, white).reshape(y.shape)
    white_levels = [[BLACK + span] * 3 if dark else raw_white(level)] * k
    if moved is not None:
        white_levels = [raw_white(level, name, nm) for name, nm in zip(LAMPS, (moved, 0.0), strict=True)]
    frames = {
        "white": None if patch else statistics(np.ones((24, 3)), span),
        "dark": statistics(np.zeros((24, 3)), span) if dark else None,
        "black": [BLACK] * 3,
        "saturation": 16383.0,
    }
    rho = {"chart": "babelcolor", "patches": [white + 1]} if white is not None else {"constant": 1.0, "shape": [681]}
    alone = {"ssf": {"camera": CAMERA}, "predicted": y if exact else fitted} | code(2.0)
    return {
        "reflectance": {"chart": "babelcolor", "patches": list(range(1, 25))},
        "chart_tolerance": {"constant": 0.03, "shape": [24]},
        "white_reflectance": rho,
        "white_tolerance": 0.03 if patch else 0.01,
        "lamp": {"lamps": LAMPS[:k]},
        "lamp_tolerance": [0.02] * k,
        "lamp_modes": {"polynomials": [[]] * k},
        "signals": y,
        "standard_error": np.round(error * (0.002 * y + 1e-4), 9),
        "used": [[i < used and i != white for i in range(24)]] * k,
        "white_is_patch": [patch] * k,
        "white": [[one] * 24 for one in white_levels],
        "dark": np.full(y.shape, BLACK),
        "shots": [frames | {"chart": statistics(one, span, last=used, **photo)} for one in y],
        "centres": [np.stack([100.0 * COLUMN, 100.0 * ROW], axis=1)] * k,
        "ssf": {"camera": CAMERA},
        "predicted": fitted,
        "alone": [alone] * k if k > 1 else [],
        "rivals": [],
        "neutrals": [[]] * k,
        "basis": "cameras",
    } | code(2.0) | band(0.02) | ({} if moved is None else {"new": 1})  # fmt: skip


def statistics(
    y: Floats,
    span: float,
    *,
    noise: float = 1.0,
    texture: float = 0.0,
    greens: float = 1.0,
    dead: tuple[int, float] = (0, 0.0),
    clipped: float = 0.0,
    last: int = 24,
    mixed: float = 0.0,
    count: int = COUNT,
) -> Json:
    """Statistics of signals (24, 3): V = noise² (span² (x / WELL + 9 / WELL²) + (texture span y)²).

    x = y + mixed o, with o the mean of the other colours' y. greens: factor between the two; dead: a patch and a
    share of its samples; clipped: of patches after the `last`; count: of samples in a patch.
    """
    others = (y.sum(axis=1, keepdims=True) - y) / 2.0
    variance = span**2 * (np.maximum(y + mixed * others, 0.0) / WELL + 9.0 / WELL**2)
    mean, patch = np.round(BLACK + span * y, 6), np.repeat(PATCH[:, None], 3, axis=1)
    return {
        "mean": mean,
        "standard_error": np.round(noise * np.sqrt((variance + (texture * span * y) ** 2) / count), 9),
        "count": np.full(mean.shape, count),
        "clipped": np.where(patch >= last, clipped, 0.0),
        "dead": np.where(patch == dead[0], dead[1], 0.0),
        "greens": mean[:, [1]] * [1.0, greens],
    }


def processed(
    mixed: float = 0.0,
    count: int = COUNT,
    *,
    unlike: Sequence[float] | None = None,
    like: Sequence[float] | None = None,
) -> Json:
    """A clean capture but for its samples' noise.

    mixed: share of the other colours' photons in it; count: of samples in a patch; unlike, like: correlation of the
    noise of neighbours of other colours and of the same, each with its standard error.
    """
    made = capture(predicted(), mixed=mixed, count=count)
    noise = {"step": 1.0, "unlike": unlike, "like": like}
    return made | {"shots": [shot | {"noise": noise} for shot in made["shots"]]}


def predicted(k: int = 1, white: int | None = None, fading: float = 0.0) -> Floats:
    """(24, 3) or (k, 24, 3) signals by the integrals of Eq. (5), to seven decimals; fading: of the chart."""
    R, s = faded(chart("babelcolor"), fading), camera(CAMERA)
    rho = np.ones(R.shape[1]) if white is None else R[white]
    y = np.stack([((R * lamp(name)) @ s) / ((rho * lamp(name)) @ s) for name in LAMPS[:k]])
    return np.round(y if k > 1 else y[0], 7)


def moved_curves(nm: float) -> Floats:
    """(681, 3) curves of CAMERA with the blue one by so many nm farther to the red."""
    curves = camera(CAMERA).copy()
    curves[:, 2] = np.interp(WAVELENGTHS - nm, WAVELENGTHS, curves[:, 2])
    return curves


def drifted(nm: float, white: int | None = None) -> Floats:
    """(2, 24, 3) signals of two shots; in the first the blue curve has moved."""
    y, R = predicted(2, white), chart("babelcolor")
    light = lamp(LAMPS[0]) * moved_curves(nm)[:, 2]
    y[0, :, 2] = np.round(R @ light / ((1.0 if white is None else R[white]) * light).sum(), 7)
    return y


def ripple(size: float) -> Floats:
    """(24, 3): a pattern over all patches, different in each channel, that no explanation fits."""
    return np.asarray(1.0 + size * np.sin(7.0 * np.arange(24.0)[:, None] + 2.0 * np.arange(3.0)))


def spike(i: int, factor: float) -> Floats:
    """(24, 1): a factor on one patch."""
    return np.where(PATCH[:, None] == i, factor, 1.0)


def code(square: float) -> Json:
    """A code with this xᵀ x, all in one entry."""
    return {"code": [[float(np.sqrt(square)), 0.0, 0.0], *([0.0] * 3 for _ in range(23))]}


def unknown(y: Floats, square: float, known: int) -> Json:
    """A capture on no known basis: so many directions of the code have a variance of 0.1, all others of 0.99."""
    return capture(y) | code(square) | {"code_variance": [0.1] * known + [0.99] * (72 - known), "basis": None}


def band(std: float | None) -> Json:
    """A standard deviation of the curves, the same fraction of the peak everywhere."""
    peaks = camera(CAMERA).max(axis=0)
    return {"ssf_std": std and {"bells": [[[float(std * peak), 550.0, 1e9]] for peak in peaks]}}


def rivals(*of: tuple[int, str, float]) -> Json:
    """Other lamps: shot, lamp, gain in ln of the likelihood."""
    return {"rivals": [[shot, name, float(gain)] for shot, name, gain in of]}


def chosen(phones: float, cameras: float, maker: str | None = None) -> Json:
    """P(phone) and P(camera), and the basis that the maker's name speaks for; a chosen basis stands in `choice`."""
    return {"choice": [["phones", phones], ["cameras", cameras]], "family": maker, "basis": None}


FAMILY = chosen(0.99, 0.01, "phones")
SURE: Json = {"choice": [["phones", 1.0]], "family": None, "basis": None}
PHONE: Json = SURE | {"family": "phones"}


def test(length: float, residual: float | None, longest: float) -> Json:
    """The family test: length of the code, lamp residual, limits of both."""
    return {"family_test": [length, residual, longest, 0.8]}


def tinted(tint: float, second: bool = False) -> Json:
    """Raw whites, and the whites of one matrix, off by a factor of red, or of two, of which the second is right."""
    whites = []
    for light, factor in [("D55", tint), ("A", 1.0)][: 2 if second else 1]:
        seen = lamp(light) @ camera(CAMERA) * np.array([factor, 1.0, 1.0])
        whites.append([{"lamps": [light]}, np.round(seen / seen[1], 9)])
    return {"white": [[raw_white(1.0)] * 24], "neutrals": [whites]}


def raw_white(level: float, name: str = LAMPS[0], nm: float = 0.0) -> list[float]:
    """(3,) level of the white under a lamp in each channel, DN, with the blue curve moved by nm to the red."""
    seen = lamp(name) @ moved_curves(nm)
    levels: list[float] = np.round(BLACK + level * SPAN * seen / seen.max(), 6).tolist()
    return levels
