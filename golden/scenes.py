"""Defines the cases before they are solved, one behaviour each.

A scene simulates photos of a chart by a formula: white frame 12,000 DN times the channel's gain times a fall-off over
the patches, dark frame about 64 DN, noise by a sine of the square of the sample's number (no random generator). The
DN are rounded to 1/1000 and stored; the rounded numbers are the inputs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from camssf.grid import Floats
from camssf.recovery.layers import DEPTH
from golden.reading import Json, resolve

NOISES = {"none": (0.0, 0.0), "low": (0.001, 0.0002), "usual": (0.005, 0.001)}
"""σ = hypot(first · y, second)."""
GAINS = (0.55, 1.0, 0.7)
ALL = list(range(1, 25))
TWELVE = list(range(7, 19))
FAMILY = [[[0.0, 0.15], [0.0], [0.0]], [[0.0, 0.5], [0.0, 0.0, 0.6], [0.0, -0.3, 0.0, 0.5]]]
"""Modes of two uncertain lamps, a daylight and a white LED, as polynomials."""
FAR = [
    [[0.0, 1.5], [0.0, 0.0, 1.0], [0.0, 0.5, 0.0, -1.0]],
    [[0.0, 5.0], [0.0, 0.0, 6.0], [0.0, -3.0, 0.0, 5.0]],
]
"""Modes so large that the lamp is practically unknown."""
EIGHTEEN = list(range(1, 19))
NINE = [1, 3, 6, 9, 12, 15, 16, 18, 20]
NIKON, CANON = {"camera": "Nikon D5100"}, {"camera": "Canon EOS 5D Mark II"}
BELLS = {
    "bells": [[[1.0, 604, 31], [0.07, 442, 24]], [[1.0, 534, 37]], [[1.0, 459, 26], [0.03, 545, 30]]],
}  # fmt: skip
PHONE = {
    "bells": [
        [[0.66, 623.6, 26.9], [0.639, 595.5, 11.9], [0.102, 524.3, 22.6]],
        [[0.915, 548.8, 38.8], [0.291, 514.9, 15.6], [0.265, 495.1, 11.1]],
        [[0.92, 474.9, 30.0], [0.319, 434.2, 16.3], [0.115, 541.1, 62.1]],
    ],
}  # fmt: skip
"""Near the mean of the phones."""
BETWEEN = {
    "bells": [
        [[0.636, 595.0, 12.8], [0.559, 624.3, 25.9], [0.103, 557.6, 77.1]],
        [[0.688, 553.9, 31.1], [0.518, 507.9, 22.9], [0.155, 529.3, 65.9]],
        [[0.915, 472.8, 29.0], [0.36, 435.5, 15.4], [0.101, 533.1, 56.1]],
    ],
}  # fmt: skip
"""Half-way from PHONE to the mean of the cameras."""
ODD = {"bells": [[[1.0, 632, 18]], [[1.0, 560, 22]], [[1.0, 440, 18]]]}
"""Narrow filters far from each other, unlike any camera."""
FLAT = {"constant": 1.0, "shape": [681]}
Case = Json


def cases() -> Iterator[Case]:
    """All cases: name, comment, expect, inputs, and for some truth, bounds and what must not be compared."""
    yield from _signal_cases()
    yield from _sensing_cases()
    yield from _weights_cases()
    yield from _solve_cases()
    yield from _ssf_cameras()
    yield from _ssf_phones()
    yield from _ssf_uneven()
    yield from _ssf_gaussian()
    yield from _ssf_errors()
    yield from _layers_cases()
    yield from _choice_cases()
    yield from _calibrate_cases()
    yield from _light_cases()
    yield from _rivals_cases()


def case(name: str, comment: str, inputs: Json, *, expect: str = "success", **more: Any) -> Case:
    """A case with its options for the generator: truth, rmse (its bound), generic (code and pivots comparable)."""
    return {
        "case": name,
        "comment": comment,
        "inputs": inputs,
        "expect": expect,
        "truth": None,
        "generic": True,
    } | more


# -- photographs --------------------------------------------------------------------------------------------------


def photograph(
    camera: Json, lamps: Sequence[str], reflectance: Any, *, noise: str = "low", white: Any = FLAT, shade: float = 0.3
) -> dict[str, Floats]:
    """Chart, white and dark frame (k, n, 3) in DN, and the standard error of the signals."""
    R, s = resolve(reflectance), resolve(camera)
    L, rho = resolve({"lamps": list(lamps)}), resolve(white)
    y = np.stack([((R * lamp) @ s) / ((rho * lamp) @ s) for lamp in L])
    k, n, _ = y.shape
    j, i, c = np.meshgrid(np.arange(k), np.arange(n), np.arange(3), indexing="ij")
    dark = 64.0 + 0.25 * ((5 * i + 3 * c + j) % 4)
    fall = 1.0 - shade * ((7 * i) % 24) / 24.0
    frame = np.round(dark + 12_000.0 * np.array(GAINS) * fall, 3)
    part, least = NOISES[noise]
    sigma = np.hypot(part * y, least)
    number = ((j * n + i) * 3 + c + 1).astype(float)
    e = sigma * np.sqrt(2.0) * np.sin(12.9898 * number**2)
    return {
        "chart": np.round(dark + (y + e) * (frame - dark), 3),
        "white": frame,
        "dark": dark,
        "standard_error": np.round(sigma, 6),
    }


def scene(
    name: str,
    comment: str,
    *,
    camera: Json = NIKON,
    lamps: Sequence[str] = ("D55",),
    patches: Any = ALL,
    table: str = "babelcolor",
    taken: str | None = None,
    noise: str = "low",
    basis: str = "cameras",
    l2: float | None = None,
    gamma: float | None = None,
    nonnegative: bool | None = None,
    chart_tolerance: ArrayLike = 0.03,
    white_tolerance: float = 0.01,
    lamp_tolerance: ArrayLike = 0.0,
    modes: list[Any] | None = None,
    white: Any = FLAT,
    rmse: float | None = None,
    change: Json | None = None,
    expect: str = "success",
    stage: str = "ssf",
    **more: Any,
) -> Case:
    """A case of the stage ssf, or of another stage with the same inputs.

    taken: the table of the chart that was photographed, if it differs from `table`.
    """
    known = (
        {"chart": table, "mixtures": patches} if isinstance(patches, int) else {"chart": table, "patches": patches}
    )
    photo = photograph(camera, lamps, known | {"chart": taken or table}, noise=noise, white=white)
    k, n, _ = photo["chart"].shape
    learned = basis != "gaussian"
    inputs: Json = {
        "basis": basis,
        **photo,
        "reflectance": known,
        "chart_tolerance": {"constant": chart_tolerance, "shape": [n]},
        "white_reflectance": white,
        "white_tolerance": white_tolerance,
        "lamp": {"lamps": list(lamps)},
        "lamp_tolerance": {"constant": lamp_tolerance, "shape": [k]},
        "lamp_modes": {"polynomials": modes or [[] for _ in lamps]},
        "l2": (1.0 if learned else 0.0) if l2 is None else l2,
        "gamma": (0.05 if learned else 1e-3) if gamma is None else gamma,
        "nonnegative": (not learned) if nonnegative is None else nonnegative,
    } | (change or {})
    truth = camera if rmse is not None else None
    return case(f"{stage}/{name}", comment, inputs, expect=expect, truth=truth, rmse=rmse, **more)


# -- stage ssf ------------------------------------------------------------------------------------------------------


def _ssf_cameras() -> Iterator[Case]:
    known = "the truth is one of the cameras that the basis was learned from"
    makers = [
        ("arri", "ARRI D21", ["D55"], ALL, 0.10),
        ("insta360", "Arashi Vision Insta360 X5", ["A"], ALL, 0.05),
        ("canon", "Canon EOS 5D Mark II", ["LED-B3"], EIGHTEEN, 0.04),
        ("fujifilm", "Fujifilm X-T3", ["FL2"], TWELVE, 0.08),
        ("hasselblad", "Hasselblad L1D-20c", ["D55", "A"], ALL, 0.05),
        ("nikon", "Nikon D5100", ["D55", "A", "LED-B3"], ALL, 0.03),
        ("panasonic", "Panasonic DC-GX9", ["D55"], NINE, 0.06),
        ("sony", "Sony ILCE-7M3", ["FL2", "D55"], ALL, 0.04),
    ]
    for name, camera, lamps, patches, bound in makers:
        yield scene(
            f"cameras-{name}",
            f"{camera} under {' + '.join(lamps)}, {len(patches)} patches, full covariance, λ₂ = 1; {known}.",
            camera={"camera": camera}, lamps=lamps, patches=patches, rmse=bound,
        )  # fmt: skip
    yield scene(
        "cameras-sony-compact", f"A compact camera, two lamps, usual noise; {known}.",
        camera={"camera": "Sony DSC-RX100M4"}, lamps=["D55", "A"], noise="usual", rmse=0.06,
    )  # fmt: skip
    yield scene(
        "cameras-mixtures", "96 patches that are convex mixtures of the measured 24: more rows, no more evidence.",
        camera={"camera": "Canon EOS R5"}, patches=96, rmse=0.04,
    )  # fmt: skip
    yield scene(
        "cameras-bells", "A camera of Gaussian bells, which is in nobody's list; three shots.",
        camera=BELLS, lamps=["D55", "A", "FL2"], rmse=0.06,
    )  # fmt: skip
    for share, lamps in (("one-lamp", ["D55"]), ("two-lamps", ["D55", "A"])):
        yield scene(
            f"cameras-foreign-table-{share}",
            "The chart photographed is Ohta's, the table known BabelColor's: lamps share the chart's error.",
            camera={"camera": "Nikon Z f"}, lamps=lamps, taken="ohta", rmse=0.10,
        )  # fmt: skip
    off: Json = {"chart_tolerance": 0.0, "white_tolerance": 0.0}
    yield scene(
        "cameras-diagonal",
        "All tolerances zero: Σ is the diagonal of the measured errors, and the drift of the light.",
        **off,
        rmse=0.03,
    )
    yield scene(
        "cameras-floor", "Neither noise nor tolerances: Σ is the floor of 1e-4 and the drift, the worst conditioned.",
        noise="none", patches=TWELVE, **off, rmse=0.03,
    )  # fmt: skip
    yield scene(
        "cameras-l1-only", "λ₂ = 0, γ = 1.4: the l1 penalty alone, a sparse code.", l2=0.0, gamma=1.4, rmse=0.05,
    )  # fmt: skip
    yield scene(
        "cameras-l1-tiny",
        "λ₂ = 0, γ = 0.001, about 1e-5 of the γ that leaves nothing.",
        l2=0.0,
        gamma=1e-3,
        lamps=["D55", "A"],
    )
    yield scene("cameras-gamma-half", "λ₂ = 1, γ = 0.5: ten times the default.", gamma=0.5, rmse=0.05)
    yield scene("cameras-gamma-two", "λ₂ = 1, γ = 2 under A, 12 patches.", gamma=2.0, lamps=["A"], patches=TWELVE)
    yield scene(
        "cameras-posterior-mean", "λ₂ = 1, γ = 0: the Gaussian posterior mean in closed form.", gamma=0.0, rmse=0.04,
    )  # fmt: skip
    yield scene(
        "cameras-zero-code", "γ = 1e9 leaves no code at all: the answer is the mean of the basis, with gap 0.",
        gamma=1e9,
    )  # fmt: skip
    yield scene("cameras-nonnegative", "Non-negative codes on the learned basis.", nonnegative=True, gamma=0.5)
    yield scene(
        "cameras-nonnegative-closed", "γ = 0 and non-negative codes: NNLS with a ridge.", nonnegative=True, gamma=0.0,
    )  # fmt: skip
    yield scene(
        "cameras-identical-patches", "Six times one patch, six times another: rank two, the prior fills the rest.",
        patches=[19] * 6 + [15] * 6,
    )  # fmt: skip
    yield scene("cameras-one-patch", "One patch, one row a channel.", patches=[15])
    yield scene(
        "cameras-lamp-tolerance", "Both lamps may be off by 2 % (smooth).", lamps=["D55", "A"],
        lamp_tolerance=0.02, rmse=0.06,
    )  # fmt: skip
    yield scene(
        "cameras-lamp-modes", "Two modes of each lamp, a tilt and a bow; one shot has only the first.",
        lamps=["D55", "A"], modes=[[[0.0, 0.08], [0.0, 0.0, 0.05]], [[0.0, 0.12], [0.0]]], lamp_tolerance=0.01,
        rmse=0.06,
    )  # fmt: skip
    yield scene(
        "cameras-lamp-family", "D55 and LED-B3, told as flat lamps that may be far off: a second look.",
        lamps=["D55", "LED-B3"], modes=FAMILY, lamp_tolerance=0.05, rmse=0.07,
        change={"lamp": {"lamps": ["equal-energy"] * 2}},
    )  # fmt: skip
    yield scene(
        "cameras-lamp-far", "Modes ten times as large, no noise, no tolerance of the chart: the first look's "
        "matrices have a condition of 1e12 and more, and an explicit inverse in it was 1e-8 of the answer off.",
        lamps=["D55", "LED-B3"], modes=FAR, lamp_tolerance=0.3, noise="none", chart_tolerance=0.0,
        change={"lamp": {"lamps": ["equal-energy"] * 2}},
    )  # fmt: skip
    yield scene(
        "cameras-lamp-one-of-two", "A lamp known and one that is not: only the second takes ŷ for y in its rows.",
        lamps=["D55", "LED-B3"], modes=[[[0.0]] * 3, FAMILY[1]], lamp_tolerance=0.05, rmse=0.07,
        change={"lamp": {"lamps": ["D55", "equal-energy"]}},
    )  # fmt: skip
    white = {"polynomials": [[[0.9, -0.02, 0.01]]]}
    yield scene(
        "cameras-grey-white", "The white frame shows a card of 90 %, slightly bent over wavelength.",
        white=resolve(white)[0, 0].round(6), rmse=0.04,
    )  # fmt: skip
    two = photograph(NIKON, ["D55", "A"], {"chart": "babelcolor", "patches": ALL})
    chart, error = two["chart"].copy(), two["standard_error"].copy()
    chart[1, 18], error[1, 18] = 16_383.0, 1e3
    yield scene(
        "cameras-hidden-patch", "The white patch is clipped in the second shot: a standard error of 1e3 hides it.",
        lamps=["D55", "A"], change={"chart": chart, "standard_error": error}, rmse=0.04,
    )  # fmt: skip
    one = photograph(NIKON, ["D55"], {"chart": "babelcolor", "patches": ALL})
    yield scene(
        "cameras-zero-signal", "Chart equal to dark: every signal is 0, which no camera gives; finite all the same.",
        change={"chart": one["dark"]},
    )  # fmt: skip
    yield scene(
        "cameras-lamp-scale", "The lamp in other units (× 1000): nothing changes but the scale of the curves.",
        change={"lamp": 1000.0 * np.round(resolve({"lamps": ["D55"]}), 3)}, rmse=0.04,
    )  # fmt: skip


def _ssf_phones() -> Iterator[Case]:
    phone: Json = {"basis": "phones", "camera": PHONE}
    yield scene(
        "phones-bells", "A phone of Gaussian bells, which is in nobody's list; two lamps, the product's penalties.",
        lamps=["D55", "A"], rmse=0.06, **phone,
    )  # fmt: skip
    yield scene("phones-l1-only", "λ₂ = 0, γ = 1.4: the l1 penalty alone.", l2=0.0, gamma=1.4, **phone)
    yield scene(
        "phones-nonnegative-closed", "γ = 0 and non-negative codes.", patches=TWELVE, nonnegative=True, gamma=0.0,
        **phone,
    )  # fmt: skip
    for basis, camera in (("phones", PHONE), ("cameras", NIKON)):
        yield scene(
            f"{basis}-wide", "The prior twice as wide: s = μ + 2 Ψ x, in rows, evidence, bands and curves.",
            basis=basis, camera=camera, patches=TWELVE, change={"prior_scale": 2.0},
        )  # fmt: skip


def _light(bend: float = 1.0) -> Floats:
    """Uneven light (24,) on the patches, a quadratic times a plane, 1 on the white patch."""
    i = np.arange(24)
    x, y = (i % 6 - 2.5) / 2.5, (i // 6 - 1.5) / 2.5
    light = (1.0 - bend * (0.12 * (x - 0.3) ** 2 + 0.12 * (y + 0.2) ** 2)) * (1.0 + 0.07 * bend * x)
    return np.asarray(np.round(light / light[18], 9))


def _gain_modes(shots: int) -> list[Any]:
    """(k, 6, 24) linear and quadratic modes and one of the white patch, all minus their value on the white patch."""
    i = np.arange(24)
    x, y = (i % 6 - 2.5) / 2.5, (i // 6 - 1.5) / 2.5
    ways = np.stack([0.2 * x, 0.2 * y, 0.3 * x**2, 0.3 * x * y, 0.3 * y**2, -0.05 * (i == 18)])
    each: list[Any] = np.round(ways - ways[:, [18]], 9).tolist()
    return [each] * shots


def _ssf_uneven() -> Iterator[Case]:
    """Cases of uneven light on the chart, with gain modes that can describe it."""

    def uneven(name: str, comment: str, lamps: list[str], modes: list[Any], own: float, **more: Any) -> Case:
        camera = more.get("camera", NIKON)
        photo = photograph(camera, lamps, {"chart": "babelcolor", "patches": ALL})
        lit = np.round(photo["dark"] + _light()[:, None] * (photo["chart"] - photo["dark"]), 3)
        change = {"chart": lit, "gain_modes": modes, "gain_own": own} | more.pop("change", {})
        return scene(name, comment, lamps=lamps, change=change, **more)

    phone: Json = {"basis": "phones", "camera": PHONE}
    yield uneven("phones-uneven", "A plane and a bowl of light over the chart, solved for with the curves.", ["D55"],
                 _gain_modes(1), 0.075, rmse=0.05, **phone)  # fmt: skip
    yield uneven("cameras-uneven-two", "Two shots: about the curves and the gains of a first look.", ["D55", "A"],
                 _gain_modes(2), 0.075, rmse=0.05)  # fmt: skip
    yield uneven("phones-uneven-kind", "A lamp told by its kind, and uneven light: modes of both beside each other.",
                 ["LED-B3"], _gain_modes(1), 0.075, rmse=0.08,
                 change={"lamp": {"lamps": ["white-led"]}, "lamp_modes": {"modes": ["white-led"]},
                         "lamp_tolerance": [0.17]}, **phone)  # fmt: skip
    each = np.concatenate([0.08 * np.delete(np.eye(24), 18, axis=0), 0.08 * (np.arange(24) != 18)[None]])
    yield uneven("phones-uneven-each", "Every patch by itself: a mode each, and one of the white's own.", ["D55"],
                 [each.tolist()], 0.0, rmse=0.08, **phone)  # fmt: skip
    yield uneven("error-gain-modes", "Gain modes of 23 patches for 24.", ["D55"],
                 [np.zeros((1, 23)).tolist()], 0.0, expect="invalid_argument")  # fmt: skip
    yield uneven("error-gain-own", "A negative share of its own.", ["D55"], _gain_modes(1), -0.1,
                 expect="invalid_argument")  # fmt: skip


def _ssf_gaussian() -> Iterator[Case]:
    plain: Json = {"basis": "gaussian", "chart_tolerance": 0.0, "white_tolerance": 0.0}
    unit = {"standard_error": {"constant": 1.0, "shape": None}}
    wide: list[tuple[str, str, list[str], Any, float, float, bool, str]] = [
        ("paper", "Nikon D5100", ["D55"], TWELVE, 1e-5, 0.08, True, "the paper's Eq. (10), x ≥ 0, 12 patches"),
        ("paper-signed", "Nikon D5100", ["D55"], TWELVE, 1e-4, 0.10, False, "the paper's literal Eq. (10)"),
        ("nine", "Canon EOS R5", ["LED-B3"], NINE, 1e-5, 0.12, True, "9 patches"),
        ("eighteen", "Fujifilm X-T3", ["A"], EIGHTEEN, 1e-4, 0.10, True, "18 patches"),
        ("twenty-four", "Sony ILCE-7M3", ["FL2"], ALL, 1e-4, 0.15, True, "24 patches"),
        ("mixtures", "Panasonic DC-GX9", ["D55"], 96, 1e-3, 0.10, True, "96 mixtures"),
        ("gamma-large", "Hasselblad L1D-20c", ["A"], ALL, 1e-2, 0.28, True, "a large γ"),
    ]
    for name, camera, lamps, patches, gamma, bound, nonnegative, what in wide:
        n = patches if isinstance(patches, int) else len(patches)
        ones = {"standard_error": unit["standard_error"] | {"shape": [1, n, 3]}}
        yield scene(
            f"gaussian-{name}", f"Σ = I: {what}; {camera} under {lamps[0]}.", camera={"camera": camera}, lamps=lamps,
            patches=patches, gamma=gamma, nonnegative=nonnegative, rmse=bound, change=ones, **plain,
        )  # fmt: skip
    yield scene(
        "gaussian-measured-errors", "Σ from the measured standard errors and a chart tolerance of 1 %.",
        basis="gaussian", gamma=1.0, noise="usual", chart_tolerance=0.01,
    )  # fmt: skip
    yield scene(
        "gaussian-tiny-gamma", "γ = 1 with measured errors, about 1e-5 of what leaves nothing.",
        gamma=1.0, noise="usual", **plain,
    )  # fmt: skip
    yield scene("gaussian-ridge", "λ₂ = 1 and γ = 0.05, measured errors.", l2=1.0, gamma=0.05, **plain)
    yield scene(
        "gaussian-ridge-signed", "λ₂ = 0.01, γ = 0, signed: the closed form.", l2=0.01, gamma=0.0, nonnegative=False,
        **plain,
    )  # fmt: skip
    yield scene("gaussian-ridge-nonnegative", "λ₂ = 0.01, γ = 0, x ≥ 0.", l2=0.01, gamma=0.0, patches=TWELVE, **plain)
    yield scene(
        "gaussian-identical-patches", "Twelve times the same patch: rank one.",
        patches=[15] * 12, gamma=0.1, **plain,
    )  # fmt: skip
    yield scene(
        "gaussian-two-patches", "Six times one patch, six times another, and no prior: rank two.",
        patches=[19] * 6 + [15] * 6, gamma=0.1, **plain,
    )  # fmt: skip
    yield scene(
        "gaussian-three-patches", "Three patches, 18 atoms: the layers' support has more atoms than there are rows, "
        "the walk from it keeps few digits, and only a second one, from where it ended, is proven.",
        patches=[8, 11, 16], gamma=85.0, noise="none", **plain,
    )  # fmt: skip
    yield scene(
        "gaussian-equal-energy", "The paper's assumption of a flat lamp, true here.", lamps=["equal-energy"],
        patches=TWELVE, gamma=1e-5, noise="none", change={"standard_error": {"constant": 1.0, "shape": [1, 12, 3]}},
        rmse=0.08, **plain,
    )  # fmt: skip


def _ssf_errors() -> Iterator[Case]:
    yield scene(
        "error-zero-code-gaussian", "γ = 1e6 leaves nothing of the paper's curves.", basis="gaussian", gamma=1e6,
        expect="not_converged",
    )  # fmt: skip
    yield scene(
        "error-wide-gaussian", "A wider prior of a basis that has none.", basis="gaussian",
        change={"prior_scale": 2.0}, expect="invalid_argument",
    )  # fmt: skip
    for name, scale in (("zero", 0.0), ("nan", "NaN")):
        yield scene(
            f"error-{name}-prior-scale", "A prior's width that is no positive number.", patches=TWELVE,
            change={"prior_scale": scale}, expect="invalid_argument",
        )  # fmt: skip
    one = photograph(NIKON, ["D55"], {"chart": "babelcolor", "patches": ALL})
    yield scene(
        "error-zero-signal-gaussian", "Chart equal to dark: no curve explains a black chart.", basis="gaussian",
        change={"chart": one["dark"]}, expect="not_converged",
    )  # fmt: skip
    wrong: list[tuple[str, str, str, Json]] = [
        ("two-shots-gaussian", "The paper's rows take one shot.", "invalid_argument",
         {"basis": "gaussian", "lamps": ["D55", "A"]}),
        ("no-penalty", "γ = 0 and λ₂ = 0 leave no unique answer.", "invalid_argument", {"l2": 0.0, "gamma": 0.0}),
        ("negative-gamma", "γ < 0.", "invalid_argument", {"gamma": -0.1}),
        ("negative-l2", "λ₂ < 0.", "invalid_argument", {"l2": -1.0}),
        ("nan-gamma", "γ is not a number.", "invalid_argument", {"change": {"gamma": "NaN"}}),
        ("negative-tolerance", "A chart tolerance below zero.", "invalid_argument", {"chart_tolerance": -0.03}),
        ("negative-standard-error", "A standard error below zero.", "invalid_argument",
         {"change": {"standard_error": {"constant": -0.01, "shape": [1, 24, 3]}}}),
        ("reflectance-missing", "23 reflectances for 24 patches.", "invalid_argument",
         {"change": {"reflectance": {"chart": "babelcolor", "patches": ALL[:-1]}}}),
        ("lamp-dark", "A lamp without power on the grid.", "lamp_unfit",
         {"change": {"lamp": {"constant": 0.0, "shape": [1, 681]}}}),
        ("lamp-negative", "A lamp with negative power.", "lamp_unfit",
         {"change": {"lamp": {"constant": -1.0, "shape": [1, 681]}}}),
        ("lamps-too-many", "Two lamps for one shot.", "invalid_argument",
         {"change": {"lamp": {"lamps": ["D55", "A"]}}}),
        ("modes-of-another-shot", "Modes for two shots, one given.", "invalid_argument",
         {"modes": [[[0.0, 0.1]], [[0.0, 0.1]]]}),
        ("white-black", "A white reference that reflects nothing.", "invalid_argument",
         {"change": {"white_reflectance": {"constant": 0.0, "shape": [681]}}}),
    ]  # fmt: skip
    for name, comment, code, more in wrong:
        yield scene(f"error-{name}", comment, expect=code, **more)
    chart = one["chart"].tolist()
    chart[0][3][1] = "NaN"
    yield scene("error-nan-signal", "A chart mean that is not a number.", change={"chart": chart},
                expect="invalid_argument")  # fmt: skip
    two = photograph(NIKON, ["D55", "A"], {"chart": "babelcolor", "patches": ALL})
    ragged = {name: [two[name][0].tolist(), two[name][1, :-1].tolist()] for name in ("chart", "white", "dark")}
    yield scene("error-unequal-shots", "24 patches in the first shot, 23 in the second.", lamps=["D55", "A"],
                change=ragged, expect="invalid_argument")  # fmt: skip


# -- stage layers ---------------------------------------------------------------------------------------------------

KINDS = {"daylight": ("D55", 0.02), "white-led": ("LED-B3", 0.17), "fluorescent": ("FL2", 0.06)}
"""Lamps of which only the kind is known: the true lamp, and the tolerance that the kind's modes leave."""


def _layers_cases() -> Iterator[Case]:
    """Cases of the layers without finish, with the product's defaults and with others."""

    def unfinished(
        name: str, comment: str, told: Sequence[str], patches: list[int], camera: str, iteration: str, depth: int
    ) -> Case:
        kinds = [lamp if lamp in KINDS else None for lamp in told]
        change: Json = {
            "lamp": {"lamps": list(told)},
            "lamp_tolerance": [KINDS[lamp][1] if lamp in KINDS else 0.02 for lamp in told],
            "iteration": iteration,
            "depth": depth,
        }
        if any(kinds):
            change["lamp_modes"] = {"modes": kinds}
        true = [KINDS[lamp][0] if lamp in KINDS else lamp for lamp in told]
        return scene(
            name, comment, camera={"camera": camera}, lamps=true, patches=patches, noise="usual", change=change,
            stage="layers",
        )  # fmt: skip

    cameras = [
        "Nikon D5100", "Canon EOS 5D Mark II", "Sony ILCE-7M3", "ARRI D21", "Fujifilm X-T3", "Canon EOS R5",
        "Arashi Vision Insta360 X5",
    ]  # fmt: skip
    captures: list[tuple[str, ...]] = [
        ("D55",), ("A",), ("FL2",), ("LED-B3",), ("daylight",), ("white-led",), ("fluorescent",),
        ("D55", "A"), ("D55", "white-led"), ("A", "fluorescent"), ("daylight", "white-led"),
        ("D55", "A", "FL2"), ("D55", "A", "white-led"), ("daylight", "white-led", "fluorescent"),
    ]  # fmt: skip
    for i, told in enumerate(captures):
        for patches in (TWELVE, ALL):
            yield unfinished(
                f"{len(patches)}-{'-'.join(told).lower()}",
                f"The product's layers alone, {' + '.join(told)}, {len(patches)} patches, λ₂ = 1, γ = 0.05: they "
                "stand at cvxpy's optimum, and the finish has nothing to do.",
                told, patches, cameras[i % len(cameras)], "splitting", DEPTH,
            )  # fmt: skip
    for name, told, patches in (("one", ("D55",), ALL), ("two", ("D55", "white-led"), TWELVE)):
        for iteration, depths in (("splitting", (4, 8, 16)), ("ista", (16, 100, 1000, 10_000))):
            for depth in depths:
                yield unfinished(
                    f"{iteration}-{depth}-{name}",
                    f"{depth} layers of {iteration}, {' + '.join(told)}, {len(patches)} patches: where "
                    "they stand beside cvxpy's optimum.",
                    told, patches, NIKON["camera"], iteration, depth,
                )  # fmt: skip


# -- stage choice ---------------------------------------------------------------------------------------------------


def _choice_cases() -> Iterator[Case]:
    """Cases of `auto`: one basis alone, or a mixture."""

    def choice(name: str, comment: str, camera: Json, lamps: list[str], prior: dict[str, float] | None = None,
               **more: Any) -> Case:  # fmt: skip
        return scene(name, comment, camera=camera, lamps=lamps, basis="auto", stage="choice",
                     change={"prior": prior or {}}, **more)  # fmt: skip

    yield choice("phone", "A phone under two lamps: its basis answers alone.", PHONE, ["D55", "A"])
    yield choice("camera", "A camera under two lamps: its basis answers alone.", NIKON, ["D55", "A"])
    yield choice("undecided", "Between the two under one lamp: both answers are mixed, bands and all.", BETWEEN,
                 ["D55"], patches=TWELVE, noise="usual")  # fmt: skip
    for family, comment in (("cameras", "it answers alone"), ("phones", "it leads, but not by 20 : 1")):
        yield choice(f"maker-{family}", f"The same, and the file's maker makes {family}: {comment}.", BETWEEN,
                     ["D55"], {family: 20.0}, patches=TWELVE, noise="usual")  # fmt: skip
    yield choice("maker-outweighed", "A phone whose file names a maker of cameras: the signals outweigh 20 : 1.",
                 PHONE, ["D55", "A"], {"cameras": 20.0}, noise="none")  # fmt: skip
    yield choice("wide", "Curves that neither knows: the prior twice as wide is the likelier.", ODD, ["D55", "A"])
    yield choice("l1-only", "λ₂ = 0: the evidence does not know of the penalties.", BETWEEN, ["D55"],
                 patches=TWELVE, noise="usual", l2=0.0, gamma=1.4)  # fmt: skip


# -- stages signals and calibrate ---------------------------------------------------------------------------------


def _frames(
    camera: Json = NIKON,
    lamps: Sequence[str] = ("D55",),
    *,
    table: str = "babelcolor",
    white: Any = FLAT,
    **more: Any,
) -> list[Json]:
    """Shots as measured: mean, standard error and clipped share of each frame."""
    photo = photograph(camera, lamps, {"chart": table, "patches": ALL}, white=white, **more)
    shots = []
    for j in range(len(lamps)):
        D = photo["dark"][j]
        shot: Json = {"black": [64.0, 64.0, 64.0], "saturation": 16_383.0}
        for name in ("chart", "white", "dark"):
            mean = photo[name][j]
            error = np.round(0.25 + 0.05 * np.sqrt(np.maximum(mean - D, 0.0)) / 2.0, 4)
            shot[name] = {"mean": mean, "standard_error": error, "clipped": {"constant": 0.0, "shape": [24, 3]}}
        shots.append(shot)
    return shots


def _clip(shot: Json, frame: str, patches: slice, share: float = 0.5, channels: slice = slice(1, 2)) -> Json:
    clipped = np.zeros((24, 3))
    clipped[patches, channels] = share
    return shot | {frame: shot[frame] | {"clipped": clipped}}


def _put(shot: Json, frame: str, key: str, where: Any, value: float) -> Json:
    array = np.array(shot[frame][key])
    array[where] = value
    return shot | {frame: shot[frame] | {key: array}}


def _faulty() -> Iterator[tuple[str, str, str, list[Json], str]]:
    """Captures for which Eq. (5) must raise: name, comment, code, shots, channel."""
    (shot,) = _frames()
    yield ("channel-all-clipped", "Every patch's green is clipped.", "overexposed",
           [_clip(shot, "chart", slice(0, 24))], "")  # fmt: skip
    yield ("white-clipped", "The white frame is clipped in red.", "overexposed",
           [_clip(shot, "white", slice(4, 5), 0.02, slice(0, 1))], "")  # fmt: skip
    faint = _put(shot, "white", "mean", (slice(None), 2), 90.0)
    yield "white-faint", "The white frame's blue lies at 0.2 % of the range.", "underexposed", [faint], ""
    noisy = _put(shot, "white", "standard_error", (5, 1), 1000.0)
    yield "white-noisy", "The white frame is known to worse than 5 % at one patch.", "underexposed", [noisy], ""
    lost = _put(shot, "chart", "standard_error", (slice(0, 20), slice(None)), 5000.0)
    yield "patches-lost", "Noise swallows 20 of 24 patches.", "underexposed", [lost], ""


def _signal_cases() -> Iterator[Case]:
    def signals(name: str, comment: str, shots: list[Json], *, patches: int = 24, **more: Any) -> Case:
        return case(f"signals/{name}", comment, {"shots": shots, "patches": patches, "white": 18}, **more)

    (shot,) = _frames()
    yield signals("triple", "Chart, white and dark frame: Eq. (5) and its standard errors.", [shot])
    white = resolve({"chart": "babelcolor", "patches": [19]})[0]
    card = _frames(white=white, shade=0.0)[0] | {"white": None}
    yield signals("no-white", "The chart's white patch stands in; its own row is not used.", [card])
    yield signals("no-dark", "The black level stands in for the dark frame.", [shot | {"dark": None}])
    yield signals("chart-alone", "Neither white nor dark frame: two fallbacks.", [card | {"dark": None}])
    yield signals("two-shots", "Two shots are normalised each by its own frames.", _frames(CANON, ["D55", "A"]))
    exact = {key: {"mean": {"constant": dn, "shape": [24, 3]}, "standard_error": {"constant": 0.0, "shape": [24, 3]},
                   "clipped": {"constant": 0.0, "shape": [24, 3]}}
             for key, dn in (("chart", 576.0), ("white", 2112.0), ("dark", 64.0))}  # fmt: skip
    yield signals("quarter", "(576 - 64) / (2112 - 64) is exactly 1/4.", [shot | exact])
    yield signals("clipped-patches", "Clipped above 1 % in one channel: not used; 1 % itself is.",
                  [_clip(_clip(shot, "chart", slice(0, 2), 0.011), "chart", slice(0, 3), 0.01)
                   | {"chart": shot["chart"] | {"clipped": [[0, v, 0] for v in (0.011, 0.01, 0.5) + (0.0,) * 21]}}]
                  )  # fmt: skip
    level = np.array(shot["white"]["mean"])[:, 2]
    dim = _put(shot, "white", "mean", (slice(None), 2), 64.0 + 0.006 * (16_383.0 - 64.0))
    dim = _put(dim, "white", "standard_error", (slice(None), 2), 1.0)
    yield signals("white-just-bright", "The white frame's blue lies at 0.6 % of the range: enough.", [dim])
    just = _put(shot, "white", "standard_error", (5, 2), round(0.04 * (level[5] - 64.0), 4))
    yield signals("white-just-quiet", "The white frame is known to 4 % at one patch: enough.", [just])
    signal = np.array(shot["chart"]["mean"])[:, 2] - np.array(shot["dark"]["mean"])[:, 2]
    near = shot
    for i, errors in ((22, 4.0), (23, 2.0)):
        near = _put(near, "chart", "standard_error", (i, 2), round(signal[i] / errors, 4))
    yield signals("nearly-lost", "Four standard errors are a signal, two are none.", [near])
    yield signals("six-left", "Six patches that are not clipped: just enough.",
                  [_clip(shot, "chart", slice(6, 24))])  # fmt: skip
    yield signals("lost-patch", "The black patch lies below three standard errors in blue.",
                  [_put(shot, "chart", "standard_error", (23, 2), 2000.0)])  # fmt: skip
    for name, comment, code, shots, _ in _faulty():
        yield signals(f"error-{name}", comment, shots, expect=code)
    low = _put(shot, "white", "mean", (slice(None), 2), 64.0 + 0.004 * (16_383.0 - 64.0))
    low = _put(low, "white", "standard_error", (slice(None), 2), 1.0)
    for name, comment, code, wrong in (
        ("white-just-faint", "The white frame's blue lies at 0.4 % of the range.", "underexposed", low),
        ("white-just-noisy", "The white frame is known to 6 % at one patch.", "underexposed",
         _put(shot, "white", "standard_error", (5, 2), round(0.06 * (level[5] - 64.0), 4))),
        ("five-left", "Five patches that are not clipped.", "overexposed", _clip(shot, "chart", slice(5, 24))),
    ):  # fmt: skip
        yield signals(f"error-{name}", comment, [wrong], expect=code)
    yield signals("error-no-shot", "No shot at all.", [], expect="invalid_argument")
    yield signals("error-other-chart", "24 patches, a table of 140.", [shot], patches=140, expect="invalid_argument")


def _lit(shots: list[Json], light: Floats) -> list[Json]:
    """The same shots in uneven light, without white frames."""
    found = []
    for each in shots:
        dark = each["dark"]["mean"]
        mean = np.round(dark + light[:, None] * (each["chart"]["mean"] - dark), 3)
        found.append(each | {"white": None, "chart": each["chart"] | {"mean": mean}})
    return found


def _calibrate_cases() -> Iterator[Case]:
    def calibrate(name: str, comment: str, shots: list[Json], lamps: Sequence[str] = ("D55",), **more: Any) -> Case:
        known = {"truth", "rmse", "expect"}
        inputs = {
            "shots": shots,
            "reflectance": {"chart": "babelcolor", "patches": ALL},
            "chart_tolerance": 0.03,
            "white": 18,
            "lamp": {"lamps": list(lamps)},
            "lamp_tolerance": {"constant": 0.02, "shape": [len(lamps)]},
            "lamp_modes": {"polynomials": [[] for _ in lamps]},
            "white_reflectance": None,
            "basis": "cameras",
            "l2": None,
            "gamma": None,
            "nonnegative": None,
        } | {key: value for key, value in more.items() if key not in known}
        return case(f"calibrate/{name}", comment, inputs, **{k: v for k, v in more.items() if k in known})

    (shot,) = _frames()
    white = resolve({"chart": "babelcolor", "patches": [19]})[0]
    card = _frames(white=white, shade=0.0)[0] | {"white": None}
    yield calibrate("one-shot", "Chart, white, dark under D55 with the product's defaults.", [shot], truth=NIKON,
                    rmse=0.05)  # fmt: skip
    yield calibrate("two-shots", "D55 and a bulb.", _frames(CANON, ["D55", "A"]), ["D55", "A"], truth=CANON,
                    rmse=0.05)  # fmt: skip
    yield calibrate("three-shots", "D55, a bulb and a white LED.", _frames(BELLS, ["D55", "A", "LED-B3"]),
                    ["D55", "A", "LED-B3"], truth=BELLS, rmse=0.08)  # fmt: skip
    yield calibrate("no-white", "The chart's white patch stands in: ρ_w is its table, its row drops out.", [card],
                    truth=NIKON, rmse=0.06)  # fmt: skip

    one, two = (_frames(PHONE, lamps, white=white, shade=0.0) for lamps in (["D55"], ["D55", "A"]))
    yield calibrate("uneven", "No white frame, and light that falls off by a quarter: solved for with the curves.",
                    _lit(one, _light()), basis="phones", truth=PHONE, rmse=0.06)  # fmt: skip
    yield calibrate("uneven-two-shots", "The same of two shots, each with a light of its own.",
                    [*_lit(two[:1], _light()), *_lit(two[1:], _light(0.5))], ["D55", "A"], basis="phones",
                    truth=PHONE, rmse=0.06)  # fmt: skip
    yield calibrate("uneven-shadow", "Half of the chart in a shadow: more than a bowl of light can be.",
                    _lit(one, np.where(np.arange(24) % 6 > 2, 0.7, 1.0)), basis="phones", truth=PHONE,
                    rmse=0.12)  # fmt: skip
    random = 1.0 + 0.08 * np.sin(37.0 * np.arange(24.0) ** 2)
    yield calibrate("one-by-one", "Each patch photographed for itself: the light differs by 8 %.",
                    _lit(one, np.round(random / random[18], 6)), basis="phones", light_per_patch=0.08, truth=PHONE,
                    rmse=0.09)  # fmt: skip
    yield calibrate("one-by-one-framed", "The same with a white frame: a mode a patch.", [shot], light_per_patch=0.08,
                    truth=NIKON, rmse=0.09)  # fmt: skip
    yield calibrate("error-one-by-one", "Light cannot differ by nothing.", [card], light_per_patch=0.0,
                    expect="invalid_argument")  # fmt: skip
    yield calibrate("no-dark", "The black level stands in for the dark frame.", [shot | {"dark": None}], truth=NIKON,
                    rmse=0.05)  # fmt: skip
    yield calibrate("grey-card", "The white frame shows a card of 90 %.",
                    _frames(white=np.full(681, 0.9)), white_reflectance=0.9, truth=NIKON, rmse=0.05)  # fmt: skip
    first, second = _frames(NIKON, ["D55", "A"])
    yield calibrate("clipped-in-one", "Three patches clipped in the second shot serve in the first alone.",
                    [first, _clip(second, "chart", slice(18, 21))], ["D55", "A"], truth=NIKON, rmse=0.05)  # fmt: skip
    yield calibrate("clipped-in-both", "A patch that no shot can use is left out of the fit, and predicted.",
                    [_clip(first, "chart", slice(18, 19)), _clip(second, "chart", slice(18, 19))], ["D55", "A"],
                    truth=NIKON, rmse=0.05)  # fmt: skip
    yield calibrate("modes", "A lamp of uncertain temperature: one mode.", [shot],
                    lamp_modes={"polynomials": [[[0.0, 0.1]]]}, truth=NIKON, rmse=0.08)  # fmt: skip
    yield calibrate("families", "Two lamps known by their kind alone: predicted under the lamps as found.",
                    _frames(NIKON, ["D55", "LED-B3"]), ["daylight", "white-led"],
                    lamp_modes={"modes": ["daylight", "white-led"]}, lamp_tolerance=[0.02, 0.17],
                    truth=NIKON, rmse=0.08)  # fmt: skip
    yield calibrate("paper", "The paper's basis with a given γ; no band.", [shot], basis="gaussian", gamma=1.0,
                    truth=NIKON, rmse=0.15)  # fmt: skip
    yield calibrate("auto-camera", "No basis told: the signals choose, and folds and rivals stand on that.",
                    _frames(NIKON, ["D55", "A"]), ["D55", "A"], basis="auto", truth=NIKON, rmse=0.05)  # fmt: skip
    yield calibrate("auto-phone", "The same of a phone, whose file says so.", _frames(PHONE, ["D55", "A"]),
                    ["D55", "A"], basis="auto", make="Apple", truth=PHONE, rmse=0.06)  # fmt: skip
    yield calibrate("auto-other-maker", "A phone's curves in a file that names a maker of cameras: camera_unusual.",
                    _frames(PHONE, ["D55", "A"], noise="none"), ["D55", "A"], basis="auto", lamp_tolerance=[0.0, 0.0],
                    make="NIKON CORPORATION")  # fmt: skip
    for name, comment, code, shots, _ in _faulty():
        yield calibrate(f"error-{name}", comment, shots, expect=code)
    yield calibrate("error-lamp-dark", "A lamp without power on the grid.", [shot],
                    lamp={"constant": 0.0, "shape": [1, 681]}, expect="lamp_unfit")  # fmt: skip
    yield calibrate("error-two-shots-paper", "The paper's rows take one shot.", _frames(NIKON, ["D55", "A"]),
                    ["D55", "A"], basis="gaussian", gamma=1.0, expect="invalid_argument")  # fmt: skip
    true, told = ["D55", "A", "LED-B3", "LED-B3", "D55"], ["D55", "A", "LED-B3", "D55", "D55"]
    yield calibrate("error-rival-of-four", "Of four shots one lamp is named wrongly: a rival condemns it.",
                    _frames(NIKON, true[:4]), told[:4], expect="lamp_unfit")  # fmt: skip
    yield calibrate("five-shots", "The same of five: rivals are not tried, the shots contradict each other.",
                    _frames(NIKON, true), told)  # fmt: skip
    yield calibrate("error-nothing-left", "γ = 1e9 on the paper's basis: no curve.", [shot], basis="gaussian",
                    gamma=1e9, expect="not_converged")  # fmt: skip


def _light_cases() -> Iterator[Case]:
    """Cases of unnamed light: `unnamed` lists the shots, counted from 1; their `lamp` is ignored."""

    def light(
        name: str, comment: str, camera: Json, lamps: Sequence[str], unnamed: list[int], *, expect: str = "success",
        **more: Any,
    ) -> Case:  # fmt: skip
        made = next(each for each in _calibrate_cases() if each["case"] == "calibrate/auto-phone")["inputs"]
        told = ["equal-energy" if j in unnamed else lamp for j, lamp in enumerate(lamps, 1)]
        k = len(lamps)
        inputs = made | {
            "shots": _frames(camera, lamps, noise="usual"),
            "lamp": {"lamps": told},
            "lamp_tolerance": {"constant": 0.02, "shape": [k]},
            "lamp_modes": {"polynomials": [[] for _ in lamps]},
            "unnamed": unnamed,
        }
        return case(f"light/{name}", comment, inputs | more, expect=expect)

    yield light("daylight", "A phone under D55, and nobody said so.", PHONE, ["D55"], [1])
    yield light("white-led", "The same under a white LED: kinds are mixed.", PHONE, ["LED-B3"], [1])
    yield light("two", "Daylight and a bulb, neither named: 64 hypotheses.", PHONE, ["D55", "A"], [1, 2])
    yield light("one-of-two", "Daylight by its name and a bulb by none: rivals of the first alone.", PHONE,
                ["D55", "A"], [2])  # fmt: skip
    yield light("told-basis", "The basis told, a fluorescent lamp not: a phone by word.", PHONE, ["FL2"], [1],
                basis="phones")  # fmt: skip
    yield light("camera", "A camera must name its lamp: refused, and what it might have been.", NIKON, ["D55"], [1],
                make="NIKON CORPORATION")  # fmt: skip
    yield light("no-maker", "A phone's curves in a file of nobody: taken for a camera's.", PHONE, ["D55"], [1],
                make="golden")  # fmt: skip
    white = resolve({"chart": "babelcolor", "patches": [19]})[0]
    yield light(
        "uneven",
        "A white LED that nobody named, no white frame, and light that falls off by a quarter.",
        PHONE,
        ["LED-B3"],
        [1],
        shots=_lit(_frames(PHONE, ["LED-B3"], white=white, shade=0.0, noise="usual"), _light()),
    )
    yield light("error-paper", "A basis without a prior weighs nothing.", PHONE, ["D55"], [1], basis="gaussian",
                gamma=1.0, expect="invalid_argument")  # fmt: skip
    yield light("error-three", "Three lights at once are too many.", PHONE, ["D55", "A", "LED-B3"], [1, 2, 3],
                expect="invalid_argument")  # fmt: skip


def _rivals_cases() -> Iterator[Case]:
    """Cases of the gains of rival lamps, which the verdict's rule 4 uses."""
    names = {"basis", "shots", "lamp"}

    def rivals(name: str, comment: str, shots: list[Json], lamps: Sequence[str], **more: Any) -> Case:
        made = next(each for each in _calibrate_cases() if each["case"] == "calibrate/two-shots")["inputs"]
        inputs = {key: value for key, value in made.items() if key not in names}
        inputs |= {"shots": shots, "lamp": {"lamps": list(lamps)}, "basis": "cameras",
                   "lamp_tolerance": {"constant": 0.02, "shape": [len(lamps)]},
                   "lamp_modes": {"polynomials": [[] for _ in lamps]}}  # fmt: skip
        return case(f"rivals/{name}", comment, inputs | more)

    yield rivals("right", "D55 under its own name: no lamp gains much.", _frames(), ["D55"])
    yield rivals("wrong", "D55 named A: daylight gains most.", _frames(), ["A"])
    yield rivals("phone", "On the basis of phones, two shots, the second named wrongly.",
                 _frames(PHONE, ["D55", "LED-B3"]), ["D55", "A"], basis="phones")  # fmt: skip
    yield rivals("auto", "A phone's bulb named daylight: for a camera it may pass, the phones' basis sees it.",
                 _frames(PHONE, ["A"]), ["D55"], basis="auto", make="samsung", model="SM-G991B")  # fmt: skip
    yield rivals("auto-no-maker", "The same of a file that does not say who made it.",
                 _frames(PHONE, ["A"]), ["D55"], basis="auto")  # fmt: skip
    card = _frames(white=resolve({"chart": "babelcolor", "patches": [19]})[0], shade=0.0)[0] | {"white": None}
    yield rivals("no-white", "A wrong lamp without a white frame: gain modes stand beside every lamp.", [card], ["A"])
    yield rivals("kind", "Told by its kind alone: a rival has no modes.", _frames(), ["daylight"],
                 lamp_modes={"modes": ["daylight"]})  # fmt: skip


# -- stages sensing, weights, solve -------------------------------------------------------------------------------


def _sensing_cases() -> Iterator[Case]:
    def sensing(name: str, comment: str, patches: list[int], lamps: Sequence[str] = ("D55",), **more: Any) -> Case:
        made = scene(name, comment, patches=patches, lamps=lamps, noise="usual", **more)["inputs"]
        y = (made["chart"] - made["dark"]) / (made["white"] - made["dark"])
        unused = ("chart", "white", "dark", "l2", "gamma", "nonnegative")
        inputs = {key: value for key, value in made.items() if key not in unused}
        return case(f"sensing/{name}", comment, inputs | {"signals": np.round(y, 6)})

    few = [15, 14, 13, 19]
    yield sensing(
        "cameras-diagonal",
        "No tolerances: Σ is the noise, and of each shot the drift of its light.",
        few,
        chart_tolerance=0.0,
        white_tolerance=0.0,
    )
    yield sensing("cameras-chart", "The chart's error: one a patch, the same under both lamps.", few, ["D55", "A"],
                  white_tolerance=0.0)  # fmt: skip
    yield sensing("cameras-white", "The white's error: common to all rows.", few, ["D55", "FL2"], chart_tolerance=0.0)
    yield sensing("cameras-lamp", "Each lamp's own error, smooth.", few, ["A", "LED-B3"],
                  chart_tolerance=0.0, white_tolerance=0.0, lamp_tolerance=0.02)  # fmt: skip
    yield sensing("cameras-modes", "Modes: rows about what a first look finds, the same for all channels.", few,
                  ["D55", "LED-B3"], modes=FAMILY, lamp_tolerance=0.02,
                  change={"lamp": {"lamps": ["equal-energy"] * 2}})  # fmt: skip
    yield sensing("cameras-two-lamps", "Everything at once: 12 patches, two shots.", TWELVE, ["D55", "A"],
                  lamp_tolerance=0.02)  # fmt: skip
    yield sensing("gaussian-twelve", "The paper's rows F Ψ x = y, 12 patches.", TWELVE, basis="gaussian",
                  chart_tolerance=0.0)  # fmt: skip
    yield sensing("gaussian-one-atom", "A basis of a single Gaussian.", few, basis="gaussian",
                  change={"basis": {"count": 1, "width": 50.0}})  # fmt: skip


def _waves(rows: int, columns: int, seed: int) -> Floats:
    """(3, rows, columns) matrices by a formula, entries in [-1, 1] with three decimals."""
    c, i, j = np.meshgrid(np.arange(3), np.arange(rows), np.arange(columns), indexing="ij")
    waves: Floats = np.sin(12.9898 * (i + 1) ** 2 + 78.233 * (j + 1) ** 2 + 37.719 * (c + seed) + 0.5 * i * j)
    return np.round(waves, 3)


def _identity(rows: int) -> Floats:
    return np.broadcast_to(np.eye(rows), (3, rows, rows)).copy()


def _problem(A: Any, b: Any, sigma: Any, l2: float, gamma: Any, nonnegative: bool = False) -> Json:
    return {"matrix": A, "target": b, "covariance": sigma, "l2": l2, "gamma": gamma, "nonnegative": nonnegative}


def _rows_of(name: str, l2: float, gamma: Any, nonnegative: bool = False) -> Json:
    A, b, sigma = ({"case": f"sensing/{name}", "output": part} for part in ("matrix", "target", "covariance"))
    return _problem(A, b, sigma, l2, gamma, nonnegative)


def _weights_cases() -> Iterator[Case]:
    def weights(name: str, comment: str, problem: Json, depths: list[int], **more: Any) -> Case:
        return case(f"weights/{name}", comment, problem | {"depths": depths}, **more)

    yield weights("identity", "A = I, λ₂ = 0, γ = 1: W = I / 2, and z by hand.",
                  _problem(_identity(3), [[3.0, -0.5, 1.0]] * 3, _identity(3), 0.0, [1.0] * 3), [0, 1, 2]
                )  # fmt: skip
    yield weights("waves", "Six rows, four atoms, λ₂ = 1.",
                  _problem(_waves(6, 4, 1), _waves(6, 1, 2)[..., 0], _identity(6), 1.0, [0.1] * 3), [1, 8, 32]
                )  # fmt: skip
    yield weights("waves-nonnegative", "The same with x ≥ 0 and another γ for each channel.",
                  _problem(_waves(6, 4, 1), _waves(6, 1, 2)[..., 0], _identity(6), 0.0, [0.05, 0.2, 0.8], True),
                  [1, 8, 32])  # fmt: skip
    yield weights("closed-form", "γ = 0: W = (H + 2 λ₂ I)⁻¹, nothing is thresholded.",
                  _problem(_waves(6, 4, 1), _waves(6, 1, 2)[..., 0], _identity(6), 0.5, [0.0] * 3), [1, 32]
                )  # fmt: skip
    yield weights("cameras", "The product's rows: two lamps, full covariance, λ₂ = 1, γ = 0.05.",
                  _rows_of("cameras-two-lamps", 1.0, [0.05]), [1, 4, 32])  # fmt: skip
    yield weights("cameras-l1", "λ₂ = 0, γ = 1.4.", _rows_of("cameras-two-lamps", 0.0, [1.4]), [1, 4, 32])
    yield weights("gaussian", "The paper's rows, x ≥ 0.", _rows_of("gaussian-twelve", 0.0, [1.0] * 3, True),
                  [1, 4, 32])  # fmt: skip


def _solve_cases() -> Iterator[Case]:
    def solve(name: str, comment: str, problem: Json, *, depth: int | None = None, **more: Any) -> Case:
        return case(f"solve/{name}", comment, problem | {"depth": depth, "finish": None}, **more)

    A, b, eye = _waves(8, 5, 3), _waves(8, 1, 4)[..., 0], _identity(8)
    yield solve("soft", "A = I: x = soft(b, γ), by hand [2, 0, 0] with objective 3.125.",
                _problem(_identity(3), [[3.0, -0.5, 1.0]] * 3, _identity(3), 0.0, [1.0] * 3), generic=False
                )  # fmt: skip
    yield solve("one-atom", "One atom.", _problem(A[:, :, :1], b, eye, 0.0, [0.1] * 3))
    yield solve("one-row", "One row, one atom.", _problem(A[:, :1, :1], b[:, :1], _identity(1), 0.0, [0.01] * 3))
    yield solve("zero-target", "b = 0: x = 0, objective 0, gap 0.", _problem(A, 0 * b, eye, 0.0, [0.1] * 3))
    yield solve("gamma-kills", "γ above γ_max: x = 0.", _problem(A, b, eye, 0.0, [1e3] * 3))
    yield solve("generic", "Eight rows, five atoms.", _problem(A, b, eye, 0.0, [0.1] * 3))
    yield solve("three-gammas", "Another γ for each channel.", _problem(A, b, eye, 0.0, [0.01, 0.1, 1.0]))
    yield solve("nonnegative", "x ≥ 0.", _problem(A, b, eye, 0.0, [0.1] * 3, True))
    yield solve("elastic", "λ₂ = 1.", _problem(A, b, eye, 1.0, [0.1] * 3))
    yield solve("closed-form", "γ = 0, λ₂ = 1: ridge regression.", _problem(A, b, eye, 1.0, [0.0] * 3))
    yield solve("closed-form-nonnegative", "γ = 0, λ₂ = 0.1, x ≥ 0.", _problem(A, b, eye, 0.1, [0.0] * 3, True))
    yield solve("gamma-tiny", "γ = 1e-9.", _problem(A, b, eye, 0.0, [1e-9] * 3))
    yield solve("no-layers", "Depth 0: the finish alone arrives.", _problem(A, b, eye, 0.0, [0.1] * 3), depth=0)
    F = _waves(8, 2, 5)
    sigma = np.round(eye + F @ F.transpose(0, 2, 1), 6)
    yield solve("full-covariance", "Correlated errors.", _problem(A, b, sigma, 0.0, [0.1] * 3))
    twice = np.concatenate([A, A], axis=2)
    yield solve("duplicate-atoms", "Every atom twice: the code is not unique, the objective is.",
                _problem(twice, b, eye, 0.0, [0.1] * 3), generic=False)  # fmt: skip
    yield solve("duplicate-atoms-ridge", "Every atom twice, λ₂ = 1: they share.",
                _problem(twice, b, eye, 1.0, [0.1] * 3), generic=False)  # fmt: skip
    yield solve("opposite-atoms", "Every atom and its negative.",
                _problem(np.concatenate([A, -A], axis=2), b, eye, 0.0, [0.1] * 3, True), generic=False)  # fmt: skip
    yield solve("empty-atom", "An atom of zeros is never taken.",
                _problem(np.concatenate([A, 0 * A[:, :, :1]], axis=2), b, eye, 0.0, [0.1] * 3))  # fmt: skip
    yield solve("identical-rows", "Eight times the same row: rank one.",
                _problem(np.repeat(A[:, :1], 8, axis=1), np.repeat(b[:, :1], 8, axis=1), eye, 0.0, [0.1] * 3)
                )  # fmt: skip
    yield solve("more-atoms-than-rows", "Four rows, nine atoms.",
                _problem(_waves(4, 9, 6), b[:, :4], _identity(4), 0.0, [0.05] * 3))  # fmt: skip
    tie = np.array([[1.0, 1.0, 0.5], [1.0, -1.0, 0.0], [0.0, 0.0, 0.5]])
    yield solve("ties", "Two atoms meet the bound together.",
                _problem(np.broadcast_to(tie, (3, 3, 3)).copy(), [[2.0, 0.0, 1.0]] * 3, _identity(3), 0.0, [0.5] * 3),
                generic=False)  # fmt: skip
    for l2, gamma, name in ((1.0, 0.05, "cameras"), (0.0, 1.4, "cameras-l1"), (1.0, 0.0, "cameras-closed")):
        yield solve(name, f"The product's rows, λ₂ = {l2:g}, γ = {gamma:g}.",
                    _rows_of("cameras-two-lamps", l2, [gamma]), generic=False)  # fmt: skip
    for gamma, positive, name in (
        (1.0, True, "gaussian"),
        (1.0, False, "gaussian-signed"),
        (1e-3, True, "gaussian-weak"),
    ):
        yield solve(name, f"The paper's rows, γ = {gamma:g}, {'x ≥ 0' if positive else 'signed'}.",
                    _rows_of("gaussian-twelve", 0.0, [gamma] * 3, positive), generic=False)  # fmt: skip
    yield solve("gaussian-one-atom", "A basis of one Gaussian.",
                _rows_of("gaussian-one-atom", 0.0, [0.5] * 3, True))  # fmt: skip
