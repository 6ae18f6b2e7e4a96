"""Converts one camera's signals to another camera's under a lamp, with their covariance.

As for standard colour, the lamp and both cameras' curves give the signals of 190 real surfaces. A matrix or a
root-polynomial that keeps white is fitted between the two sets; cross-validation chooses which.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from camssf.colorimetry import KINDS, fit, level, signals_of, terms, unseen
from camssf.errors import InvalidArgument
from camssf.grid import Floats
from camssf.spectra import LampLike
from camssf.spectra.bundled import surfaces
from camssf_colour.camera import Camera, ColourCamera, as_camera
from camssf_colour.light import Light
from camssf_colour.reach import distances
from camssf_colour.spread import Reference, checked_signals, metamers, of_reference, outer, signal_moves
from camssf_colour.standard import PARTS, lights

WHITE: Floats = np.ones(3)
WHITE.setflags(write=False)
DIGITS = 9
"""Two kinds whose errors agree to this many decimals count as equal; the one with fewer terms is used."""


@dataclass(frozen=True)
class Conversion:
    """A transform of one camera's white-balanced signals to another's, under a lamp.

    Attributes:
        lamp: its name.
        kind: one of `camssf_colour.KINDS`.
        coefficients: (p, 3) for the target's red, green, blue; each column sums to 1, so white stays white.
        matrix: (3, 3) coefficients of kind "matrix", for formats that hold only a matrix.
        rms: root mean square error of each kind in cross-validation; white is 1.
        signals: (n, 3) of the surfaces.
        residual: (n, 3) error of the chosen kind in cross-validation, divided by `level`.
        whites: (2, 3) raw signals of white under the lamp relative to green, of the source and of the target camera;
            NaN where a camera's own white is not known.
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
        """Signals (..., 3) of the target camera; white is 1, 1, 1 in both."""
        return terms(signals, self.kind) @ self.coefficients


@dataclass(frozen=True)
class Converted:
    """m signals of one camera, converted to another's.

    Attributes:
        signals: (m, 3), white-balanced.
        covariance: (m, 3, 3).
        parts: the terms of the covariance by name (`camssf_colour.PARTS`), (m, 3, 3) each; "curves" is for both
            cameras.
        lamps: names of the lamps that were compared, and their weights.
        conversions: for each lamp, in that order.
        reach: (m,) distance of the source's signals from those that any surface can give, in standard deviations.
        chi_squared: χ² of the reference's ratios under the likeliest lamp; None if they were not used.
    """

    signals: Floats
    covariance: Floats
    parts: dict[str, Floats]
    lamps: tuple[tuple[str, float], ...]
    conversions: tuple[Conversion, ...]
    reach: Floats
    chi_squared: float | None


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
    """Convert one camera's signals to those of another camera in the same light.

    The errors of the two cameras' curves are assumed independent. If both are the same result, the errors are the
    same and cancel: the conversion is then the identity.

    Args:
        source: the camera that measured the signals: a result, the excerpt of one, or a Camera.
        target: the camera to convert to.
        lamp: as in `standard_colour`.
        signals, standard_error: as in `standard_colour`; (0, 3) if only the conversion is needed.
        reference: the white or grey surface that the raw signals were divided by.
        kind: of transform; chosen by cross-validation unless given.

    Raises:
        InvalidArgument: invalid values; "auto" without a reference, or a camera without its own white; curves from
            which no conversion can be computed.
        LampUnfit: the reference's raw ratios contradict the lamp.
    """
    if kind is not None and kind not in KINDS:
        raise InvalidArgument(f"There is no transform {kind!r}.", f"Take one of {', '.join(KINDS)}.")
    given = reference or Reference()
    source, target = as_camera(source), as_camera(target)
    y, error = checked_signals(signals, standard_error)
    try:
        with np.errstate(all="ignore"):  # the results are checked below
            seen = lights(source, lamp, given)
            answers = [_converted(light, source, target, y, error, given, kind) for light in seen]
            evidence = np.array([light.log_evidence for light in seen])
            weights = np.exp(evidence - evidence.max())
            mixed = _mixed(answers, weights / weights.sum())
    except np.linalg.LinAlgError as fault:
        raise _nothing() from fault
    if not (np.isfinite(mixed.signals).all() and np.isfinite(mixed.covariance).all()):
        raise _nothing()
    if not all(np.isfinite(conversion.coefficients).all() for conversion in mixed.conversions):
        raise _nothing()
    return mixed


def _nothing() -> InvalidArgument:
    return InvalidArgument(
        "No conversion between the two cameras could be computed under this lamp.",
        "Check the curves and the lamp; calibrate with better photos.",
    )


def _converted(
    light: Light, source: Camera, target: Camera, y: Floats, error: Floats, given: Reference, kind: str | None
) -> Converted:
    """The signals converted under one lamp."""
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
        (conversion,), distances(y, spread, light), light.chi_squared,
    )  # fmt: skip


def _conversion(light: Light, source: Camera, target: Camera, other: Floats, kind: str | None) -> Conversion:
    """Fit the conversion to the surfaces; cross-validation chooses the kind."""
    for curves in (light.curves, other):
        seen = light.power @ curves
        if not (np.isfinite(seen).all() and (seen > 0).all()):
            raise InvalidArgument(
                "A curve has no response to this lamp.", "Check the lamp's spectrum, and the curves."
            )
    y, aim = (signals_of(surfaces(), light.power, curves) for curves in (light.curves, other))
    predicted = {kind: unseen(y, aim, WHITE, kind) for kind in KINDS}
    rms = {kind: float(np.sqrt(np.mean((converted - aim) ** 2))) for kind, converted in predicted.items()}
    best = kind or min(KINDS, key=lambda each: (round(rms[each], DIGITS), KINDS[each]))
    fits = {kind: fit(y, aim, WHITE, kind) for kind in {best, "matrix"}}
    whites = np.stack([_white(camera, light.power) for camera in (source, target)])
    residual = (predicted[best] - aim) / level(y)
    return Conversion(light.name, best, fits[best], fits["matrix"], rms, y, residual, whites)


def _white(camera: Camera, power: Floats) -> Floats:
    if camera.own is None:
        return np.full(3, np.nan)
    raw = camera.own.raw * (power @ camera.values) / (camera.own.lamp.values @ camera.values)
    return np.asarray(raw / raw[1])


def _steps(light: Light, other: Floats, modes: Floats | None, y: Floats, kind: str) -> Floats:
    """Change of the result (K, m, 3) by one standard deviation of each error: lamp, source curves, target curves.

    `modes` (q, 681, 3) are those of the target's curves; None if source and target are the same.
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
    """Mix the answers by the law of total variance; their differences count as lamp error."""
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
        answers[int(weights.argmax())].chi_squared,
    )
