"""The stage `verdict`: a case for each rule of `camssf.verdict.judge`, in plain numbers."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from functools import cache
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from camssf.grid import Floats
from camssf.photo.signals import Signals
from camssf.recovery.basis import LEARNED, read_basis
from camssf.verdict.cause import BY_WHITE, tables_of_causes, weigh_causes
from camssf.verdict.cause_groups import Causes
from camssf.verdict.goodness_of_fit import FEWEST, VerdictInputs, best_explanation, shot_answer
from camssf.verdict.judge import judge as judge_capture
from camssf.verdict.lamp import Neutral, Rival
from camssf.verdict.reasons import Fatal
from camssf.verdict.unit_drift import drift_probability
from golden import contract
from golden.contract import Call, Stage, words
from golden.forms import Json, resolve
from golden.plain_captures import (
    BLACK,
    COLUMN,
    COUNT,
    FAMILY,
    PATCH,
    PHONE,
    SURE,
    band,
    capture,
    chosen,
    code,
    drifted,
    predicted,
    processed,
    raw_white,
    ripple,
    rivals,
    spike,
    test,
    tinted,
    unknown,
)
from golden.products import build_answer, build_lamp, build_means, build_table, judgement, pose_by_hand
from golden.scenes import gain_modes

Row: TypeAlias = tuple[str, str, Json, str]
"""Name, comment, inputs as the clean capture's with a change, and the expected status with the reasons' codes."""
MINOR = 0.022
"""Glare as a fraction of white, of a case that it does not explain completely."""
SLIP = 1.19
"""Factor on one patch that makes it the best explanation while the goodness of fit stays acceptable."""
UNNAMED: Json = {"unnamed": True}


def rows() -> list[Row]:
    """All cases."""
    y, framed, two = predicted(), predicted(white=18), predicted(k=2)
    x = (COLUMN[:, None] - 2.5) / 2.5
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
    return [
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
        ("black-level-slight", "A black level too high by 0.08 % of the range.",
         capture(y - 0.0008 * black, dark=False), "accepted"),
        ("veil-no-dark-slight", "No dark frame; 1.5 % of white: glare is likelier than a wrong black level.",
         capture(0.985 * y + 0.015, dark=False), "doubtful glare"),
        ("white-colour", "A white frame in another light: a factor for each channel.",
         capture(y * np.array([1.15, 1.0, 0.85])), "doubtful frames_differ"),
        ("light", "Light that falls off along the rows.", capture(y * slope), "doubtful uneven_light"),
        ("light-white-patch", "The same without a white frame: the level is free.",
         capture(framed * slope / slope[18], white=18), "doubtful uneven_light"),
        ("tone", "A tone curve, y^0.9.", capture(y**0.9), "doubtful not_sensor_raw"),
        ("patch", "One wrong patch is named.", capture(y * spike(13, 1.4)), "doubtful chart_unfit"),
        ("gloss", "Reflections, more on some patches than on others.",
         capture(y + 0.02 * (1 + uneven)), "doubtful glare"),
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
        ("rival", "Another lamp fits better.", clean | rivals((0, "FL2", -12), (0, "A", 5)), "doubtful lamp_unfit"),
        ("other-lamp-weak", "It fits a little better.", clean | rivals((0, "A", 3), (0, "FL2", -2)), "accepted"),
        ("other-lamp-refuses", "Another lamp fits so much better that the named one is impossible.",
         clean | rivals((0, "FL2", -900), (0, "A", 20)), "refused lamp_unfit"),
        ("rival-beyond-numbers", "The exponential of the gain overflows; the probability does not.",
         clean | rivals((0, "FL2", 900), (0, "A", 1500)), "refused lamp_unfit"),
        ("rival-of-the-refused", "A refused capture is not compared with other lamps.",
         capture(0.7 * y + 0.3) | rivals((0, "A", 20)), "refused glare glare"),
        ("rival-of-two", "Another lamp fits one of two shots better: the shot is named.",
         capture(two) | rivals((0, "A", 1), (1, "D55", 9), (1, "FL2", 8)), "doubtful lamp_unfit"),
        ("tint", "The raw white is a quarter off the matrix's.", clean | tinted(1.3), "doubtful lamp_unfit"),
        ("tint-unnamed", "The same where the light is unnamed.", clean | tinted(1.3) | PHONE | UNNAMED, "accepted"),
        ("tint-unnamed-far", "Unnamed light, and the raw white differs by more than half.",
         clean | tinted(1.7) | PHONE | UNNAMED, "doubtful lamp_unfit"),
        ("tint-other-matrix", "One of two matrices is right.", clean | tinted(1.3, second=True), "accepted"),
        ("rival-and-tint", "A lamp that fits better, and the raw white differs, too.",
         clean | tinted(1.3) | rivals((0, "FL2", -12), (0, "A", 5)), "refused lamp_unfit lamp_unfit"),
        # another camera
        ("choice-other-maker", "The maker makes cameras; P(phone) = 0.96.",
         clean | chosen(0.96, 0.04, "cameras"), "doubtful camera_unusual"),
        ("choice-no-maker", "The same where the file names no maker.", clean | chosen(0.96, 0.04), "accepted"),
        ("choice-faded", "Only a faded chart explains the signals.",
         clean | FAMILY | test(-0.5, 0.1, 0.05) | {"chart_fading": 0.2}, "doubtful chart_unfit"),
        ("choice-unusual-length", "The code is longer than that of any clean phone.",
         clean | FAMILY | test(0.7, 0.1, 0.05), "doubtful camera_unusual"),
        ("choice-unusual-lamp", "The lamp residual is too large: another light than named, or another camera.",
         clean | FAMILY | test(-2.0, 3.5, 0.05), "doubtful camera_unusual"),
        ("choice-usual", "Length and lamp residual are just below their limits.",
         clean | FAMILY | test(0.04, 0.79, 0.05), "accepted"),
        ("choice-unusual-unnamed", "Unnamed light: there is no lamp residual, and the code is too long.",
         clean | FAMILY | test(0.4, None, 0.3) | UNNAMED, "doubtful camera_unusual"),
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
        ("grain", "Half the noise that photons make.", capture(y, noise=0.5), "doubtful not_sensor_raw"),
        ("mixed", "A colour's noise follows others' photons by a tenth.", processed(0.1), "doubtful not_sensor_raw"),
        ("mixed-unsure", "The same, by so few samples that it is not sure.", processed(0.1, 60), "accepted"),
        ("mixed-unknown", "By fewer it is not judged, and the samples were smoothed.",
         processed(0.1, 25, like=(0.13, 0.01)), "doubtful not_sensor_raw"),
        ("demosaiced", "Neighbours of different colours share noise.",
         processed(unlike=(-0.05, 0.005)), "doubtful not_sensor_raw"),
        ("demosaiced-unsure", "The same with few pairs: not sure.", processed(unlike=(-0.05, 0.015)), "accepted"),
        ("texture", "Patches that vary inside.", capture(y, texture=0.04), "doubtful blurred"),
        ("greens", "The two greens differ.", capture(y, greens=1.1), "doubtful not_sensor_raw"),
        ("dirt", "A fifth of one patch's samples are outliers.", capture(y, dead=(4, 0.2)), "doubtful chart_unfit"),
        ("dim", "A white at 5 % of the range.", capture(y, level=0.05), "doubtful underexposed"),
        ("haze", "10 % of white: the misfit refuses.", capture(0.9 * y + 0.1), "refused glare glare"),
        ("few", "Nine patches, the others clipped.", capture(y, used=9, clipped=0.5), "doubtful overexposed"),
        ("few-dark", "Nine patches, the others lost in noise.", capture(y, used=9), "doubtful underexposed"),
        ("pose", "The answer explains the signals, but they are hardly the chart's colours.",
         capture(0.7 * y + 0.3 * y[::-1], exact=True), "doubtful chart_unfit"),
        ("band-too-wide", "A band of ±0.15 of the peak.", clean | band(0.0765), "doubtful bands_too_wide"),
        ("mixed-uneven", "Two patches are dusty; green has too few samples to be judged, blue just enough.",
         noisy(1.0 + 0.1 * uneven + 1.5 * np.isin(PATCH, (3, 10))[:, None], (20_000, 4, 6)),
         "accepted"),
        ("mixed-quiet", "Rounding hides the noise of half of the patches: red is judged, green is not.",
         noisy(np.array([3.2e-5, 3.7e-5, 2.8e-4]), 20_000, 1.0 / 12.0), "doubtful not_sensor_raw not_sensor_raw"),
    ]  # fmt: skip


def noisy(factor: Floats, count: ArrayLike, rounding: float = 0.0) -> Json:
    """A photo whose colours were mixed by a tenth; its samples' variances (24, 3) times a factor, DN²."""
    made, counts = processed(0.1), np.broadcast_to(count, (24, 3))
    (shot,) = made["shots"]
    variance = COUNT * shot["chart"]["standard_error"] ** 2 * factor + rounding
    chart = shot["chart"] | {"count": counts, "standard_error": np.round(np.sqrt(variance / counts), 9)}
    return made | {"shots": [shot | {"chart": chart}]}


def cases() -> Iterator[Json]:
    """All cases."""
    for name, comment, inputs, outcome in rows():
        given = {key: value for key, value in inputs.items() if key != "basis" or value is not None}
        status, *codes = outcome.split()
        yield contract.case(f"verdict/{name}", comment, given, outputs={"status": status, "codes": codes})


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
    inputs = VerdictInputs(
        signals=signals,
        table=table,
        means=[build_means(shot) for shot in given["shots"]],
        poses=[pose_by_hand(centres[:, None] + square, square) for centres in given["centres"]],
        lamps=lamps,
        white_reference=(np.ravel(given["white_reflectance"]), given["white_tolerance"]),
        gains=(np.array(given["gain_modes"], float), float(given["gain_own"])) if "gain_modes" in given else None,
    )
    ssf = build_answer(given, given)
    alone = [build_answer(given, {name: resolve(value) for name, value in one.items()}) for one in given["alone"]]
    rivals = [Rival(shot=shot, lamp=name, gain=gain) for shot, name, gain in given["rivals"]]
    neutrals = [
        [Neutral(light=resolve(light)[0], white=np.array(white)) for light, white in of_shot]
        for of_shot in given["neutrals"]
    ]
    shots = range(len(given["shots"]))
    basis: Any = read_basis(ssf.basis) if ssf.basis in LEARNED else None
    answers = [shot_answer(answer, j) for j, answer in enumerate(alone or [ssf] * len(shots))]
    tables = np.stack([table.values for table in tables_of_causes(table)])

    @cache
    def weighed_causes(j: int, gains: tuple[float, ...], witnesses: frozenset[str]) -> Causes:
        return weigh_causes(inputs, j, answers[j], basis, gains, tables, witnesses)

    def causes(j: int, tried: Sequence[Rival], witnesses: Collection[str]) -> Causes:
        return weighed_causes(j, tuple(rival.gain for rival in tried if rival.shot == j), frozenset(witnesses))

    known = ssf.basis in LEARNED and ssf.std is not None
    verdict = judge_capture(
        replace(inputs, causes=causes) if known else inputs,
        ssf,
        rivals=rivals,
        neutrals=neutrals,
        alone=alone,
        family=given.get("family"),
        unnamed=[given.get("unnamed", False) for _ in shots],
        drift=drift_probability(inputs, ssf, basis, given["new"]) if "new" in given else None,
    )
    joint, single = inputs.goodness_of_fit(ssf), [inputs.goodness_of_fit_of_shot(j, answers[j]) for j in shots]
    enough = known and int(used.sum()) >= FEWEST
    weighed = [p for j in shots if enough for w in ((), BY_WHITE) for p in causes(j, rivals, w).probability.values()]
    suspects = [best_explanation(fit) for fit in single]
    return judgement(verdict) | {
        "fatal": [isinstance(reason, Fatal) for reason in verdict.reasons],
        "checks": [f"{check.name} {check.beyond} {check.shot or 'whole'}" for check in verdict.checks],
        "checked": np.array([[check.value, check.limit, check.refuses or 0.0] for check in verdict.checks]),
        "named": [None if s is None else s.kind if s.patch is None else f"{s.kind} {s.patch}" for s in suspects],
        "residual": joint.residual,
        "prior": joint.prior,
        "count": joint.count,
        "z": np.array([joint.z, *(fit.z for fit in single)]),
        "gains": np.array([suspect.gain for fit in single for suspect in fit.explanations]),
        "causes": np.array(weighed) if weighed else None,
    }  # fmt: skip


STAGE = Stage(
    name="verdict",
    requires="verdict",
    cases=cases,
    run=run,
    inputs=words(
        "reflectance chart_tolerance white_reflectance white_tolerance lamp lamp_tolerance lamp_modes signals "
        "standard_error used white_is_patch white dark shots centres ssf ssf_std code predicted alone rivals neutrals"
    ),
    optional=words("choice family family_test chart_fading code_variance unnamed new gain_modes gain_own basis"),
    arrays=words(
        "reflectance chart_tolerance white_reflectance lamp lamp_modes signals standard_error white dark centres ssf "
        "ssf_std code predicted"
    ),
    limits=(
        ("exact", 0.0, "status codes messages advice fatal checks"),
        ("norm", 1e-9, "checked"),
        ("exact", 0.0, "named"),
        ("relative", 1e-8, "values"),
        ("relative", 1e-15, "thresholds"),
        ("relative", 1e-8, "residual"),
        ("relative", 1e-12, "prior"),
        ("exact", 0.0, "count"),
        ("norm", 1e-8, "z gains causes"),
    ),
)
