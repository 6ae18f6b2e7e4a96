"""Computes signals from patch means by Eq. (5), (chart − dark) / (white − dark)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from camssf.errors import InvalidArgument
from camssf.grid import Floats
from camssf.messages import fail
from camssf.photo.patches import PatchMeans
from camssf.rules import rules
from camssf.shapes import Text
from camssf.spectra import ChartTable

CLIPPED = rules().number("signals.clipped")
"""Largest share of clipped samples in a usable patch or white frame."""
FAINT = rules().number("signals.faint")
"""Fraction of the sensor's range that the white signal must reach in every channel."""
NOISY = rules().number("signals.noisy")
"""Largest relative standard error of the white signal."""
LOST = rules().number("signals.lost")
"""A patch whose signal is below this many standard errors in any channel is lost in noise."""
FEWEST = rules().whole("signals.fewest")
"""Smallest number of usable patches in every shot."""


@dataclass(frozen=True)
class Assumption:
    """A fallback or choice on which the result relies.

    Attributes:
        code: identifies it.
        message: a sentence.
    """

    code: Text
    message: Text


@dataclass(frozen=True)
class Signals:
    """Signals y of k shots. Columns are R, G, B.

    Attributes:
        values: (k, n, 3) y, 1.
        standard_error: (k, n, 3) standard error of y, 1, propagated from the frames' standard errors.
        chart, white, dark: (k, n, 3) DN: the inputs of Eq. (5), with fallbacks filled in.
        used: (k, n) False where a patch must not enter the fit (clipped, lost in noise, or the white itself).
        white_is_patch: (k,) True where the chart's white patch replaces the white frame.
        assumptions: the fallbacks used.
    """

    values: Floats
    standard_error: Floats
    chart: Floats
    white: Floats
    dark: Floats
    used: NDArray[np.bool_]
    white_is_patch: NDArray[np.bool_]
    assumptions: tuple[Assumption, ...]

    def of_shot(self, j: int) -> Signals:
        """Those of shot j."""
        arrays = ("values", "standard_error", "chart", "white", "dark", "used", "white_is_patch")
        return replace(self, **{name: getattr(self, name)[j : j + 1] for name in arrays})

    def raw_white(self, j: int) -> Floats:
        """Raw white (3,) of shot j above dark, the mean over its used patches; NaN if it has none."""
        used = self.used[j]
        return np.asarray((self.white[j] - self.dark[j])[used].mean(axis=0)) if used.any() else np.full(3, np.nan)


def normalise(shots: Sequence[PatchMeans], table: ChartTable) -> Signals:
    """Divide every patch signal by the white signal at its place: the paper's Eq. (5), y = (C - D) / (W - D).

    Standard errors, with b = W - D, from ∂y/∂C = 1/b, ∂y/∂W = -y/b, ∂y/∂D = (y - 1)/b:
    se_y² = (se_C² + y² se_W² + (y - 1)² se_D²) / b². The frames' errors are independent of each other.

    Fallbacks, each named in `assumptions`:
    no dark frame: D is the file's black level, se_D = 0;
    no white frame: the chart's white patch w replaces it for all patches, b = C_w - D_w, row w is not used, and
    se_y² = (se_C² + se_D² + y² (se_Cw² + se_Dw²)) / b², because patch w has its own dark signal. `white` is
    then C_w - D_w + D, so that Eq. (5) holds for the stored arrays.

    Args:
        shots: k shots of one chart, (n, 3) each.
        table: of that chart; `table.white` is its white patch.

    Raises:
        InvalidArgument: no shot, or a number of patches that differs from the table's.
        Overexposed: the white is clipped, or clipping leaves fewer than 6 patches.
        Underexposed: the white signal is too weak or too noisy, or noise leaves fewer than 6 patches.
        FramesDiffer: the dark frame is brighter than the white frame.
    """
    if not shots:
        raise InvalidArgument("No shot was given.", "Give at least one photo of the chart.")
    rows = [_shot(shot, table, number) for number, shot in enumerate(shots, 1)]
    values, error, chart, white, dark, used = (np.stack([row[i] for row in rows]) for i in range(6))
    return Signals(
        values=values,
        standard_error=error,
        chart=chart,
        white=white,
        dark=dark,
        used=used.astype(np.bool_),
        white_is_patch=np.array([shot.white is None for shot in shots]),
        assumptions=tuple(a for number, shot in enumerate(shots, 1) for a in _assumptions(shot, table, number)),
    )


def _shot(shot: PatchMeans, table: ChartTable, number: int) -> tuple[NDArray[np.generic], ...]:
    """y, its standard error, chart, white, dark and used of one shot."""
    n, w = len(table.patches), table.white
    C, se_C = shot.chart.mean, shot.chart.standard_error
    if C.shape != (n, 3):
        raise InvalidArgument(
            f"Shot {number} has {len(C)} patches, the table {table.table!r} has {n}.",
            "Use the pose and the table of the same chart.",
        )
    if shot.dark is None:
        D, se_D = np.broadcast_to(shot.black, C.shape).copy(), np.zeros_like(C)
    else:
        D, se_D = shot.dark.mean, shot.dark.standard_error
    if shot.white is None:
        W, se_W = C[w] - D[w] + D, np.hypot(se_C[w], se_D[w]) + np.zeros_like(C)
        clipped_white = shot.chart.clipped[w : w + 1]
    else:
        W, se_W, clipped_white = shot.white.mean, shot.white.standard_error, shot.white.clipped
    _check_white(W - D, se_W, clipped_white, shot, number)
    y = (C - D) / (W - D)
    weight_D = np.ones_like(y) if shot.white is None else (y - 1) ** 2
    se_y = np.sqrt(se_C**2 + y**2 * se_W**2 + weight_D * se_D**2) / (W - D)
    clipped = np.any(shot.chart.clipped > CLIPPED, axis=1)
    lost = np.any(LOST * np.hypot(se_C, se_D) > C - D, axis=1)
    used = ~clipped & ~lost
    if shot.white is None:
        used[w] = False
    _check_left(used, clipped, lost, number)
    return y, se_y, C, W, D, used


def _check_white(b: Floats, se_W: Floats, clipped: Floats, shot: PatchMeans, number: int) -> None:
    """Raise unless the white signal b = W - D (n, 3) is usable as a divisor."""
    word = "white patch" if shot.white is None else "white frame"
    part = b / (shot.saturation - shot.black)
    if shot.white is not None and shot.dark is not None and 2 * np.count_nonzero(part < -FAINT) > part.size:
        raise fail("frames_differ.swapped", shot=number)
    share = float(clipped.max())
    if share > CLIPPED:
        raise fail("overexposed.white", value=share, threshold=CLIPPED, shot=number, share=share, frame=word)
    level = float(part.min())
    if not level >= FAINT:
        if level < 0:
            raise fail("underexposed.white_below_dark", value=level, threshold=FAINT, shot=number, frame=word)
        raise fail("underexposed.weak_white", value=level, threshold=FAINT, shot=number, frame=word, level=level)
    noise = float((se_W / b).max())
    if noise > NOISY:
        raise fail("underexposed.noisy_white", value=noise, threshold=NOISY, shot=number, frame=word, noise=noise)


def _check_left(used: NDArray[np.bool_], clipped: NDArray[np.bool_], lost: NDArray[np.bool_], number: int) -> None:
    """Raise if fewer than FEWEST patches are usable; the error's class is the more frequent cause."""
    left = int(np.count_nonzero(used))
    if left >= FEWEST:
        return
    over, under = int(np.count_nonzero(clipped)), int(np.count_nonzero(lost))
    raise fail(
        "overexposed.few_left" if over >= under else "underexposed.few_left",
        value=left,
        threshold=FEWEST,
        shot=number,
        left=left,
        all=used.size,
        over=over,
        under=under,
        least=FEWEST,
    )


def _assumptions(shot: PatchMeans, table: ChartTable, number: int) -> list[Assumption]:
    assumptions = []
    if shot.white is None:
        frame = "the white frame only evens out the light" if shot.evened else "no white frame"
        patch = f"the chart's patch {table.patches[table.white]!r} replaces it on all patches."
        assumptions.append(Assumption("white_from_patch", f"shot {number}: {frame}: {patch}"))
    if shot.dark is None:
        assumptions.append(
            Assumption(
                "dark_from_black_level",
                f"shot {number}: no dark frame: the file's black level is used.",
            )
        )
    return assumptions
