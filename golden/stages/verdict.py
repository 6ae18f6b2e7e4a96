"""The stage `verdict`: a case for each rule of `camssf.verdict.judge`, in plain numbers.

Nothing is solved for them: the curves are those of a measured camera, the predictions are its signals, and the
signals differ from them as the case describes. So every number comes from a formula or a table.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from camssf.grid import WAVELENGTHS, Floats
from camssf.photo.find.pose import Pose
from camssf.photo.signals import Signals
from camssf.recovery.basis import LEARNED, read_basis
from camssf.recovery.sensitivity import (
    FamilyTest,
    Hypothesis,
    Proof,
    Ssf,
    half_width_of,
    prior_std,
)
from camssf.verdict.cause import tables_of_causes, weigh_causes
from camssf.verdict.cause_groups import Causes
from camssf.verdict.goodness_of_fit import FEWEST, VerdictInputs, best_explanation, shot_answer
from camssf.verdict.judge import judge as judge_capture
from camssf.verdict.lamp import Neutral, Rival
from camssf.verdict.reasons import Fatal
from camssf.verdict.unit_drift import drift_probability
from golden import contract
from golden.contract import Call, Keys, Stage, against_stored, always, each, words
from golden.forms import Json, camera, chart, lamp, resolve
from golden.products import build_lamp, build_means, build_table

CAMERA, LAMPS = "Nikon D5100", ("D55", "A")
BLACK, SPAN, WELL, COUNT = 512.0, 12000.0, 8000.0, 400
"""Black level and range of the white, DN; electrons at full range; number of samples in a patch."""
LEVEL = SPAN / (16383.0 - BLACK)
"""Level of the white as a fraction of the sensor's range."""
COLUMNS = 6
MINOR = 0.022
"""Level of glare, as a fraction of white, for a case that it does not explain completely."""
SLIP = 1.19
"""Factor on one patch that makes it the best explanation while the goodness of fit stays acceptable."""
VERDICT_NUMBERS = words(
    "reflectance chart_tolerance white_reflectance lamp lamp_modes signals standard_error white dark centres "
    "ssf ssf_std code predicted"
)
"""Inputs that are arrays."""


def cases() -> Iterator[Json]:
    """All cases."""
    y = predicted()
    yield case("clean", "Nothing is wrong: accepted, no reasons.", y)
    yield case(
        "clean-white-patch",
        "No white frame: the white patch's row is out, ρ is its reflectance.",
        predicted(white=18),
        white=18,
    )
    x = (np.arange(24.0)[:, None] % COLUMNS - 2.5) / 2.5
    bowl = (1.0 - 0.2 * (x - 0.4) ** 2) / (1.0 - 0.2 * 1.4**2)
    yield case("uneven-solved", "Light that gain modes carry is no surprise.", predicted(white=18) * bowl, white=18,
               solved=True)  # fmt: skip
    yield case("uneven-beyond", "A shadow with an edge is more than plane and bowl: uneven_light.",
               predicted(white=18) * np.where(x > 0, 0.7, 1.0), white=18, solved=True)  # fmt: skip
    yield case(
        "two-shots", "Two clean shots of one chart: Σ holds its errors as the same in both.", predicted(k=2), k=2
    )
    yield case("no-prior", "Without a band there is no prior: xᵀ x counts nothing.", y, code=40.0, std=None)
    yield case("modes", "A lamp's modes are in Σ.", y * (1 + 0.03 * np.sin(np.arange(24.0)))[:, None], modes=True)
    # rule 3
    yield case("veil", "3 % of white over the chart photo: glare.", 0.97 * y + 0.03)
    yield case("bright-dark", "3 % of white in the dark frame: frames_differ.", (y - 0.03) / 0.97)
    levels = LEVEL * (np.array(raw_white(1.0)) - BLACK) / SPAN
    yield case(
        "black-level", "No dark frame, and the file's black 0.5 % of the range too low: frames_differ.",
        y + 0.005 * (1 - y) / levels, dark=False,
    )  # fmt: skip
    yield case("veil-no-dark-slight", "1.5 % of white over the chart photo: glare is likelier than a black level.",
               0.985 * y + 0.015, dark=False)  # fmt: skip
    yield case("black-level-far", "The file's black 8 % of the range too low: not light that falls unevenly.",
               y + 0.08 * (1 - y) / levels, dark=False)  # fmt: skip
    yield case("black-level-right", "No dark frame, and nothing wrong with the black.", y, dark=False)
    yield case("black-level-slight", "A sixth of that is not enough.", y - 0.0008 * (1 - y) / levels, dark=False)
    yield case(
        "black-level-high", "3 % of white too high without a dark frame: not the dark frame's fault.",
        (y - 0.03) / 0.97, dark=False,
    )  # fmt: skip
    yield case("veil-no-dark", "3 % of white over the chart photo is glare without a dark frame, too.",
               0.97 * y + 0.03, dark=False)  # fmt: skip
    yield case(
        "white-colour",
        "The white frame of another light: each channel by its own factor.",
        y * np.array([1.15, 1.0, 0.85]),
    )
    yield case("light", "Light that falls off along the rows, in spite of a white frame.", y * slope(0.3)[:, None])
    yield case(
        "light-white-patch",
        "The same without one: the level is free.",
        predicted(white=18) * slope(0.3)[:, None] / slope(0.3)[18],
        white=18,
    )
    yield case("tone", "A tone curve, y^0.9: not_sensor_raw.", y**0.9)
    yield case("patch", "One wrong patch is named.", y * spike(13, 1.4))
    yield case("no-single-cause", "All patches off, by no pattern: chart_unfit.", y * ripple(0.1))
    yield case("misfit-refuses", "More than eight times the expected χ²: refused.", y * ripple(0.12))
    spoilt = np.stack([predicted(k=2)[0], predicted(k=2)[1] * np.array([1.2, 1.0, 0.85])])
    yield case(
        "second-of-two", "Of two shots the second one's white frame is of another light: it is named.", spoilt, k=2
    )
    yield case(
        "contradiction",
        "Each shot alone fits, together they do not.",
        predicted(k=2) * np.array([1.12, 0.88])[:, None, None],
        k=2,
        forgiven=True,
    )
    yield case(
        "minor-cause",
        "A veil that explains two fifths of the surprise is named.",
        (1 - MINOR) * y * ripple(0.08) + MINOR,
    )
    yield case(
        "suspect", "One patch a little off: no surprise, but a suspect that explains much.", y * spike(13, SLIP)
    )
    yield case("no-suspect", "One patch less off: no suspect explains enough.", y * spike(13, 1 + 0.8 * (SLIP - 1)))
    hole = y.copy()
    hole[23] = [0.0004, 0.0012, 0.0007]
    yield case("black-hole", "Signals below a thousandth: a tone curve is flat there.", hole)
    yield case("three-patches", "Three patches are enough to be questioned.", y, used=3)
    yield case("two-patches", "Two patches are not: nothing is suspected.", y, used=2)
    yield case("noiseless", "No row is believed better than 1e-4.", y * spike(3, 1.02), error=0.1)
    # rule 2
    yield case("outside-family", "Curves unlike a camera's.", y, code=22.0, known=10, basis="")
    yield case(
        "outside-family-no-more",
        "The same code where the signals tell twice as much of it.",
        y,
        code=22.0,
        known=20,
        basis="",
    )
    yield case(
        "outside-prior",
        "Curves that no camera has: doubtful, never refused for this.",
        y,
        code=80.0,
        known=10,
        basis="",
    )
    # rules 4 and 5
    yield case("rival", "Another lamp fits better.", y, rivals=[[0, "FL2", -12.0], [0, "A", 5.0]])
    yield case("other-lamp-weak", "Another lamp fits a little better.", y, rivals=[[0, "A", 3.0], [0, "FL2", -2.0]])
    yield case(
        "other-lamp-refuses", "Another lamp fits so much better that the named one is out.", y,
        rivals=[[0, "FL2", -900.0], [0, "A", 20.0]],
    )  # fmt: skip
    yield case(
        "rival-beyond-numbers", "e to the gain is no number any more: the probability still is.", y,
        rivals=[[0, "FL2", 900.0], [0, "A", 1500.0]],
    )  # fmt: skip
    yield case(
        "rival-of-the-refused", "Where the capture is refused already no rival is named.", 0.7 * y + 0.3,
        rivals=[[0, "A", 20.0]],
    )  # fmt: skip
    yield case(
        "rival-of-two",
        "The rival of one of two shots is named with its shot.",
        predicted(k=2),
        k=2,
        rivals=[[0, "A", 1.0], [1, "D55", 9.0], [1, "FL2", 8.0]],
    )
    yield case("tint", "The raw white is not what the colour matrix predicts.", y, tint=1.3)
    yield case("tint-unnamed", "A quarter off: only a light that was named is doubted for it.",
               y, tint=1.3, unnamed=True, choice=[["phones", 1.0]], family="phones")  # fmt: skip
    yield case("tint-unnamed-far", "More than half off: an unnamed light is doubted, too.", y, tint=1.7, unnamed=True,
               choice=[["phones", 1.0]], family="phones")  # fmt: skip
    yield case("tint-other-matrix", "One of two matrices agrees: that is enough.", y, tint=1.3, second=True)
    yield case(
        "rival-and-tint", "A rival that would be doubtful, and the raw white says the same: refused.", y, tint=1.3,
        rivals=[[0, "FL2", -12.0], [0, "A", 5.0]],
    )  # fmt: skip
    # rule 7
    apart = [["phones", 0.96], ["cameras", 0.04]]
    yield case("choice-other-maker", "The maker makes cameras, the signals speak for phones: camera_unusual.", y,
               choice=apart, family="cameras")  # fmt: skip
    yield case("choice-no-maker", "The file does not say who made it: phones it is.", y, choice=apart)
    both = [["phones", 0.99], ["cameras", 0.01]]
    tests: tuple[tuple[str, str, list[float | None]], ...] = (
        ("unusual-length", "A code longer than that of any clean phone: camera_unusual.", [0.7, 0.1, 0.05, 0.8]),
        ("unusual-lamp", "Another light than the named one, or another camera.", [-2.0, 3.5, 0.05, 0.8]),
        ("usual", "Neither is above its limit.", [0.04, 0.79, 0.05, 0.8]),
        ("unusual-unnamed", "The light was not named, so there is no lamp residual.", [0.4, None, 0.3, 0.8]),
    )
    yield case("choice-faded", "The signals were explained by a faded chart only: chart_unfit.", y, choice=both,
               family="phones", test=[-0.5, 0.1, 0.05, 0.8], fading=0.2)  # fmt: skip
    for name, comment, test in tests:
        yield case(f"choice-{name}", comment, y, choice=both, family="phones", test=test, unnamed=test[1] is None)
    # rule 8
    for name, phone, maker, outcome in (
        ("doubtful", 0.76, None, "doubtful"),
        ("refused", 0.19, None, "refused"),
        ("phones-maker", 0.92, "phones", "doubtful: without the name's odds it is 74 %"),
        ("cameras-maker", 0.5, "cameras", "accepted: without the name's odds it is 80 %"),
    ):  # fmt: skip
        yield case(f"unnamed-{name}", f"Nobody named the light, and a phone it is with {phone:.0%}: {outcome}.", y,
                   choice=[["phones", phone], ["cameras", 1.0 - phone]], family=maker, unnamed=True)  # fmt: skip
    for name, std, outcome in (
        ("one-light", 0.046, "doubtful, add a photo in another light"),
        ("typical", 0.062, "doubtful, little more than a typical phone"),
    ):
        yield case(f"band-ratio-{name}", f"An unnamed light and a band of ±{1.96 * std:.3f}: {outcome}.", y,
                   std=std, choice=[["phones", 1.0]], unnamed=True)  # fmt: skip
    # rule 10
    surely = [["phones", 1.0]]
    for name, nm, outcome in (("drift", 1.0, "unit_differs"), ("drift-slight", 0.5, "not said")):
        yield case(name, f"The blue curve has moved by {nm} nm since the previous shot: {outcome}.",
                   drifted(nm), k=2, forgiven=True, choice=surely, new=1, moved=nm)  # fmt: skip
    yield case("drift-white-patch", "Relative to the white patch, in a light that was not named: unit_differs.",
               drifted(1.5, white=18), k=2, white=18, forgiven=True, choice=surely, unnamed=True, new=1,
               moved=1.5)  # fmt: skip
    yield case("drift-by-white", "By the raw white the blue curve has moved by 2 nm, by the patches not: not said.",
               predicted(2), k=2, forgiven=True, choice=surely, new=1, moved=2.0)  # fmt: skip
    # rule 6 and the rest
    yield case("grain", "Half the noise that light must have: not_sensor_raw.", y, noise=0.5)
    yield case("texture", "Patches that vary inside: blurred.", y, texture=0.04)
    yield case("greens", "Two greens that differ.", y, greens=1.1)
    yield case("dirt", "A patch of outliers.", y, dead=(4, 0.2))
    yield case("dim", "A white at 5 % of the range.", y, level=0.05)
    yield case("haze", "An eighth of white in the darkest patch: doubtful.", 0.9 * y + 0.1)
    yield case("veil-refuses", "A quarter of white in the darkest patch: refused.", 0.7 * y + 0.3)
    yield case("few", "Nine patches, the others clipped.", y, used=9, clipped=0.5)
    yield case("few-dark", "Nine patches, the others lost in noise.", y, used=9)
    yield case("pose", "The answer explains the signals, but they are hardly the chart's colours: chart_unfit.",
               0.7 * y + 0.3 * y[::-1], forgiven=True)  # fmt: skip
    yield case("band-too-wide", "A band of ±0.15 of the peak.", y, std=0.0765)


def predicted(k: int = 1, white: int | None = None) -> Floats:
    """(24, 3) or (k, 24, 3) signals by the integrals of Eq. (5), to seven decimals."""
    R, s = chart("babelcolor"), camera(CAMERA)
    rho = np.ones(R.shape[1]) if white is None else R[white]
    found = np.stack([((R * lamp(name)) @ s) / ((rho * lamp(name)) @ s) for name in LAMPS[:k]])
    return np.round(found if k > 1 else found[0], 7)


def drifted(nm: float, white: int | None = None) -> Floats:
    """(2, 24, 3) signals of two shots; before the first, the blue curve has moved by so many nm to the red."""
    found, R = predicted(2, white), chart("babelcolor")
    light = lamp(LAMPS[0]) * np.interp(WAVELENGTHS - nm, WAVELENGTHS, camera(CAMERA)[:, 2])
    found[0, :, 2] = np.round(R @ light / ((1.0 if white is None else R[white]) * light).sum(), 7)
    return found


def slope(fall: float) -> Floats:
    """(24,) light that changes linearly along the rows, 1 in the middle."""
    return np.asarray(1.0 + fall * ((np.arange(24) % COLUMNS) / (COLUMNS - 1.0) - 0.5))


def ripple(size: float) -> Floats:
    """(24, 3): a pattern over all patches, different in each channel, that no explanation fits."""
    return np.asarray(1.0 + size * np.sin(7.0 * np.arange(24.0)[:, None] + 2.0 * np.arange(3.0)))


def spike(i: int, factor: float) -> Floats:
    """(24, 1): a factor on one patch."""
    return np.where(np.arange(24)[:, None] == i, factor, 1.0)


def case(
    name: str,
    comment: str,
    signals: Floats,
    *,
    k: int = 1,
    white: int | None = None,
    code: float = 2.0,
    std: float | None = 0.02,
    modes: bool = False,
    rivals: list[list[Any]] | None = None,
    tint: float = 0.0,
    second: bool = False,
    noise: float = 1.0,
    texture: float = 0.0,
    greens: float = 1.0,
    dead: tuple[int, float] = (0, 0.0),
    level: float = 1.0,
    used: int = 24,
    clipped: float = 0.0,
    forgiven: bool = False,
    error: float = 1.0,
    choice: list[list[Any]] | None = None,
    family: str | None = None,
    test: list[float | None] | None = None,
    fading: float = 0.0,
    known: int = 0,
    dark: bool = True,
    solved: bool = False,
    unnamed: bool = False,
    new: int = 0,
    moved: float = 0.0,
    basis: str = "cameras",
) -> Json:
    """The inputs of `judge`; the defaults are those of a clean capture.

    `basis` is that of the answer where there is no `choice`; "" is one of which nothing is known.

    `code` is xᵀ x, all in one entry. `std` is the standard deviation of the curves as a fraction of the peak, at all
    wavelengths. `forgiven`: the solution of each shot alone, or of a single shot, predicts its signals exactly.
    `known`: number of directions of the code with a variance of 0.1; all others have 0.99. `dark`: whether there is a
    dark frame. `solved`: whether gain modes were solved for. `unnamed`: whether the light is unnamed.
    `new`: number of shots before those of a previous result; 0 if there is none. `moved`: by so many nm has the blue
    curve moved before these, by their raw white.
    """
    y = np.round(signals if k > 1 else signals[None], 7)
    fitted = predicted(k, white)
    fitted = fitted if k > 1 else y if forgiven else fitted[None]
    span = level * SPAN
    frame = {
        "chart": statistics(y, span, noise, texture),
        "white": statistics(np.ones_like(y), span),
        "dark": statistics(np.zeros_like(y), span),
    }
    taken = np.ones((k, 24), dtype=bool)
    taken[:, used:] = False
    if white is not None:
        taken[:, white] = False
    shots = []
    for j in range(k):
        chart_means = {key: value[j].tolist() for key, value in frame["chart"].items()}
        chart_means["greens"] = [[upper, greens * lower] for upper, lower in chart_means["greens"]]
        chart_means["dead"] = np.where(np.arange(24)[:, None] == dead[0], dead[1], np.zeros((24, 3))).tolist()
        chart_means["clipped"] = np.where(np.arange(24)[:, None] >= used, clipped, np.zeros((24, 3))).tolist()
        rest = {role: {key: value[j].tolist() for key, value in frame[role].items()} for role in ("white", "dark")}
        shots.append({"chart": chart_means, "white": rest["white"] if white is None else None,
                      "dark": rest["dark"] if dark else None,
                      "black": [BLACK] * 3, "saturation": 16383.0})  # fmt: skip
    place = [[100.0 * (i % COLUMNS), 100.0 * (i // COLUMNS)] for i in range(24)]
    codes = [[0.0] * 3 for _ in range(24)]
    codes[0][0] = float(np.sqrt(code))
    curves = {"camera": CAMERA}
    peaks = camera(CAMERA).max(axis=0)
    band = None if std is None else {"bells": [[[float(std * peak), 550.0, 1e9]] for peak in peaks]}
    alone = [{"ssf": curves, "code": codes, "predicted": (y if forgiven else fitted).tolist()} for _ in range(k)]
    neutral = [[{"lamps": ["D55"]}, white_under("D55", tint)]] if tint else []
    if second:
        neutral.append([{"lamps": ["A"]}, white_under("A", 1.0)])
    white_levels = [[raw_white(level) if tint or not dark else [BLACK + span] * 3]] * k
    if new:
        white_levels = [[raw_white(level, name, moved if j < new else 0.0)] for j, name in enumerate(LAMPS[:k])]
    inputs: Json = {
        "reflectance": {"chart": "babelcolor", "patches": list(range(1, 25))},
        "chart_tolerance": {"constant": 0.03, "shape": [24]},
        "white_reflectance": {"constant": 1.0, "shape": [681]}
        if white is None
        else {"chart": "babelcolor", "patches": [white + 1]},
        "white_tolerance": 0.01 if white is None else 0.03,
        "lamp": {"lamps": list(LAMPS[:k])},
        "lamp_tolerance": [0.02] * k,
        "lamp_modes": {"polynomials": [[[0.0, 0.05]] if modes else []] * k},
        "signals": y.tolist(),
        "standard_error": np.round(error * (0.002 * y + 1e-4), 9).tolist(),
        "used": taken.tolist(),
        "white_is_patch": [white is not None] * k,
        "white": np.broadcast_to(white_levels, y.shape).tolist(),
        "dark": np.full(y.shape, BLACK).tolist(),
        "shots": shots,
        "centres": [place] * k,
        "ssf": curves,
        "ssf_std": band,
        "code": codes,
        "predicted": fitted.tolist(),
        "alone": alone if k > 1 else [],
        "rivals": rivals or [],
        "neutrals": [neutral] * k,
    }
    if known:
        inputs["code_variance"] = [0.1] * known + [0.99] * (72 - known)
    if solved:
        x, z = (np.arange(24) % COLUMNS - 2.5) / 2.5, (np.arange(24) // COLUMNS - 1.5) / 2.5
        ways = np.stack([0.2 * x, 0.2 * z, 0.3 * x**2, 0.3 * x * z, 0.3 * z**2])
        inputs |= {"gain_modes": [np.round(ways - ways[:, [18]], 9).tolist()] * k, "gain_own": 0.075}
    if unnamed:
        inputs["unnamed"] = True
    if new:
        inputs["new"] = new
    if choice is not None:
        inputs |= {"choice": choice, "family": family}
    elif basis:
        inputs["basis"] = basis
    if test is not None:
        inputs["family_test"] = test
    if fading:
        inputs["chart_fading"] = fading
    return contract.case(f"verdict/{name}", comment, inputs)


def raw_white(level: float, name: str = LAMPS[0], nm: float = 0.0) -> list[float]:
    """(3,) level of the white under a lamp in each channel, DN, with the blue curve moved by nm to the red."""
    curves = camera(CAMERA).copy()
    curves[:, 2] = np.interp(WAVELENGTHS - nm, WAVELENGTHS, curves[:, 2])
    seen = lamp(name) @ curves
    levels: list[float] = np.round(BLACK + level * SPAN * seen / seen.max(), 6).tolist()
    return levels


def white_under(light: str, tint: float) -> list[float]:
    """(3,) the camera's white under a light according to a colour matrix, with red wrong by the factor `tint`."""
    seen = lamp(light) @ camera(CAMERA) * np.array([tint, 1.0, 1.0])
    white: list[float] = np.round(seen / seen[1], 9).tolist()
    return white


def statistics(y: Floats, span: float, noise: float = 1.0, texture: float = 0.0) -> dict[str, Floats]:
    """(k, 24, 3) statistics of a photon counter: V = noise² (span² (y / WELL + 9 / WELL²) + (texture span y)²)."""
    variance = span**2 * (np.maximum(y, 0.0) / WELL + 9.0 / WELL**2)
    error = noise * np.sqrt((variance + (texture * span * y) ** 2) / COUNT)
    mean = np.round(BLACK + span * y, 6)
    still = np.zeros_like(mean)
    return {
        "mean": mean,
        "standard_error": np.round(error, 9),
        "count": np.full(mean.shape, COUNT),
        "clipped": still,
        "dead": still,
        "greens": mean[..., [1, 1]],
    }


def run(call: Call) -> dict[str, Any]:
    """The stage `verdict`: `camssf.verdict.judge.judge`, and the values that its rules 1 to 3 used."""
    given = call.given
    table = replace(build_table(given["reflectance"], 0.0, 18), tolerance=given["chart_tolerance"])
    used = np.array(given["used"], bool)
    signals = Signals(
        values=given["signals"], standard_error=given["standard_error"], chart=given["white"], white=given["white"],
        dark=given["dark"], used=used, white_is_patch=np.array(given["white_is_patch"], bool), assumptions=(),
    )  # fmt: skip
    lamps = [
        build_lamp(values, tolerance, modes)
        for values, tolerance, modes in zip(given["lamp"], given["lamp_tolerance"], given["lamp_modes"], strict=True)
    ]
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    poses = [
        Pose(layout="classic24", corners=square, patches=centres[:, None] + square, quarter_turns=0,
             method="by hand", score=1.0, notes=())
        for centres in given["centres"]
    ]  # fmt: skip
    rho = np.ravel(given["white_reflectance"])

    choice = tuple(
        Hypothesis(basis=basis, log_evidence=0.0, probability=probability)
        for basis, probability in given.get("choice", ())
    )
    basis = max(choice, key=lambda weight: weight.probability).basis if choice else given.get("basis", "golden")

    variance = given.get("code_variance")
    spread = None if variance is None else np.diag(np.array(variance, float))

    def answer(curves: Floats, code: Floats, predicted: Floats, std: Floats | None) -> Ssf:
        return Ssf(
            basis=basis,
            engine="golden",
            l2=1.0,
            gamma=np.zeros(3),
            values=curves,
            code=code,
            predicted=predicted,
            proof=Proof(gap=np.zeros(3), layers_gap=np.zeros(1), finish_steps=np.zeros(1, np.int64)),
            lamp=given["lamp"],
            gain_code=np.zeros((1, 0)),
            channel_gain=np.ones(3),
            std=std,
            code_covariance=None if std is None else np.eye(code.size) if spread is None else spread,
            log_evidence=None if std is None else 0.0,
            half_width_without_photo=half_width_of(prior_std(read_basis(basis))) if basis in LEARNED else None,
            chart_fading=given.get("chart_fading", 0.0),
            family_test=FamilyTest(*given["family_test"]) if "family_test" in given else None,
            choice=choice,
        )

    ssf = answer(given["ssf"], given["code"], given["predicted"], given["ssf_std"])
    alone = [answer(resolve(a["ssf"]), resolve(a["code"]), resolve(a["predicted"]), ssf.std) for a in given["alone"]]
    rivals = [Rival(shot=shot, lamp=name, gain=gain) for shot, name, gain in given["rivals"]]
    neutrals = [
        [Neutral(light=resolve(light)[0], white=np.array(white)) for light, white in of_shot]
        for of_shot in given["neutrals"]
    ]
    shots = [build_means(shot) for shot in given["shots"]]
    gains = None
    if "gain_modes" in given:
        gains = np.array(given["gain_modes"], float), float(given["gain_own"])
    inputs = VerdictInputs(
        signals=signals, table=table, means=shots, poses=poses, lamps=lamps,
        white_reference=(rho, given["white_tolerance"]), gains=gains,
    )  # fmt: skip
    drift = drift_probability(inputs, ssf, read_basis(basis), given["new"]) if "new" in given else None
    answers = [shot_answer(a, j) for j, a in enumerate(alone or [ssf] * len(shots))]
    tables = np.stack([each.values for each in tables_of_causes(table)])
    known = basis in LEARNED and ssf.std is not None

    def causes(j: int, tried: Sequence[Rival], witnesses: Collection[str]) -> Causes:
        gains_of_lamps = [rival.gain for rival in tried if rival.shot == j]
        return weigh_causes(inputs, j, answers[j], read_basis(basis), gains_of_lamps, tables, witnesses)

    judged = replace(inputs, causes=causes) if known else inputs
    verdict = judge_capture(judged, ssf, rivals=rivals, neutrals=neutrals, alone=alone, family=given.get("family"),
                            unnamed=[given.get("unnamed", False)] * len(shots), drift=drift)  # fmt: skip
    joint = inputs.goodness_of_fit(ssf)
    each = [inputs.goodness_of_fit_of_shot(j, a) for j, a in enumerate(answers)]
    known = known and int(used.sum()) >= FEWEST
    weighed = [causes(j, rivals, ()).probability.values() for j in range(len(shots))] if known else []
    found = [best_explanation(one) for one in each]
    return {
        "status": verdict.status,
        "codes": [reason.code for reason in verdict.reasons],
        "messages": [reason.message for reason in verdict.reasons],
        "advice": [reason.advice for reason in verdict.reasons],
        "fatal": [isinstance(reason, Fatal) for reason in verdict.reasons],
        "values": [float(reason.value or 0.0) for reason in verdict.reasons] or None,
        "thresholds": [float(reason.threshold or 0.0) for reason in verdict.reasons] or None,
        "checks": [f"{check.name} {check.beyond} {check.shot or 'whole'}" for check in verdict.checks],
        "checked": np.array([[check.value, check.limit, check.refuses or 0.0] for check in verdict.checks]),
        "named": [None if s is None else s.kind if s.patch is None else f"{s.kind} {s.patch}" for s in found],
        "residual": joint.residual,
        "prior": joint.prior,
        "count": joint.count,
        "z": np.array([joint.z, *(one.z for one in each)]),
        "gains": np.array([suspect.gain for one in each for suspect in one.explanations]),
        "causes": np.array([p for probabilities in weighed for p in probabilities]) if weighed else None,
    }


LIMITS = (
    *each("exact", 0.0, "status codes messages advice fatal checks"),
    *each("norm", 1e-9, "checked"),
    *each("exact", 0.0, "named"),
    *each("relative", 1e-8, "values"),
    *each("relative", 1e-15, "thresholds"),
    *each("relative", 1e-8, "residual"),
    *each("relative", 1e-12, "prior"),
    *each("exact", 0.0, "count"),
    *each("norm", 1e-8, "z gains causes"),
)


STAGE = Stage(
    name="verdict",
    keys=Keys(
        words(
            "reflectance chart_tolerance white_reflectance white_tolerance lamp lamp_tolerance lamp_modes signals "
            "standard_error used white_is_patch white dark shots centres ssf ssf_std code predicted alone rivals "
            "neutrals"
        ),
        words(
            "z status codes messages values thresholds gains fatal named residual prior count advice checks checked "
            "causes"
        ),
        words("choice family family_test chart_fading code_variance unnamed new gain_modes gain_own basis"),
        arrays=VERDICT_NUMBERS,
    ),
    requires=always("verdict"),
    cases=cases,
    run=run,
    limits=against_stored(LIMITS),
)
