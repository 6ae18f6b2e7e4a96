"""The first section of the page: camera, time, verdict with its checks, uncertainty budget, signature."""

from __future__ import annotations

import math
from dataclasses import dataclass

from markupsafe import Markup

from camssf.documents.document import Answer, Document
from camssf.documents.unnamed_light import lamp_name
from camssf.grid import WAVELENGTHS
from camssf.photo.read.unit import Unit
from camssf.recovery.sensitivity import half_widths_of
from camssf.report.provenance import Provenance
from camssf.report.sections.curves import curves_of
from camssf.report.sections.text import brief, camera_name, number
from camssf.rules import rules
from camssf.verdict.reasons import Check, Verdict

UNKNOWN = "not stated"
_LIKE = (
    "The curves are like those that the basis was learned from.",
    "The curves are unlike those that the basis was learned from.",
)
_UNIT = ("The unit is as in its previous result.", "The blue curve has moved since the previous result.")
_LAMP = (
    "A smooth error of the named lamp would explain little more.",
    "A smooth error of the named lamp would explain the signals better.",
)
_WHITE = ("The white fits the colour matrix in the file.", "The white does not fit the colour matrix in the file.")
_VEIL = ("The darkest patch is dark: little stray light.", "The darkest patch is too bright: stray light.")
_RIVAL = ("No other lamp fits clearly better than the named one.", "Another lamp fits better than the named one.")
_PHONE = ("By its signals this is a phone.", "The signals do not tell the light from the camera.")
CHECK_SENTENCES = {
    "explanation": (
        "No single fault explains what the curves do not.",
        "A single fault explains what the curves do not.",
    ),
    "black": (
        "No stray light and no wrong black level shows.",
        "Stray light or a wrong black level would explain more.",
    ),
    "goodness_of_fit": (
        "The curves explain the signals within their errors.",
        "The curves do not explain the signals within their errors.",
    ),
    "misfit_refuses": ("The misfit is small enough for an answer.", "The misfit is too large for any answer."),
    "dark_white": ("The white is bright enough.", "The white is too dark."),
    "veil": _VEIL,
    "veil_refuses": _VEIL,
    "few_patches": ("Enough patches could be used.", "Too few patches could be used."),
    "dirty": ("The patches are clean.", "A patch is dirty, or reflects the lamp."),
    "greens": ("The sensor's two green channels agree.", "The sensor's two green channels differ."),
    "poor_pose": ("The patches look like this chart's.", "The patches do not look like this chart's."),
    "white_balance_mismatch": _WHITE,
    "white_balance_mismatch_unnamed": _WHITE,
    "band_too_wide": ("The band is narrow enough.", "The band is too wide."),
    "other_makers": ("The camera is like others of its maker.", "The camera is unlike others of its maker."),
    "unnamed": _PHONE,
    "unnameable": _PHONE,
    "band_ratio": ("The photo has narrowed the band.", "The photo has narrowed the band too little."),
    "band_ratio_typical": ("The photo has narrowed the band.", "The photo has hardly narrowed the band."),
    "improbable_curves": _LIKE,
    "unusual_phone": _LIKE,
    "unusual_phone_unnamed": _LIKE,
    "unusual_camera": _LIKE,
    "smooth": ("The noise is that of a sensor's own samples.", "There is less noise than in a sensor's own samples."),
    "mixed": (
        "Each colour's noise is that of its own photons.",
        "A colour's noise follows the other colours' photons: a program has mixed them.",
    ),
    "demosaiced": (
        "Neighbours of different colours share no noise.",
        "Neighbours of different colours share noise: the samples were demosaiced.",
    ),
    "smoothed": ("Next samples share no noise.", "Next samples share noise: they were smoothed."),
    "rough": ("Each patch is even.", "A patch is uneven: texture, dirt or a reflection."),
    "rival": _RIVAL,
    "other_lamp_refuses": _RIVAL,
    "lamp_residual": _LAMP,
    "lamp_residual_camera": _LAMP,
    "unit_drift": _UNIT,
    "unit_drift_unnamed": _UNIT,
    "chart_fading": ("The chart has kept its colours.", "The chart has faded."),
}
"""A sentence for each check of the verdict: if it holds, and if it does not."""
MARKS = {
    "accepted": ("✓", "Accepted", "Every check passed."),
    "doubtful": ("!", "Doubtful", "The curves are usable with the reservations below."),
    "refused": ("✕", "Refused", "This capture cannot carry an answer, so there are no curves."),
}


@dataclass(frozen=True)
class Fact:
    """A term and its value."""

    term: str
    text: str


def facts_of(document: Document, provenance: Provenance) -> tuple[Fact, ...]:
    """The facts at the top of the certificate."""
    capture, answer, signature = document.capture, document.answer, provenance.signature
    lights = () if capture is None else capture.lights
    passport = signature.passport if signature else None
    unit = passport.unit.filled(provenance.unit) if passport else provenance.unit
    serials = (passport.lamp_serials if passport else ()) or ("",) * len(lights)
    lamps = [
        lamp_name(light) + (f", serial {serial}" if serial else "")
        for light, serial in zip(lights, serials, strict=False)
    ]
    table = "not read" if capture is None else f"{capture.chart.name}, table {capture.chart.table}"
    if passport and passport.chart_serial:
        table += f", serial {passport.chart_serial}"
    captured = [passport.captured] if passport and passport.captured else list(dict.fromkeys(provenance.captured))
    valid = "unsigned" if answer is not None else "no, it was refused"
    if passport:
        valid = f"{_day(passport.begins.isoformat())} to {_day(passport.ends.isoformat())}"
    return (
        Fact("Camera", camera_name(document)),
        Fact("Unit", _unit(unit)),
        Fact("Lens", _lens(unit)),
        Fact("Photographed", ", ".join(_time(time) for time in captured if time) or UNKNOWN),
        Fact("Valid", valid),
        Fact("Lamp" if len(lights) < 2 else f"Lamps ({len(lights)} shots)", " + ".join(lamps) or "not known"),
        Fact("Chart", table),
        Fact("Basis", "none" if answer is None else f"{answer.basis}, {answer.engine} engine"),
    )


def _unit(unit: Unit) -> str:
    parts = [f"serial {unit.serial}" if unit.serial else "", unit.camera_id]
    return ", ".join(filter(None, parts)) or UNKNOWN


def _lens(unit: Unit) -> str:
    parts = [
        unit.lens,
        f"{unit.focal_length:g} mm" if unit.focal_length else "",
        f"f/{unit.aperture:g}" if unit.aperture else "",
    ]
    return ", ".join(filter(None, parts)) or UNKNOWN


def _time(text: str) -> str:
    """The time by the camera's clock, with its UTC offset if the file states one."""
    return text.replace("T", " ").removesuffix("+00:00") + (" UTC" if text.endswith("+00:00") else "")


def _day(text: str) -> str:
    return text[:10]


# Numbers


def big_numbers(answer: Answer) -> tuple[tuple[Markup, Markup], ...]:
    """The main numbers, each with its description."""
    scores = answer.scores
    numbers = [
        (number(math.fsum(scores.rmsre_percent) / 3) + Markup(" %"), "RMSRE: relative error on unseen patches"),
        (number(scores.delta_e00, 2), Markup("ΔE<sub>00</sub> between measured and predicted patches")),
    ]
    if answer.uncertainty is not None:
        text = Markup(f"± {answer.uncertainty.half_width:.3f}")
        numbers.insert(0, (text, "mean half-width of the 95 % band, 400 to 700 nm"))
    if scores.rmse is not None:
        numbers.insert(0, (number(math.fsum(scores.rmse) / 3, 2), "RMSE against the truth (peak = 1)"))
    return tuple((Markup(value), Markup(text)) for value, text in numbers)


# Checks


@dataclass(frozen=True)
class Held:
    """One number of a check.

    Attributes:
        shot: from 1; None for the capture as a whole.
        value, limit, margin: as text; margin is the distance to the limit, negative beyond it.
        refuses: the limit beyond which the capture is refused; "" if there is none, or if it equals `limit`.
        state: "held", "doubtful" or "refused".
    """

    shot: int | None
    value: Markup
    limit: Markup
    margin: Markup
    refuses: Markup
    state: str


@dataclass(frozen=True)
class CheckRow:
    """One check of the verdict: a sentence, its number with the unit, each shot's value, and the worst state."""

    sentence: str
    what: str
    by_shot: tuple[Held, ...]
    state: str


STATES = ("held", "doubtful", "refused")


def checks_of(verdict: Verdict) -> tuple[CheckRow, ...]:
    """All checks of the verdict, those of the whole capture first; empty if an earlier stage refused."""
    by_name: dict[str, list[Held]] = {}
    for check in verdict.checks:
        by_name.setdefault(check.name, []).append(_held(check))
    checks = []
    for name, by_shot in by_name.items():
        rule = rules().numbers.get(f"verdict.{name}")
        what = name if rule is None else rule.what
        if rule is not None and rule.unit != "1" and rule.unit not in what:
            what += f", {rule.unit}"
        state = max((one.state for one in by_shot), key=STATES.index)
        held, broken = CHECK_SENTENCES.get(name, (what, what))
        checks.append(CheckRow(held if state == "held" else broken, what, tuple(by_shot), state))
    return tuple(sorted(checks, key=lambda check: check.by_shot[0].shot is not None))


def _held(check: Check) -> Held:
    value, limit, refuses, above = check.value, check.limit, check.refuses, check.beyond == "above"
    margin = limit - value if above else value - limit
    gone = refuses is not None and (value > refuses if above else value < refuses)
    return Held(
        check.shot,
        brief(value) if float(value).is_integer() else number(value),
        Markup("\u2264 " if above else "\u2265 ") + brief(limit),
        number(margin, 2),
        Markup("") if refuses is None or refuses == limit else brief(refuses),
        "held" if margin >= 0 else "refused" if gone else "doubtful",
    )


# Budget


@dataclass(frozen=True)
class Budget:
    """The uncertainty budget by source; `alone` states the band of each single shot in words."""

    rows: tuple[tuple[str, str, tuple[str, ...]], ...]
    alone: str


def budget_of(document: Document) -> Budget | None:
    """The budget of a result; None if it was refused, or for a basis without a prior."""
    uncertainty = None if document.answer is None else document.answer.uncertainty
    if uncertainty is None or document.capture is None:
        return None
    rows = tuple(
        (term.source, term.size, tuple(f"{100 * share:.0f} %" for share in term.share)) for term in uncertainty.budget
    )
    words = ""
    if uncertainty.alone:
        names = [lamp_name(light) for light in document.capture.lights]
        alone = ", ".join(f"{name} ± {width:.3f}" for name, width in zip(names, uncertainty.alone, strict=False))
        bought = 1.0 - uncertainty.half_width / min(uncertainty.alone) if min(uncertainty.alone) > 0 else 0.0
        gain = f"narrow the best single shot's band by {100 * bought:.0f} %"
        words = (
            f"All shots together: ± {uncertainty.half_width:.3f} of the peak on average. Each alone: {alone}. "
            f"The other shots {gain if bought > 0 else 'do not narrow the band of the best single one'}."
        )
    return Budget(rows, words)


# The channels


def channels_of(document: Document, answer: Answer) -> tuple[str, tuple[tuple[str, tuple[Markup, ...]], ...]]:
    """A caption, and rows of numbers for red, green and blue."""
    scores, curves = answer.scores, curves_of(document)
    rows: list[tuple[str, list[Markup]]] = [
        ("Peak, nm", [Markup(f"{WAVELENGTHS[k]:.1f}") for k in curves.ssf.argmax(axis=0)]),
        ("RMSRE on unseen patches, %", [number(v) for v in scores.rmsre_percent]),
        ("Channel gain, relative to green", [number(v, 4) for v in answer.channel_gain]),
        ("Penalty γ (l1)", [brief(v) for v in answer.gamma]),
    ]
    if answer.std is not None:
        std = answer.std.values / answer.curves.values.max(axis=0)
        widths = [Markup(f"{width:.3f}") for width in half_widths_of(std)]
        rows.insert(1, ("Mean half-width of the 95 % band, 400 to 700 nm", widths))
    caption = f"Unseen patches: {scores.unseen}. Quadratic penalty λ₂ = {brief(answer.l2)}."
    return caption, tuple((name, tuple(cells)) for name, cells in rows)
