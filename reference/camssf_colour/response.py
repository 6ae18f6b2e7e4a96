"""Signals, XYZ and XYZ over its white as functions of reflectance, and their errors, under one or two lights."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from camssf.colorimetry import adaptation, white_of
from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS, Floats
from camssf.spectra import read_lamp
from camssf.spectra.bundled import SURFACE_NODES, observer
from camssf_colour.light import Light
from camssf_colour.posterior import LinearResponse
from camssf_colour.spread import Reference, of_reference
from camssf_colour.view import View

LEAST = 1e-4
"""The smallest errors are left out up to this share of the variance of all."""
NODES = SURFACE_NODES.size
SOURCES = ("curves", "lamp", "reference")
"""Of the errors of a response."""


@cache
def _hats() -> Floats:
    """(681, 35) values on the grid of the functions that are 1 at one node and linear between the nodes."""
    return np.stack([np.interp(WAVELENGTHS, SURFACE_NODES, row) for row in np.eye(NODES)], axis=1)


def surface_response(
    lights: Sequence[Light], references: Sequence[Reference], view: View, *, reflectance: bool
) -> tuple[LinearResponse, Floats]:
    """Signals, and XYZ and XYZ over its white, as functions of reflectance; and the white's XYZ (3,).

    Args:
        lights: of one photo or two; XYZ is under the first.
        references: that the photos' signals were divided by.
        view: how XYZ is stated.
        reflectance: whether the reflectance is an output, too; it comes before the six others.

    Raises:
        InvalidArgument: a curve without a response to a lamp.
    """
    signals, moves = _signals(lights, references)
    first, functions = lights[0], observer(view.observer)
    aim = None if view.white == "lamp" else white_of(read_lamp(view.white).values, view.observer)
    outputs, white = _colorimetry(first.power, functions, aim)
    output_moves = np.zeros((len(moves), *outputs.shape))
    for k, step in enumerate(first.power_modes[: first.of_lamp]):
        sides = [_colorimetry(np.maximum(first.power + change, 0.0), functions, aim)[0] for change in (step, -step)]
        output_moves[k] = 0.5 * (sides[0] - sides[1])
    p, known = first.of_lamp, len(first.power_modes)
    joint = np.concatenate([moves, output_moves], axis=1)
    errors = dict(zip(SOURCES, (joint[p:known], joint[:p], joint[known:]), strict=True))
    reduced = {name: _principal(error) for name, error in errors.items()}
    ends = np.cumsum([0, *(len(errors) for errors in reduced.values())])
    sources = {name: slice(int(ends[i]), int(ends[i + 1])) for i, name in enumerate(reduced)}
    joint, c = np.concatenate(list(reduced.values())), len(signals)
    asked = np.concatenate([np.eye(NODES), outputs]) if reflectance else outputs
    return LinearResponse(signals, joint[:, :c], asked, joint[:, c:], sources), white


def _signals(lights: Sequence[Light], references: Sequence[Reference]) -> tuple[Floats, Floats]:
    """White-balanced signals (c, 35) as functions of reflectance, and their changes (K, c, 35) by each error.

    Errors of lamps and curves come first, then those of the reference, which is the same object in all photos, then
    for each photo the difference of the light between the two places.
    """
    of_object = [of_reference(light, given)[:-1] for light, given in zip(lights, references, strict=True)]
    known, smooth = len(lights[0].power_modes), len(of_object[0])
    rows, moves = [], np.zeros((known + smooth + len(lights), 3 * len(lights), NODES))
    for j, (light, relative) in enumerate(zip(lights, of_object, strict=True)):
        seen = light.power[:, None] * light.curves
        total = seen.sum(axis=0)
        if not (np.isfinite(total).all() and (total > 0).all()):
            raise InvalidArgument(
                "A curve has no response to this lamp.", "Check the lamp's spectrum, and the curves."
            )
        row = (seen / total).T @ _hats()
        moved = light.power_modes[:, :, None] * light.curves + light.power[:, None] * light.curve_modes
        own = slice(3 * j, 3 * j + 3)
        share = np.swapaxes(moved, 1, 2) @ _hats() / total[:, None]
        moves[:known, own] = share - (moved.sum(axis=1) / total)[:, :, None] * row
        moves[known : known + smooth, own] = relative[:, :, None] * row
        moves[known + smooth + j, own] = references[j].tolerance * row
        rows.append(row)
    return np.concatenate(rows), moves


def _principal(moves: Floats) -> Floats:
    """Errors (K, r, 35) as fewer independent ones of the same covariance, but for LEAST of its trace."""
    _, size, axes = np.linalg.svd(moves.reshape(len(moves), int(np.prod(moves.shape[1:]))), full_matrices=False)
    rest = np.cumsum(size[::-1] ** 2)[::-1]  # the variance of each and of all smaller ones
    kept = rest > LEAST * rest.max(initial=0.0)
    return np.asarray((size[kept, None] * axes[kept]).reshape(-1, *moves.shape[1:]))


def _colorimetry(power: Floats, functions: Floats, aim: Floats | None) -> tuple[Floats, Floats]:
    """(6, 35) XYZ as stated and XYZ over its white, as functions of reflectance; and that white's XYZ (3,)."""
    lit = power[:, None] * functions
    xyz = (lit / lit[:, 1].sum()).T
    white = xyz.sum(axis=1)
    if aim is not None:
        xyz, white = adaptation(white, aim) @ xyz, aim
    return np.concatenate([xyz, xyz / white[:, None]]) @ _hats(), white
