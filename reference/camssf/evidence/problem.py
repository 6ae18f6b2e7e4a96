"""Capture and options → problem: what `recover` is asked of a capture, for the whole of it and for parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from numbers import Integral
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camssf.curves.basis import Basis
from camssf.curves.choice import AUTO, CLEAR, recover
from camssf.curves.evidence import Evidence
from camssf.curves.light import Guess, recover_in_any_light
from camssf.curves.predict import predict
from camssf.curves.sensing import levels
from camssf.curves.ssf import Ssf, respond
from camssf.errors import InvalidArgument
from camssf.evidence.gains import gain_modes
from camssf.grid import WAVELENGTHS, Floats
from camssf.options import Options
from camssf.photo.capture import Capture, listed
from camssf.photo.signals import Signals, normalise
from camssf.rules import rules
from camssf.spectra import Lamp, Unnamed

FEWEST_PATCHES = 3
"""Below which nothing is fitted."""
MOST_UNNAMED = rules().whole("lamp.most")
"""Shots whose light nobody named."""
WHITE_TOLERANCE = rules().number("calibration.white_tolerance")
"""Relative error of a white frame's reflectance."""


@dataclass(frozen=True)
class Problem:
    """A capture to be solved.

    Attributes:
        capture: the measured shots.
        signals: Eq. (5); `used` are the usable patches among those that were asked for.
        asked: (n,) the patches that may enter the fit.
        options: how to solve.
        basis, prior_scale: on what; "auto" until an answer has settled it.
    """

    capture: Capture
    signals: Signals
    asked: NDArray[np.bool_]
    options: Options
    basis: str | Basis
    prior_scale: float = 1.0

    @cached_property
    def gains(self) -> tuple[Floats, float]:
        """Gain modes (k, g, n) of all patches, and what part of them each channel has for itself.

        None on a basis without a prior, which knows of no error but the signals': what is not solved for there must
        not be excused by the verdict either.
        """
        modes, own = gain_modes(self.capture, self.options.light_per_patch)
        return (modes[:, :0], 0.0) if self.exact else (modes, own)

    def level(self, ssf: Ssf) -> Floats:
        """1 - ĥ (k, n): times this, signals are what the answer says that even light would have given."""
        return levels(ssf.gain_code, self.gains[0])

    def levelled(self, ssf: Ssf) -> Signals:
        """The signals as even light would have given them."""
        level = self.level(ssf)[:, :, None]
        return replace(
            self.signals, values=level * self.signals.values, standard_error=level * self.signals.standard_error
        )

    def settled(self, ssf: Ssf) -> Problem:
        """The same problem on the basis, and in the light, that gave the answer: parts are held against these."""
        if not ssf.choice:
            return self
        posed = self.lit(ssf.kinds) if ssf.kinds else self
        return replace(posed, basis=ssf.basis if self.basis == AUTO else self.basis, prior_scale=ssf.prior_scale)

    def lit(self, kinds: Sequence[str]) -> Problem:
        """The same problem with every light of that kind; "" leaves the lamp that was named."""
        shots = []
        for shot, kind in zip(self.capture.shots, kinds, strict=True):
            of_kind = shot.lamp.kinds if isinstance(shot.lamp, Unnamed) else ()
            shots.append(replace(shot, lamp=next((lamp for lamp in of_kind if lamp.name == kind), shot.lamp)))
        return replace(self, capture=replace(self.capture, shots=tuple(shots)))

    @property
    def unnamed(self) -> tuple[bool, ...]:
        """Of each shot, whether nobody named its light."""
        return tuple(isinstance(shot.lamp, Unnamed) for shot in self.capture.shots)

    @property
    def believed(self) -> dict[str, float]:
        """What the file's own words for maker and model say of the basis beforehand: odds, never a proof."""
        photo = self.capture.shots[0].photo
        return believed(photo.make, photo.model)

    @property
    def lamps(self) -> list[Lamp]:
        """Each shot's, where all are named or settled."""
        lamps = [shot.lamp for shot in self.capture.shots]
        assert not any(self.unnamed)
        return [lamp for lamp in lamps if isinstance(lamp, Lamp)]

    def white_reference(self) -> tuple[Floats, float]:
        """ρ_w (681,) and its tolerance: the white frame's target, or the chart's own white patch."""
        table = self.capture.chart
        if self.capture.shots[0].means.white is None:
            return table.values[table.white], float(table.tolerance[table.white])
        share = 1.0 if self.capture.white_reflectance is None else self.capture.white_reflectance
        return np.full(WAVELENGTHS.size, share), WHITE_TOLERANCE

    def solve(self, used: NDArray[np.bool_], gamma: ArrayLike | None) -> Ssf:
        """`recover` on the used patches (k, n); the answer predicts all of them."""
        options = self.options
        how: dict[str, Any] = {
            "basis": self.basis, "prior_scale": self.prior_scale, "prior": self.believed,
            "l2": options.l2, "gamma": gamma, "nonnegative": options.nonnegative, "engine": options.engine,
        }  # fmt: skip
        table = self.capture.chart.values
        if any(self.unnamed):
            return recover_in_any_light(self._guesses(used), of=table, **how)
        ssf, (rho, _) = recover(self.given(used), **how), self.white_reference()
        return replace(ssf, predicted=respond(ssf.values, table, ssf.lamp, rho))

    def _guesses(self, used: NDArray[np.bool_]) -> list[Guess]:
        """All that the unnamed lights may be."""
        if sum(self.unnamed) > MOST_UNNAMED:
            raise InvalidArgument(
                f"The light of {sum(self.unnamed)} shots was not named; at most {MOST_UNNAMED} can be told at once.",
                "Name the lamp of the others, at least its kind: daylight, bulb, white-led or fluorescent.",
            )
        kinds = product(*(
            [lamp.name for lamp in shot.lamp.kinds] if isinstance(shot.lamp, Unnamed) else [""]
            for shot in self.capture.shots
        ))  # fmt: skip
        return [Guess(each, self.lit(each).given(used)) for each in kinds]

    def solve_alone(self) -> list[Ssf]:
        """The answer to each shot alone; none where there is one."""
        k = len(self.capture.shots)
        shots = np.eye(k, dtype=bool)[:, :, None] if k > 1 else ()
        return [self.solve(self.signals.used & shot, self.options.gamma) for shot in shots]

    def bands(self, used: NDArray[np.bool_], ssf: Ssf) -> Floats | None:
        """(k, n, 3) how far every patch's true signal may lie from what a fit to the used ones predicts."""
        if ssf.std is None:
            return None
        table, taken = self.capture.chart, used.any(axis=0)
        others, tolerance = table.values[~taken], table.tolerance[~taken]
        given = self.given(used)
        modes = self.gains[0][:, :, ~taken]
        found = predict(ssf, given, of=others, of_tolerance=tolerance, of_gains=modes, basis=self.basis).std
        std = np.empty_like(self.signals.values)
        std[:, taken], std[:, ~taken] = found[:, : taken.sum()], found[:, taken.sum() :]
        return std

    @property
    def exact(self) -> bool:
        """Is it the paper's basis? Eq. (10) knows of no error but the signals'."""
        return self.basis == "gaussian" or (isinstance(self.basis, Basis) and not self.basis.prior)

    def given(self, used: NDArray[np.bool_]) -> Evidence:
        """What `recover`, `predict` and `explain` take: the patches that some shot may use."""
        signals, table, taken = self.signals, self.capture.chart, used.any(axis=0)
        exact, (gains, own) = self.exact, self.gains
        rho, white_tolerance = self.white_reference()
        return Evidence(
            signals=signals.values[:, taken],
            reflectance=table.values[taken],
            lamp=np.stack([lamp.values for lamp in self.lamps]),
            standard_error=signals.standard_error[:, taken],
            used=used[:, taken],
            chart_tolerance=np.zeros(1) if exact else table.tolerance[taken],
            white_reflectance=rho,
            white_tolerance=white_tolerance,
            lamp_tolerance=np.array([lamp.tolerance for lamp in self.lamps]),
            lamp_modes=_modes(self.lamps),
            gain_modes=gains[:, :, taken],
            gain_own=own,
            frames=(signals.chart[:, taken], signals.white[:, taken], signals.dark[:, taken]),
        )


def pose_problem(capture: Capture, options: Options) -> Problem:
    """The problem of a whole capture.

    Raises:
        InvalidArgument: patches that the chart does not have, fewer than FEWEST_PATCHES of them usable, or light
            that is said to differ by nothing, or by all, from patch to patch.
        CalibrationError: what `normalise` refuses.
    """
    differs = options.light_per_patch
    number = isinstance(differs, int | float) and not isinstance(differs, bool)
    if differs is not None and not (number and 0.0 < differs <= 1.0):
        raise InvalidArgument(f"Light cannot differ by {differs} from patch to patch.", "Write 8 % as 0.08.")
    asked = _asked(options.fit, len(capture.chart.patches))
    signals = normalise([shot.means for shot in capture.shots], capture.chart)
    signals = replace(signals, used=signals.used & asked)
    count = int(signals.used.any(axis=0).sum())
    if count < FEWEST_PATCHES:
        raise InvalidArgument(
            f"Only {count} patches are left for the fit.", "Name more patches by --fit, or leave it out."
        )
    problem = Problem(capture, signals, asked, options, options.basis)
    if differs is not None and problem.exact:
        raise InvalidArgument(
            "The basis has no prior, so it has no place for light that differs from patch to patch.",
            "Take --basis auto, phones or cameras.",
        )
    return problem


def believed(make: str, model: str) -> dict[str, float]:
    """By basis the odds that maker and model speak for it; who makes both is told by the model's first letters."""
    name = f"{make} {model}".casefold()
    return {
        basis: CLEAR for basis, makers in rules().makers.items() if any(name.startswith(maker) for maker in makers)
    }


def _asked(fit: Sequence[int] | None, n: int) -> NDArray[np.bool_]:
    """The patches named by 1-based numbers, (n,)."""
    if fit is None:
        return np.ones(n, dtype=bool)
    numbers = listed("fit", fit)
    if not numbers or not all(isinstance(i, Integral) and 1 <= int(i) <= n for i in numbers):
        raise InvalidArgument(
            f"The patches of this chart are numbered 1 to {n}; got {numbers[:30]}.",
            "Give their numbers, as range(7, 19) or [1, 4]; --fit 7-18 on the command line.",
        )
    mask = np.zeros(n, dtype=bool)
    mask[np.array(numbers, dtype=int) - 1] = True
    return mask


def _modes(lamps: Sequence[Lamp]) -> Floats:
    """(k, q, 681): every lamp's modes, filled up with zeros to the longest list."""
    q = max(len(lamp.modes) for lamp in lamps)
    modes = np.zeros((len(lamps), q, WAVELENGTHS.size))
    for j, lamp in enumerate(lamps):
        modes[j, : len(lamp.modes)] = lamp.modes
    return modes
