"""Two cameras and a lamp → what one would have seen of what the other saw, with what is not known of it.

As for standard colour the lamp and both cameras' curves give the signals of 190 real surfaces; between the two sets
stands a matrix or a root-polynomial that keeps white, whichever misses less on surfaces left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from camssf.colour.camera import Camera, ColourCamera, as_camera
from camssf.colour.light import Light
from camssf.colour.reach import distances
from camssf.colour.spread import Reference, checked_signals, metamers, of_reference, outer, signal_moves
from camssf.colour.standard import PARTS, lights
from camssf.colour.transforms import KINDS, fit, level, signals_of, terms, unseen
from camssf.errors import InvalidArgument
from camssf.grid import Floats
from camssf.spectra import LampLike
from camssf.spectra.surfaces import surfaces

WHITE: Floats = np.ones(3)
WHITE.setflags(write=False)
DIGITS = 9
"""Kinds that miss equally to so many decimals are equal: the one with fewer terms is taken."""


@dataclass(frozen=True)
class Conversion:
    """White-balanced signals of one camera to another's, under a lamp.

    Attributes:
        lamp: its name.
        kind: of `camssf.colour.KINDS`.
        coefficients: (p, 3) of the other's red, green, blue; each column sums to 1, so white stays white.
        matrix: (3, 3) the same of kind "matrix", for formats that hold no more.
        rms: root mean square of what each kind misses on surfaces that the fit had not seen; white is 1.
        signals: (n, 3) of the surfaces.
        residual: (n, 3) what the chosen kind misses on each, over `level`.
        whites: (2, 3) raw signals of white under the lamp relative to green, of the one and of the other camera; NaN
            where nothing ties a camera's channels together.
    """

    lamp: str
    kind: str
    coefficients: Floats
    matrix: Floats
    rms: dict[str, float]
    signals: Floats
    residual: Floats
    whites: Floats

    def apply(self, signals: Floats) -> Floats:
        """Signals (..., 3) of the other camera; white is 1, 1, 1 in both."""
        return terms(signals, self.kind) @ self.coefficients


@dataclass(frozen=True)
class Converted:
    """m signals as the other camera would have given them.

    Attributes:
        signals: (m, 3), white-balanced.
        covariance: (m, 3, 3).
        parts: what it is the sum of, of `camssf.colour.PARTS`, (m, 3, 3) each; "curves" are both cameras'.
        lamps: names of the lamps that were weighed, and their weights.
        conversions: of each lamp, in that order.
        reach: (m,) how far the signals lie from those that any surface gives the one camera, in standard deviations.
        surprise: χ² of the reference's ratios under the likeliest lamp; None where they were not asked.
    """

    signals: Floats
    covariance: Floats
    parts: dict[str, Floats]
    lamps: tuple[tuple[str, float], ...]
    conversions: tuple[Conversion, ...]
    reach: Floats
    surprise: float | None


def convert(
    source: ColourCamera,
    target: ColourCamera,
    lamp: LampLike,
    signals: ArrayLike,
    standard_error: ArrayLike = 0.0,
    *,
    reference: Reference | None = None,
    kind: str | None = None,
) -> Converted:
    """Signals of one camera as another would have given them in the same light.

    The two cameras' errors are taken to be independent, unless both are the same result: then they are the same
    errors, and the conversion is the identity without any.

    Args:
        source: that the signals are of: a result, its document, or a Camera.
        target: that they are wanted of.
        lamp: as in `standard_colour`.
        signals, standard_error: as in `standard_colour`; (0, 3) where the conversion alone is wanted.
        reference: what was divided by.
        kind: of transform; chosen by cross-validation unless given.

    Raises:
        InvalidArgument: values that do not fit; "auto" without a reference, or a camera without its own white; curves
            that carry no colour.
        LampUnfit: the reference's raw ratios contradict the lamp.
    """
    if kind is not None and kind not in KINDS:
        raise InvalidArgument(f"There is no transform {kind!r}.", f"Take one of {', '.join(KINDS)}.")
    given = reference or Reference()
    source, target = as_camera(source), as_camera(target)
    y, error = checked_signals(signals, standard_error)
    try:
        with np.errstate(all="ignore"):  # what came out is checked
            seen = lights(source, lamp, given)
            answers = [_converted(light, source, target, y, error, given, kind) for light in seen]
            evidence = np.array([light.log_evidence for light in seen])
            weights = np.exp(evidence - evidence.max())
            found = _mixed(answers, weights / weights.sum())
    except np.linalg.LinAlgError as fault:
        raise _nothing() from fault
    if not (np.isfinite(found.signals).all() and np.isfinite(found.covariance).all()):
        raise _nothing()
    if not all(np.isfinite(each.coefficients).all() for each in found.conversions):
        raise _nothing()
    return found


def _nothing() -> InvalidArgument:
    return InvalidArgument(
        "Nothing leads from the one camera to the other under this lamp.",
        "Check the curves and the lamp; calibrate with better photos.",
    )


def _converted(
    light: Light, source: Camera, target: Camera, y: Floats, error: Floats, given: Reference, kind: str | None
) -> Converted:
    """Under one lamp."""
    shared = np.array_equal(source.values, target.values) and np.array_equal(source.modes, target.modes)
    other = light.curves if shared else target.values
    conversion = _conversion(light, source, target, other, kind)
    steps = _steps(light, other, None if shared else target.modes, y, conversion.kind)
    p = light.of_lamp

    def by_signal(moves: Floats) -> Floats:
        return outer(0.5 * (conversion.apply(y + moves) - conversion.apply(y - moves)))

    parts = {
        "curves": outer(steps[p:]),
        "lamp": outer(steps[:p]),
        "noise": by_signal(error[None] * np.eye(3)[:, None]),
        "reference": by_signal(y * of_reference(light, given)[:, None]),
        "metamers": metamers(conversion.signals, conversion.residual, y),
    }
    spread = np.einsum("kmc,kmd->mcd", *[signal_moves(y, error, light, given)] * 2)
    return Converted(
        conversion.apply(y), np.sum([parts[name] for name in PARTS], axis=0), parts, ((light.name, 1.0),),
        (conversion,), distances(y, spread, light), light.surprise,
    )  # fmt: skip


def _conversion(light: Light, source: Camera, target: Camera, other: Floats, kind: str | None) -> Conversion:
    """Fitted to the surfaces; the kind by what it misses on those left out."""
    for curves in (light.curves, other):
        seen = light.power @ curves
        if not (np.isfinite(seen).all() and (seen > 0).all()):
            raise InvalidArgument(
                "A curve has no response to this lamp.", "Check the lamp's spectrum, and the curves."
            )
    y, aim = (signals_of(surfaces(), light.power, curves) for curves in (light.curves, other))
    foretold = {each: unseen(y, aim, WHITE, each) for each in KINDS}
    rms = {each: float(np.sqrt(np.mean((found - aim) ** 2))) for each, found in foretold.items()}
    best = kind or min(KINDS, key=lambda each: (round(rms[each], DIGITS), KINDS[each]))
    fits = {each: fit(y, aim, WHITE, each) for each in {best, "matrix"}}
    whites = np.stack([_white(camera, light.power) for camera in (source, target)])
    residual = (foretold[best] - aim) / level(y)
    return Conversion(light.name, best, fits[best], fits["matrix"], rms, y, residual, whites)


def _white(camera: Camera, power: Floats) -> Floats:
    if camera.own is None:
        return np.full(3, np.nan)
    raw = camera.own.raw * (power @ camera.values) / (camera.own.lamp.values @ camera.values)
    return np.asarray(raw / raw[1])


def _steps(light: Light, other: Floats, modes: Floats | None, y: Floats, kind: str) -> Floats:
    """How the answer (K, m, 3) moves by one standard deviation of each error: lamp, source's curves, target's.

    `modes` (q, 681, 3) are the target's own; None where its curves are the source's, errors and all.
    """
    power, curves = light.power_modes, light.curve_modes
    if modes is None:
        others = curves
    else:
        none = np.zeros((len(modes), *power.shape[1:]))
        others = np.concatenate([np.zeros((len(power), *modes.shape[1:])), modes])
        curves = np.concatenate([curves, np.zeros(modes.shape)])
        power = np.concatenate([power, none])
    if not len(power):
        return np.zeros((0, *y.shape))
    table, rows, sides = surfaces(), terms(y, kind), []
    for sign in (1.0, -1.0):
        lit = np.maximum(light.power + sign * power, 0.0)[:, :, None]
        sensed, aim = (
            np.einsum("nm,kmc->knc", table, seen, optimize=True) / seen.sum(axis=1)[:, None]
            for seen in (lit * (light.curves + sign * curves), lit * (other + sign * others))
        )
        sides.append(rows @ fit(sensed, aim, np.ones((len(aim), 3)), kind))
    return np.asarray(0.5 * (sides[0] - sides[1]))


def _mixed(answers: Sequence[Converted], weights: Floats) -> Converted:
    """One answer of several, by the law of total variance; what they differ by belongs to the lamp."""
    if len(answers) == 1:
        return answers[0]

    def mean(values: Sequence[Floats]) -> Floats:
        return np.asarray(np.tensordot(weights, np.stack(values), axes=1))

    signals = mean([answer.signals for answer in answers])
    parts = {name: mean([answer.parts[name] for answer in answers]) for name in PARTS}
    parts["lamp"] = parts["lamp"] + mean([outer((answer.signals - signals)[None]) for answer in answers])
    return Converted(
        signals,
        np.sum([parts[name] for name in PARTS], axis=0),
        parts,
        tuple((answer.lamps[0][0], float(weight)) for answer, weight in zip(answers, weights, strict=True)),
        tuple(answer.conversions[0] for answer in answers),
        np.min([answer.reach for answer in answers], axis=0),
        answers[int(weights.argmax())].surprise,
    )
