"""Signals, XYZ and XYZ over its white as functions of reflectance, and their errors, under one or two lights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from camssf.colorimetry import adaptation, white_of
from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery.arrays import Array, eye, namespace
from camssf.recovery.basis import NODES as BASIS_NODES
from camssf.recovery.covariance import CHART_CORRELATION, smooth_errors
from camssf.rules import rules
from camssf.spectra import read_lamp
from camssf.spectra.bundled import SURFACE_NODES, observer
from camssf_colour.light import ConditionedLight, Light
from camssf_colour.posterior import LinearResponse
from camssf_colour.spread import Reference
from camssf_colour.view import View

LEAST = rules().number("colour.least_errors")
"""The smallest errors are left out up to this share of the variance of all."""
NODES = SURFACE_NODES.size
SOURCES = ("curves", "lamp", "reference")
"""Of the errors of a response."""


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
    first, adapted = lights[0], view.white != "lamp"
    known = response_of(
        ConditionedLight(
            np.stack([light.power for light in lights]), first.curves,
            np.stack([light.power_modes for light in lights]), first.curve_modes, np.zeros(()), np.zeros(()),
        ),
        first.of_lamp,
        Viewed(
            np.array([given.tolerance for given in references]), _reflectance_errors(references[0]),
            observer(view.observer), white_of(read_lamp(view.white).values, view.observer) if adapted else np.ones(3),
            np.array(float(adapted)),
        ),
    )  # fmt: skip
    if not (np.isfinite(known.level).all() and (known.level > 0).all()):
        raise InvalidArgument("A curve has no response to this lamp.", "Check the lamp's spectrum, and the curves.")
    reduced = {name: _principal(moves) for name, moves in known.moves.items()}
    ends = np.cumsum([0, *(len(errors) for errors in reduced.values())])
    sources = {name: slice(int(ends[i]), int(ends[i + 1])) for i, name in enumerate(reduced)}
    joint, c = np.concatenate(list(reduced.values())), len(known.signals)
    asked = np.concatenate([np.eye(NODES), known.outputs]) if reflectance else known.outputs
    return LinearResponse(known.signals, joint[:, :c], asked, joint[:, c:], sources), known.white


def _reflectance_errors(reference: Reference) -> Floats:
    return smooth_errors(CHART_CORRELATION, WAVELENGTHS).T if reference.modes is None else reference.modes


@dataclass(frozen=True)
class Viewed:
    """References, and how XYZ is stated.

    Attributes:
        tolerance: (j,) of each photo's reference, which is the same object in all.
        smooth: (s, 681) smooth errors of a reflectance.
        observer: (681, 3).
        aim: (3,) XYZ of the white that XYZ is adapted to.
        adapted: 1 for `aim`, 0 for the light's own white.
    """

    tolerance: Array
    smooth: Array
    observer: Array
    aim: Array
    adapted: Array


@dataclass(frozen=True)
class ResponseArrays:
    """The arrays of a response before its errors are reduced.

    Attributes:
        signals: (c, 35), white-balanced, three a photo.
        outputs: (6, 35) XYZ as stated, and XYZ over its white.
        white: (3,) its XYZ.
        moves: by source (K, c + 6, 35) changes of signals and outputs by each error.
        level: (j, 3) response of each curve to the lamps.
        reachable: (j, 3, 69) signals as functions of reflectance at the 5-nm nodes.
    """

    signals: Array
    outputs: Array
    white: Array
    moves: dict[str, Array]
    level: Array
    reachable: Array


def response_of(light: ConditionedLight, p: Any, viewed: Viewed) -> ResponseArrays:
    """The response under these lights, of whose errors the first p come from the lamps.

    Among the errors of the reference are, after the smooth ones, those of the light's difference between the two
    places in each photo.
    """
    xp, (j, K, m), hats = namespace(light.power), light.power_modes.shape, _hats(light.power, NODES)
    c = 3 * j
    level = light.power @ light.curves
    share = (light.power[:, :, None] * light.curves / level[:, None, :]).mT  # (j, 3, 681)
    rows = share @ hats
    signals = xp.reshape(rows, (c, NODES))
    moved = xp.reshape(light.power_modes, (j, K, 1, m)) * light.curves.mT + light.power[:, None, None, :] * (
        light.curve_modes.mT
    )
    moved = xp.reshape(moved / level[:, None, :, None], (j * K * 3, m))
    moved = xp.reshape(moved @ hats, (j, K, 3, NODES)) - (
        xp.reshape(xp.sum(moved, axis=1), (j, K, 3, 1)) * rows[:, None, :, :]
    )
    moved = xp.reshape(xp.permute_dims(moved, (1, 0, 2, 3)), (K, c, NODES))
    smooth = viewed.smooth @ xp.reshape(share, (c, m)).mT  # (s, c)
    places = xp.reshape(xp.broadcast_to(eye(xp, j)[:, :, None], (j, j, 3)), (j, c))
    tolerance = xp.reshape(xp.broadcast_to(viewed.tolerance[:, None], (j, 3)), (c,))
    of_reference = (xp.concat([smooth, places], axis=0) * tolerance)[:, :, None] * signals

    first, modes = light.power[:1, :], light.power_modes[0, :p, :]
    powers = xp.concat([first, xp.maximum(first + modes, 0.0), xp.maximum(first - modes, 0.0)], axis=0)
    colours, white = _colorimetry(powers, viewed, hats)
    of_lamp = 0.5 * (colours[1 : p + 1, :, :] - colours[p + 1 :, :, :])

    def without(moves: Array) -> Array:
        """Errors that do not change the outputs."""
        return xp.concat([moves, xp.zeros((moves.shape[0], 6, NODES), dtype=xp.float64)], axis=1)

    return ResponseArrays(
        signals, colours[0, :, :], white[0, :],
        {
            "curves": without(moved[p:, :, :]),
            "lamp": xp.concat([moved[:p, :, :], of_lamp], axis=1),
            "reference": without(of_reference),
        },
        level, share @ _hats(light.power, BASIS_NODES.size),
    )  # fmt: skip


def _hats(like: Array, count: int) -> Array:
    """(681, count) values on the grid of the functions that are 1 at one node and linear between the nodes."""
    xp = namespace(like)
    grid, nodes = (xp.astype(xp.arange(size), xp.float64) for size in (WAVELENGTHS.size, count))
    places = grid * ((count - 1.0) / (WAVELENGTHS.size - 1.0))
    return xp.maximum(1.0 - xp.abs(places[:, None] - nodes), 0.0)


def _principal(moves: Floats) -> Floats:
    """Errors (K, r, 35) as fewer independent ones of the same covariance, but for LEAST of its trace."""
    _, size, axes = np.linalg.svd(moves.reshape(len(moves), int(np.prod(moves.shape[1:]))), full_matrices=False)
    rest = np.cumsum(size[::-1] ** 2)[::-1]  # the variance of each and of all smaller ones
    kept = rest > LEAST * rest.max(initial=0.0)
    return np.asarray((size[kept, None] * axes[kept]).reshape(-1, *moves.shape[1:]))


def _colorimetry(power: Array, viewed: Viewed, hats: Array) -> tuple[Array, Array]:
    """(b, 6, 35) XYZ as stated and XYZ over its white, as functions of reflectance; and that white's XYZ (b, 3)."""
    xp = namespace(power)
    xyz = (power[:, :, None] * viewed.observer).mT / (power @ viewed.observer)[:, None, 1:2]
    own = xp.sum(xyz, axis=2)
    white = viewed.adapted * viewed.aim + (1.0 - viewed.adapted) * own
    stated = adaptation(own, white) @ (xyz @ hats)
    return xp.concat([stated, stated / white[:, :, None]], axis=1), white
