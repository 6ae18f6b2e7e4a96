"""Gain modes: uneven light on the patches without a white frame (docs/maths.md, "Light that falls unevenly")."""

from __future__ import annotations

import numpy as np

from camssf.grid import Floats
from camssf.photo.capture import Capture
from camssf.photo.find.pose import Pose
from camssf.rules import rules
from camssf.spectra.layouts import ChartLayout

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
        each = patch_modes(n, per_patch, None if framed else white)
        return np.repeat(each[None], len(shots), axis=0), 0.0
    if framed:
        return np.zeros((len(shots), 0, n)), 0.0
    layout = capture.chart.layout
    return np.stack([smooth_modes(shot.pose, layout, white) * (not shot.means.evened) for shot in shots]), OWN


def patch_modes(n: int, size: float, white: int | None) -> Floats:
    """(g, n) one gain a patch; that of patch `white`, the reference of all, is common to all the others."""
    if white is None:
        return size * np.eye(n)
    each = np.concatenate([np.delete(np.eye(n), white, axis=0), np.ones((1, n))])
    each[:, white] = 0.0
    return size * each


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
