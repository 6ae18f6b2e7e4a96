"""The cases of the stage `verdict`: captures in plain numbers, clean but for what is said.

Nothing is solved: the curves are those of a measured camera, the predictions are its signals, and the signals differ
from them as the case says.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from camssf.grid import WAVELENGTHS, Floats
from camssf.spectra.charts import faded
from golden.contract import Row
from golden.forms import NIKON, Json, camera, chart, lamp
from golden.scenes import PLACE, gain_modes

CAMERA, LAMPS = NIKON["camera"], ("D55", "A")
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
        level: of the white, as a fraction of a clean capture's, which is 76 % of the range.
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
    alone = {"ssf": NIKON, "predicted": y if exact else fitted} | code(2.0)
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
        "white": [[one] * 24 for one in white_levels],
        "dark": np.full(y.shape, BLACK),
        "shots": [frames | {"chart": statistics(one, span, last=used, **photo)} for one in y],
        "centres": [np.stack([100.0 * COLUMN, 100.0 * ROW], axis=1)] * k,
        "ssf": NIKON,
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


MINOR = 0.022
"""Glare as a fraction of white, of a case that it does not explain completely."""
SLIP = 1.19
"""Factor on one patch that makes it the best explanation while the goodness of fit stays acceptable."""
UNNAMED: Json = {"unnamed": True}


def rows() -> list[Row]:
    """All cases: inputs are the clean capture's with a change; status and codes of the reasons are expected."""
    y, framed, two, x = predicted(), predicted(white=18), predicted(k=2), PLACE[0][:, None]
    bowl = (1.0 - 0.2 * (x - 0.4) ** 2) / (1.0 - 0.2 * 1.4**2)
    slope = 1.0 + 0.3 * (COLUMN[:, None] / 5.0 - 0.5)
    black = (1 - y) * (16383.0 - BLACK) / (np.array(raw_white(1.0)) - BLACK)
    spoilt = np.stack([two[0], two[1] * np.array([1.2, 1.0, 0.85])])
    hole = np.where(PATCH[:, None] == 23, [0.0004, 0.0012, 0.0007], y)
    clean = capture(y)
    solved = {"gain_modes": [gain_modes()], "gain_own": 0.075}
    mode = {"lamp_modes": {"polynomials": [[[0.0, 0.05]]]}}
    uneven = np.sin(7.0 * PATCH[:, None])
    wave = (1 + 0.03 * np.sin(np.arange(24.0)))[:, None]
    glare = (1 - MINOR) * y * ripple(0.08) + MINOR
    table: list[tuple[str, str, Json, str]] = [
        ("clean", "Nothing is wrong.", clean, "accepted"),
        ("uneven-solved", "Light that gain modes describe.", capture(framed * bowl, white=18) | solved, "accepted"),
        ("uneven-beyond", "A shadow with an edge, which the gain modes cannot describe.",
         capture(framed * np.where(x > 0, 0.7, 1.0), white=18) | solved, "doubtful uneven_light"),
        ("two-shots", "Two clean shots: the chart's errors are the same in both.", capture(two), "accepted"),
        ("no-prior", "No band is no prior: a long code counts nothing.", clean | code(40.0) | band(None), "accepted"),
        ("modes", "Signals off by what the lamp's mode allows.", capture(y * wave) | mode, "accepted"),
        # the goodness of fit, and what explains a misfit
        ("veil", "3 % of white over the chart photo.", capture(0.97 * y + 0.03), "doubtful glare"),
        ("bright-dark", "3 % of white in the dark frame.", capture((y - 0.03) / 0.97), "doubtful frames_differ"),
        ("black-level", "No dark frame; the file's black level is too low by 0.5 % of the range.",
         capture(y + 0.005 * black, dark=False), "doubtful frames_differ"),
        ("black-level-far", "The same by 8 %: uneven light is not suspected.",
         capture(y + 0.08 * black, dark=False), "refused frames_differ glare"),
        ("veil-no-dark-slight", "No dark frame; 1.5 % of white: glare is likelier than a wrong black level.",
         capture(0.985 * y + 0.015, dark=False), "doubtful glare"),
        ("white-colour", "A white frame in another light: a factor for each channel.",
         capture(y * np.array([1.15, 1.0, 0.85])), "doubtful frames_differ"),
        ("light", "Light that falls off along the rows.", capture(y * slope), "doubtful uneven_light"),
        ("light-white-patch", "The same without a white frame: the level is free.",
         capture(framed * slope / slope[18], white=18), "doubtful uneven_light"),
        ("tone", "A tone curve, y^0.9.", capture(y**0.9), "doubtful not_sensor_raw"),
        ("patch", "One wrong patch is named.", capture(y * spike(13, 1.4)), "doubtful chart_unfit"),
        ("gloss", "Reflections, stronger on some patches.", capture(y + 0.02 * (1 + uneven)), "doubtful glare"),
        ("clipped-below", "Green saturates at 0.6 of the white, below the file's white level.",
         capture(np.minimum(y, [1.0, 0.6, 1.0])), "refused overexposed"),
        ("two-lights", "The light turns from red to blue along the rows.",
         capture(y * (1 + 0.12 * x * np.array([-1.0, 0.0, 1.0]))), "doubtful uneven_light"),
        ("no-single-cause", "All patches off, without a pattern.", capture(y * ripple(0.1)), "doubtful chart_unfit"),
        ("other-table", "Every patch is lighter or darker: the chart is hardly the table's.",
         capture(y * (1 + 0.2 * uneven)), "refused chart_unfit"),
        ("faded", "Four patches of a chart that lost a third of its colour.",
         capture(predicted(fading=0.3), used=4), "doubtful chart_unfit underexposed"),
        ("misfit-refuses", "χ² is above eight times the expected.", capture(y * ripple(0.12)), "refused chart_unfit"),
        ("second-of-two", "The second white frame is in another light.", capture(spoilt), "refused frames_differ"),
        ("contradiction", "Each of two shots fits alone, together they do not.",
         capture(two * np.array([1.12, 0.88])[:, None, None], exact=True), "doubtful chart_unfit"),
        ("minor-cause", "Glare that explains two fifths of the misfit.", capture(glare), "doubtful chart_unfit"),
        ("suspect", "One patch off, and the fit acceptable.", capture(y * spike(13, SLIP)), "doubtful chart_unfit"),
        ("no-suspect", "One patch less off: too little.", capture(y * spike(13, 1 + 0.8 * (SLIP - 1))), "accepted"),
        ("black-hole", "Signals below 0.001: a tone curve is flat there.", capture(hole), "doubtful chart_unfit"),
        ("three-patches", "Three patches suffice to test for causes.", capture(y, used=3), "doubtful underexposed"),
        ("two-patches", "Two patches are too few: no cause is tested.", capture(y, used=2), "doubtful underexposed"),
        ("noiseless", "Standard errors have a floor of 1e-4.", capture(y * spike(3, 1.02), error=0.1), "accepted"),
        # the prior
        ("outside-family", "Curves unlike those of a camera.", unknown(y, 22.0, 10), "doubtful camera_unusual"),
        ("outside-basis", "A code longer than a basis allows.", clean | code(300.0), "doubtful camera_unusual"),
        ("outside-family-no-more", "The same code; the signals determine twice as many directions of it.",
         unknown(y, 22.0, 20), "accepted"),
        ("rival", "Another lamp fits better.", clean | rivals((0, "FL2", -12), (0, "A", 4.1)), "doubtful lamp_unfit"),
        ("other-lamp-weak", "It fits a little less so.", clean | rivals((0, "A", 3.9), (0, "FL2", -2)), "accepted"),
        ("other-lamp-refuses", "Another lamp fits so much better that the named one is impossible.",
         clean | rivals((0, "FL2", -900), (0, "A", 14.1)), "refused lamp_unfit"),
        ("rival-beyond-numbers", "The exponential of the gain overflows; the probability does not.",
         clean | rivals((0, "FL2", 900), (0, "A", 1500)), "refused lamp_unfit"),
        ("rival-of-the-refused", "A refused capture is not compared with other lamps.",
         capture(0.7 * y + 0.3) | rivals((0, "A", 20)), "refused glare glare"),
        ("rival-of-two", "Another lamp fits one of two shots better: the shot is named.",
         capture(two) | rivals((0, "A", 1), (1, "D55", 13.9), (1, "FL2", 8)), "doubtful lamp_unfit"),
        ("tint", "The raw white is 23 % off the matrix's.", clean | tinted(1.23), "doubtful lamp_unfit"),
        ("tint-within", "It is 21 % off.", clean | tinted(1.21), "accepted"),
        ("tint-unnamed", "Unnamed light, and 48 %.", clean | tinted(1.48) | PHONE | UNNAMED, "accepted"),
        ("tint-unnamed-far", "Unnamed light, and 51 %.",
         clean | tinted(1.51) | PHONE | UNNAMED, "doubtful lamp_unfit"),
        ("tint-other-matrix", "One of two matrices is right.", clean | tinted(1.3, second=True), "accepted"),
        ("rival-and-tint", "A lamp that fits better, and the raw white differs, too.",
         clean | tinted(1.3) | rivals((0, "FL2", -12), (0, "A", 5)), "refused lamp_unfit lamp_unfit"),
        # another camera
        ("choice-other-maker", "The maker makes cameras; P(phone) = 0.91.",
         clean | chosen(0.91, 0.09, "cameras"), "doubtful camera_unusual"),
        ("choice-no-maker", "The same where the file names no maker.", clean | chosen(0.91, 0.09), "accepted"),
        ("choice-faded", "Only a faded chart explains the signals.",
         clean | FAMILY | test(-0.5, 0.1, 0.05) | {"chart_fading": 0.052}, "doubtful chart_unfit"),
        ("choice-unusual-length", "The code is longer than that of any clean phone.",
         clean | FAMILY | test(0.06, 0.1, 0.05), "doubtful camera_unusual"),
        ("choice-unusual-lamp", "The lamp residual is too large: another light than named, or another camera.",
         clean | FAMILY | test(-2.0, 0.81, 0.05), "doubtful camera_unusual"),
        ("choice-usual", "Length, lamp residual and fading are just below their limits.",
         clean | FAMILY | test(0.04, 0.79, 0.05) | {"chart_fading": 0.048}, "accepted"),
        ("choice-unusual-unnamed", "Unnamed light: there is no lamp residual, and the code is too long.",
         clean | FAMILY | test(0.31, None, 0.3) | UNNAMED, "doubtful camera_unusual"),
        # unnamed light
        ("unnamed-doubtful", "P(phone) = 0.76.", clean | chosen(0.76, 1 - 0.76) | UNNAMED, "doubtful lamp_unfit"),
        ("unnamed-refused", "P(phone) = 0.19.", clean | chosen(0.19, 1 - 0.19) | UNNAMED, "refused lamp_unfit"),
        ("unnamed-phones-maker", "P(phone) = 0.92, but 0.74 without the odds of the maker's name.",
         clean | chosen(0.92, 1 - 0.92, "phones") | UNNAMED, "doubtful lamp_unfit"),
        ("unnamed-cameras-maker", "P(phone) = 0.5, but 0.80 without the odds of the maker's name.",
         clean | chosen(0.5, 0.5, "cameras") | UNNAMED, "accepted"),
        ("band-ratio-one-light", "A band of ±0.090.", clean | band(0.046) | SURE | UNNAMED, "doubtful lamp_unfit"),
        ("band-ratio-typical", "A band of ±0.122: hardly better than a typical phone.",
         clean | band(0.062) | SURE | UNNAMED, "doubtful bands_too_wide lamp_unfit"),
        # another unit than in a previous result
        ("drift", "The blue curve has moved by 1 nm since the previous shot.",
         capture(drifted(1.0), exact=True, moved=1.0) | SURE, "doubtful unit_differs"),
        ("drift-slight", "The blue curve has moved by 0.5 nm since the previous shot.",
         capture(drifted(0.5), exact=True, moved=0.5) | SURE, "accepted"),
        ("drift-white-patch", "The blue curve has moved by 1.5 nm; no white frames, unnamed light.",
         capture(drifted(1.5, white=18), exact=True, moved=1.5, white=18) | SURE | UNNAMED, "doubtful unit_differs"),
        ("drift-by-white", "By the raw white alone 2 nm.", capture(two, exact=True, moved=2.0) | SURE, "accepted"),
        # statistics of the patches
        ("grain", "58 % of the noise that photons make.", capture(y, noise=0.58), "doubtful not_sensor_raw"),
        ("mixed", "A colour's noise follows others' photons by a tenth.", processed(0.1), "doubtful not_sensor_raw"),
        ("mixed-unsure", "The same, by so few samples that it is not sure.", processed(0.1, 60), "accepted"),
        ("mixed-unknown", "By fewer it is not judged, and the samples were smoothed.",
         processed(0.1, 25, like=(0.13, 0.01)), "doubtful not_sensor_raw"),
        ("demosaiced", "Unlike neighbours share noise.", processed(unlike=(-0.05, 0.005)), "doubtful not_sensor_raw"),
        ("demosaiced-unsure", "The same with few pairs: not sure.", processed(unlike=(-0.05, 0.015)), "accepted"),
        ("texture", "Patches that vary inside.", capture(y, texture=0.04), "doubtful blurred"),
        ("greens", "The two greens differ.", capture(y, greens=1.065), "doubtful not_sensor_raw"),
        ("dirt", "6.5 % of one patch's samples are outliers.", capture(y, dead=(4, 0.065)), "doubtful chart_unfit"),
        ("dim", "A white at 9.8 % of the range.", capture(y, level=0.129), "doubtful underexposed"),
        ("haze", "10 % of white: the misfit refuses.", capture(0.9 * y + 0.1), "refused glare glare"),
        ("few", "Eleven patches, the others clipped.", capture(y, used=11, clipped=0.5), "doubtful overexposed"),
        ("few-dark", "Eleven patches, the others lost in noise.", capture(y, used=11), "doubtful underexposed"),
        ("pose", "The answer explains the signals, but they are hardly the chart's colours.",
         capture(0.7 * y + 0.3 * y[::-1], exact=True), "doubtful chart_unfit"),
        ("band-too-wide", "A band of ±0.122 of the peak.", clean | band(0.062), "doubtful bands_too_wide"),
        ("mixed-uneven", "Two patches are dusty; green has too few samples to be judged, blue just enough.",
         noisy(1.0 + 0.1 * uneven + 1.5 * np.isin(PATCH, (3, 10))[:, None], (20_000, 4, 6)),
         "accepted"),
        ("mixed-quiet", "Rounding hides the noise of half of the patches: red is judged, green is not.",
         noisy(np.array([3.2e-5, 3.7e-5, 2.8e-4]), 20_000, 1.0 / 12.0), "doubtful not_sensor_raw not_sensor_raw"),
    ]  # fmt: skip
    return [(name, comment, inputs | {"outputs": judged(outcome)}) for name, comment, inputs, outcome in table]


def judged(outcome: str) -> Json:
    """The outputs of a case that its row states."""
    status, *codes = outcome.split()
    return {"status": status, "codes": codes}


def noisy(factor: Floats, count: ArrayLike, rounding: float = 0.0) -> Json:
    """A photo whose colours were mixed by a tenth; its samples' variances (24, 3) times a factor, DN²."""
    made, counts = processed(0.1), np.broadcast_to(count, (24, 3))
    (shot,) = made["shots"]
    variance = COUNT * shot["chart"]["standard_error"] ** 2 * factor + rounding
    chart = shot["chart"] | {"count": counts, "standard_error": np.round(np.sqrt(variance / counts), 9)}
    return made | {"shots": [shot | {"chart": chart}]}
