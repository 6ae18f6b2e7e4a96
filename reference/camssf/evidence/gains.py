"""Poses → gain modes: how the light on the patches may be off where no white frame says so (docs/maths.md, 8)."""

from __future__ import annotations

import numpy as np

from camssf.grid import Floats
from camssf.photo.capture import Capture
from camssf.photo.layouts import LAYOUTS
from camssf.photo.pose import Pose
from camssf.rules import rules

PLANE, BOWL = rules().number("gains.plane"), rules().number("gains.bowl")
"""One standard deviation of the light's linear and quadratic change, from the chart's middle to its edge."""
CORNER = rules().number("gains.corner")
"""One standard deviation of the white patch's light beside what plane and bowl give there."""
OWN = rules().number("gains.own")
"""What part of it each channel has for itself besides: lenses shade colours a little differently."""


def gain_modes(capture: Capture, per_patch: float | None) -> tuple[Floats, float]:
    """Gain modes (k, g, n) of a capture's patches, and what part of them each channel has for itself.

    With a white frame the light on every patch is known: none. Without one the chart's white patch stands in for
    all, so that the light is told relative to it: X and Y, X², XY and Y², and a level of its own,
    each less its value there.

    Args:
        capture: k shots of n patches.
        per_patch: how much the light on one patch may differ from that on any other, where each was photographed for
            itself: a mode a patch; where the chart's white patch stands in, its own gain is in all others. None where
            they stood in one photo.
    """
    white, shots, n = capture.chart.white, capture.shots, len(capture.chart.patches)
    framed = shots[0].means.white is not None
    if per_patch is not None:
        each = patch_modes(n, per_patch, None if framed else white)
        return np.repeat(each[None], len(shots), axis=0), 0.0
    if framed:
        return np.zeros((len(shots), 0, n)), 0.0
    return np.stack([smooth_modes(shot.pose, white) for shot in shots]), OWN


def patch_modes(n: int, size: float, white: int | None) -> Floats:
    """(g, n) a gain of each patch's own; of the white patch, where it stands in for all, one in all others."""
    if white is None:
        return size * np.eye(n)
    each = np.concatenate([np.delete(np.eye(n), white, axis=0), np.ones((1, n))])
    each[:, white] = 0.0
    return size * each


def smooth_modes(pose: Pose, white: int) -> Floats:
    """(g, n) plane, bowl and the white's own level over the patches of one photo, relative to patch `white`.

    A level of its own only where it stands at the chart's edge: in the middle a bowl knows its light as well as any.
    """
    X, Y = places(pose).T
    ways = [PLANE * X, PLANE * Y, BOWL * X**2, BOWL * X * Y, BOWL * Y**2]
    layout = LAYOUTS[pose.layout]
    if white % layout.columns in (0, layout.columns - 1) or white // layout.columns in (0, layout.rows - 1):
        ways.append(-CORNER * (np.arange(len(X)) == white))
    modes = np.stack(ways)
    return np.asarray(modes - modes[:, [white]])


def places(pose: Pose) -> Floats:
    """(n, 2) where the patches stand in the photo: 0 in their middle, from -1 to 1 along the longer side."""
    centres = pose.patches.mean(axis=1)
    low, high = centres.min(axis=0), centres.max(axis=0)
    return np.asarray((2.0 * centres - (low + high)) / max(float((high - low).max()), 1.0))
