"""Poses the fit of a capture: the observation that `recover` takes, of all its patches or of some."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from numbers import Integral

import numpy as np
from numpy.typing import NDArray

from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS, Floats
from camssf.options import Options
from camssf.photo.capture import Capture
from camssf.photo.find.pose import Pose
from camssf.photo.signals import Signals, normalise
from camssf.recovery.basis import Basis
from camssf.recovery.hypotheses import AUTO, MAKER
from camssf.recovery.observation import Observation
from camssf.recovery.raw_white import given_raw_white
from camssf.recovery.rows import levels
from camssf.recovery.sensitivity import Ssf
from camssf.rules import rules
from camssf.spectra import Called, ChartTable, Lamp, Unnamed, read_lamp
from camssf.spectra.layouts import ChartLayout
from camssf.spectra.lights import PossibleLamps, unnamed_light

FEWEST_PATCHES = 3
"""Smallest number of patches for a fit."""
WHITE_TOLERANCE = rules().number("calibration.white_tolerance")
"""Relative error of a white frame's reflectance."""


@dataclass(frozen=True)
class CaptureFit:
    """A capture and how it is fitted.

    Attributes:
        capture: the measured shots.
        signals: Eq. (5); `used` marks the usable patches among the allowed ones.
        allowed: (n,) the patches that may enter the fit.
        options: of the fit.
        basis, prior_scale: basis, and width of its prior; "auto" until `conditioned_on` sets it.
    """

    capture: Capture
    signals: Signals
    allowed: NDArray[np.bool_]
    options: Options
    basis: str | Basis
    prior_scale: float = 1.0

    @cached_property
    def gains(self) -> tuple[Floats, float]:
        """Gain modes (k, g, n) of all patches, and the size of each channel's own part relative to them.

        A basis without a prior has no modes: there the fit has no errors but those of the signals, and the verdict
        must not allow for others.
        """
        modes, own = gain_modes(self.capture, self.options.light_per_patch)
        return (modes[:, :0], 0.0) if self.exact else (modes, own)

    def level(self, ssf: Ssf) -> Floats:
        """1 - ĥ (k, n): the factor that corrects the signals to even light, by the gains of `ssf`."""
        return np.asarray(levels(ssf.gain_code, self.gains[0]))

    def levelled(self, ssf: Ssf) -> Signals:
        """The signals corrected to even light."""
        level = self.level(ssf)[:, :, None]
        return replace(
            self.signals, values=level * self.signals.values, standard_error=level * self.signals.standard_error
        )

    def conditioned_on(self, ssf: Ssf) -> CaptureFit:
        """The fit with basis, width, kinds of light and chart that `ssf` found, for fits to parts of the capture."""
        if not ssf.choice:
            return self
        posed = (self.with_kinds(ssf.kinds) if ssf.kinds else self).with_chart_of(ssf)
        basis = ssf.basis if self.basis == AUTO else self.basis
        return replace(posed, basis=basis, prior_scale=ssf.prior_scale)

    def with_chart_of(self, ssf: Ssf) -> CaptureFit:
        """The fit with the chart as faded as `ssf` found it."""
        return self.with_chart(self.capture.chart.faded(ssf.chart_fading))

    def with_chart(self, chart: ChartTable) -> CaptureFit:
        """The same signals, explained by another table of the chart."""
        return replace(self, capture=replace(self.capture, chart=chart))

    def with_kinds(self, kinds: Sequence[str]) -> CaptureFit:
        """The fit with these kinds of light, one a shot; "" keeps a shot's lamp."""
        shots = []
        for shot, kind in zip(self.capture.shots, kinds, strict=True):
            possible = shot.lamp.lamps if isinstance(shot.lamp, PossibleLamps) else ()
            shots.append(replace(shot, lamp=next((lamp for lamp in possible if lamp.name == kind), shot.lamp)))
        return replace(self, capture=replace(self.capture, shots=tuple(shots)))

    def of_shot(self, j: int) -> CaptureFit:
        """The fit of shot j alone."""
        shot = self.capture.shots[j : j + 1]
        return replace(self, capture=replace(self.capture, shots=shot), signals=self.signals.of_shot(j))

    def with_tables(self) -> CaptureFit:
        """The fit with the lamps as they were called: the table of a name, the one lamp of a kind."""
        shots = [
            replace(shot, lamp=read_lamp(shot.lamp.name)) if isinstance(shot.lamp, Called) else shot
            for shot in self.capture.shots
        ]
        return replace(self, capture=replace(self.capture, shots=tuple(shots)))

    def with_light_unnamed(self) -> CaptureFit:
        """The fit as if no lamp had been named."""
        shots = tuple(replace(shot, lamp=unnamed_light()) for shot in self.capture.shots)
        return replace(self, capture=replace(self.capture, shots=shots)).with_raw_white()

    def with_raw_white(self) -> CaptureFit:
        """The fit with each light's possible lamps narrowed by the raw white and the file's colour matrices."""
        rho, _ = self.white_reference()
        shots = []
        for j, shot in enumerate(self.capture.shots):
            white = self.signals.raw_white(j)
            if isinstance(shot.lamp, Called | Unnamed) and np.isfinite(white).all():
                matrices = [(matrix.kelvin, matrix.to_raw) for matrix in shot.photo.colour_matrices]
                shot = replace(shot, lamp=given_raw_white(shot.lamp, white, matrices, rho))
            shots.append(shot)
        return replace(self, capture=replace(self.capture, shots=tuple(shots)))

    @property
    def unnamed(self) -> tuple[bool, ...]:
        """Whether the light of each shot is not named."""
        return tuple(isinstance(shot.lamp, Unnamed) for shot in self.capture.shots)

    @property
    def uncertain(self) -> tuple[bool, ...]:
        """Whether the light of each shot may be one of several lamps: it was not named, or by a name only."""
        return tuple(isinstance(shot.lamp, PossibleLamps) for shot in self.capture.shots)

    @property
    def prior_odds(self) -> dict[str, float]:
        """Prior odds of the bases from the maker and model in the photo's metadata."""
        photo = self.capture.shots[0].photo
        return prior_odds(photo.make, photo.model)

    @property
    def lamps(self) -> list[Lamp]:
        """Each shot's lamp, if all are certain or set by `with_kinds`."""
        lamps = [shot.lamp for shot in self.capture.shots]
        assert not any(self.uncertain)
        return [lamp for lamp in lamps if isinstance(lamp, Lamp)]

    def white_reference(self) -> tuple[Floats, float]:
        """ρ_w (681,) and its tolerance: the white frame's target, or the chart's own white patch."""
        table = self.capture.chart
        if self.capture.shots[0].means.white is None:
            return table.values[table.white], float(table.tolerance[table.white])
        share = 1.0 if self.capture.white_reflectance is None else self.capture.white_reflectance
        return np.full(WAVELENGTHS.size, share), WHITE_TOLERANCE

    @property
    def exact(self) -> bool:
        """Whether the basis has no prior: the paper's Eq. (10) has no errors but those of the signals."""
        return self.basis == "gaussian" or (isinstance(self.basis, Basis) and not self.basis.prior)

    def given(self, used: NDArray[np.bool_]) -> Observation:
        """The input of `recover`, `predict` and `explain`: the patches that at least one shot uses."""
        signals, table, taken = self.signals, self.capture.chart, used.any(axis=0)
        exact, (gains, own) = self.exact, self.gains
        rho, white_tolerance = self.white_reference()
        return Observation(
            signals=signals.values[:, taken],
            reflectance=table.values[taken],
            lamp=np.stack([lamp.values for lamp in self.lamps]),
            standard_error=signals.standard_error[:, taken],
            used=used[:, taken],
            chart_tolerance=np.zeros(1) if exact else table.tolerance[taken],
            white_reflectance=rho,
            white_tolerance=white_tolerance,
            lamp_tolerance=np.array([lamp.tolerance for lamp in self.lamps]),
            lamp_modes=lamp_modes(self.lamps),
            gain_modes=gains[:, :, taken],
            gain_own=own,
            frames=(signals.chart[:, taken], signals.white[:, taken], signals.dark[:, taken]),
        )


def prepare_fit(capture: Capture, options: Options, left_out: int | None = None) -> CaptureFit:
    """The fit of a whole capture, without the patch `left_out`, 0-based, if one does not match its table.

    Raises:
        InvalidArgument: patches that the chart does not have, fewer than FEWEST_PATCHES of them usable, or
            `light_per_patch` outside (0, 1] or with a basis without a prior.
        CalibrationError: as `normalise`.
    """
    differs = options.light_per_patch
    number = isinstance(differs, int | float) and not isinstance(differs, bool)
    if differs is not None and not (number and 0.0 < differs <= 1.0):
        raise InvalidArgument(f"`light_per_patch` must lie between 0 and 1; got {differs}.", "Write 8 % as 0.08.")
    allowed = _patches_to_fit(options.fit, len(capture.chart.patches))
    signals = normalise([shot.means for shot in capture.shots], capture.chart)
    signals = replace(signals, used=signals.used & allowed & (np.arange(allowed.size) != left_out))
    count = int(signals.used.any(axis=0).sum())
    if count < FEWEST_PATCHES:
        raise InvalidArgument(
            f"Only {count} patches are left for the fit.", "Name more patches to fit, or leave the list out."
        )
    fit = CaptureFit(capture, signals, allowed, options, options.basis)
    fit = fit.with_tables() if fit.exact else fit.with_raw_white()
    if differs is not None and fit.exact:
        raise InvalidArgument(
            "The basis has no prior, so light that differs between patches cannot be estimated.",
            "Choose the basis auto, phones or cameras.",
        )
    return fit


def prior_odds(make: str, model: str) -> dict[str, float]:
    """Prior odds by basis: MAKER if maker and model start with one of its entries in the rules' `makers`."""
    name = f"{make} {model}".casefold()
    return {
        basis: MAKER for basis, makers in rules().makers.items() if any(name.startswith(maker) for maker in makers)
    }


def _patches_to_fit(fit: Sequence[int] | None, n: int) -> NDArray[np.bool_]:
    """Mask (n,) of the patches with these 1-based numbers."""
    if fit is None:
        return np.ones(n, dtype=bool)
    try:
        numbers = list(fit)
    except TypeError as error:
        raise InvalidArgument(
            f"{fit!r} is no list of patches.", "Give the patches' numbers, as range(7, 19)."
        ) from error
    if not numbers or not all(isinstance(i, Integral) and 1 <= int(i) <= n for i in numbers):
        raise InvalidArgument(
            f"The patches of this chart are numbered 1 to {n}; got {numbers[:30]}.",
            "Give some of these numbers, or leave the list out to fit all patches.",
        )
    mask = np.zeros(n, dtype=bool)
    mask[np.array(numbers, dtype=int) - 1] = True
    return mask


def lamp_modes(lamps: Sequence[Lamp]) -> Floats:
    """(k, q, 681): every lamp's modes, padded with zeros to the largest number of modes."""
    q = max(len(lamp.modes) for lamp in lamps)
    modes = np.zeros((len(lamps), q, WAVELENGTHS.size))
    for j, lamp in enumerate(lamps):
        modes[j, : len(lamp.modes)] = lamp.modes
    return modes


# Gain modes: uneven light on the patches without a white frame (docs/maths.md, "Light that falls unevenly")

PLANE, BOWL = rules().number("gains.plane"), rules().number("gains.bowl")
"""One standard deviation of the light's linear and quadratic change, from the chart's middle to its edge."""
CORNER = rules().number("gains.corner")
"""One standard deviation of the light on the white patch, in addition to plane and bowl."""
OWN = rules().number("gains.own")
"""Size of each channel's own part relative to the gain modes: lenses shade colours a little differently."""


def gain_modes(capture: Capture, per_patch: float | None) -> tuple[Floats, float]:
    """Gain modes (k, g, n) of a capture's patches, and the size of each channel's own part relative to them.

    With a white frame the light on every patch is known, so there are no modes. Without one the chart's white patch
    is the reference for all, and modes are relative to it: X and Y, X², XY and Y², and the white patch's own level,
    each minus its value at the white patch.

    Args:
        capture: k shots of n patches.
        per_patch: relative difference of the light from patch to patch, one standard deviation, if each patch was
            photographed separately: one mode a patch; without a white frame the white patch's gain is in all others.
            None if the patches were in one photo.
    """
    white, shots, n = capture.chart.white, capture.shots, len(capture.chart.patches)
    framed = shots[0].means.white is not None
    if per_patch is not None:
        modes = patch_modes(n, per_patch, None if framed else white)
        return np.repeat(modes[None], len(shots), axis=0), 0.0
    if framed:
        return np.zeros((len(shots), 0, n)), 0.0
    layout = capture.chart.layout
    return np.stack([smooth_modes(shot.pose, layout, white) * (not shot.means.evened) for shot in shots]), OWN


def patch_modes(n: int, size: float, white: int | None) -> Floats:
    """(g, n) one gain a patch; that of patch `white`, the reference of all, is common to all the others."""
    if white is None:
        return size * np.eye(n)
    modes = np.concatenate([np.delete(np.eye(n), white, axis=0), np.ones((1, n))])
    modes[:, white] = 0.0
    return size * modes


def smooth_modes(pose: Pose, layout: ChartLayout, white: int) -> Floats:
    """(g, n) plane, bowl and the white patch's own level over the patches of one photo, relative to patch `white`.

    The level exists only if the white patch is at the chart's edge: inside, plane and bowl describe its light too.
    """
    X, Y = places(pose).T
    ways = [PLANE * X, PLANE * Y, BOWL * X**2, BOWL * X * Y, BOWL * Y**2]
    if white % layout.columns in (0, layout.columns - 1) or white // layout.columns in (0, layout.rows - 1):
        ways.append(-CORNER * (np.arange(len(X)) == white))
    modes = np.stack(ways)
    return np.asarray(modes - modes[:, [white]])


def places(pose: Pose) -> Floats:
    """(n, 2) positions of the patches in the photo: 0 at their middle, from -1 to 1 along the longer side."""
    centres = pose.patches.mean(axis=1)
    low, high = centres.min(axis=0), centres.max(axis=0)
    return np.asarray((2.0 * centres - (low + high)) / max(float((high - low).max()), 1.0))
