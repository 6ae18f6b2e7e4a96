"""Covariance of the errors of the rows as nodes, whole and by source: `camssf.recovery.covariance`, same names."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from camssf.recovery.covariance import (
    ABSOLUTE,
    CHART_CORRELATION,
    DRIFT,
    FLOOR,
    LAMP_CORRELATION,
    RELATIVE,
    TABLE_CORRELATION,
    smooth_errors,
)
from camssf_onnx.algebra import identity, outer, size_of, sum_of_squares
from camssf_onnx.graph import Graph, Value, within

if TYPE_CHECKING:
    from camssf_onnx.linear_model import Folded, Rowed


@dataclass(frozen=True)
class LinearisedSignals:
    """`LinearisedSignals` of `camssf.recovery.covariance`, with the curve as a separate factor.

    Attributes:
        curve: (h, 3, 1, v, 1) s. predicted, level: (h, 3, k, n, 1) ŷ and 1 - ĥ.
        patches, edges: (h, 3, k, n, v). light, white: (h, 3, k, 1, v). against_white: (h, 3, k, n, v).
    """

    curve: Value
    predicted: Value
    level: Value
    patches: Value
    edges: Value
    light: Value
    white: Value
    against_white: Value


def covariance(known: Folded, signals_at: LinearisedSignals) -> tuple[Value, Value, Value]:
    """Σ without modes: `camssf.recovery.covariance.covariance`.

    Blocks (h n, 3 k, 3 k) of the chart's errors; U (h n, 3 k, u) of the white's, then of the lamps';
    noise (h n, 3 k, 1).
    """
    over_chart, over_lamp, over_table = (
        signals_at.curve * smooth_errors(length)
        for length in (CHART_CORRELATION, LAMP_CORRELATION, TABLE_CORRELATION)
    )
    edges = signals_at.edges @ over_table
    g = edges.graph
    floor = ABSOLUTE * (signals_at.light @ over_table) + 0.0 * edges
    chart = g.op("Concat", RELATIVE * (signals_at.patches @ over_chart), floor, edges, axis=4)
    rows = known.patchwise(known.tolerance * chart)
    white = known.white_tolerance * signals_at.predicted * (signals_at.white @ over_chart)
    lamp = known.lamp_tolerance * (signals_at.against_white @ over_lamp)
    lamp = g.op("Concat", lamp, DRIFT * signals_at.predicted, axis=4)
    lamp = lamp.unsqueeze(4) * known.own  # (h, 3, k, n, k, p)
    common = [known.patchwise(white), known.patchwise(lamp, 1)]
    block = outer(rows) * known.share
    one = identity(g, size_of(g, block, 1))
    level = known.patchwise(signals_at.level)  # (h n, 3 k, 1)
    noise, own = (level * level * each.unsqueeze(2) for each in (known.noise, known.independent))
    own = g.op("Max", own - g.op("Max", FLOOR**2 - noise, 0.0), 0.0)
    return block + own * one, g.op("Concat", *common, axis=2), g.op("Max", noise, FLOOR**2)


@dataclass(frozen=True)
class Errors:
    """What the errors of the rows do to the code and to the predictions.

    With E = Σ⁻¹ A and S the code's posterior covariance, x̂ = S Eᵀ b.

    Attributes:
        mean, atoms: of the basis, (3, v) and, anchored to the first hypothesis, (3, v, r).
        by_source: (6, R, R) Eᵀ Σ_t E of the sources t in the order of `SOURCES`.
        signal, error: (1, N, R) B and F, own: (1, N, 1), with which the variance of a true signal minus its
            prediction is the diagonal of B S Fᵀ, plus `own`: `errors_by_source`.
    """

    mean: Value
    atoms: Value
    by_source: Value
    signal: Value
    error: Value
    own: Value


def errors_by_source(
    known: Folded, rows: Rowed, solve: Callable[[Graph], tuple[Value, Value, Value, Value]]
) -> list[Value]:
    """The fields of `Errors` after the basis, at a point; NaN unless `known.explain`.

    `solve` gives E of A and of the gain modes' D (1, N, R + G), the terms of "lamp modes" and "uneven light"
    (1, R, R) each, and the variance of the rows (1, N, 1) by lamp modes and by the gains' parts of each channel.

    A true signal t = a x + d v + e minus its prediction has the variance a' C' a'ᵀ + K_ii - 2 a' G K_i, where a' is
    (a, d) and C' the posterior covariance of (x, v), G = C' (A, D)ᵀ Σ'⁻¹, Σ' = Σ - D Dᵀ, and K the covariance Σ' less
    the noise N. As K E = A - N E - D Dᵀ E, this is the diagonal of B S (2 N E - B)ᵀ + D (2 N E_D - B_D)ᵀ + K with
    B = A - D Dᵀ E and B_D = D - D Dᵀ E_D.
    """
    R = 3 * known.r

    def explained(g: Graph) -> list[Value]:
        here, at = within(known, g), within(rows, g)
        E, lamp_modes, uneven, further = solve(g)
        noise, A, U, D = (each.like(here.flat) for each in (at.noise, at.A, at.common, here.patchwise(here.gains, 1)))
        of_code, of_gains = E.slice(0, R, 2), E.slice(R, 2**31, 2)
        across = of_code.transpose(0, 2, 1)
        noisy = noise * of_code
        from_patches = across @ (at.chart @ of_code.like(here.by_patch)).like(here.flat)
        pull = across @ U  # (1, R, u)
        white = smooth_errors(CHART_CORRELATION).shape[1]
        shared = (outer(pull.slice(0, white, 2)), outer(pull.slice(white, 2**31, 2)))
        terms = g.op("Concat", across @ noisy, from_patches, *shared, lamp_modes, uneven, axis=0)

        on_gains = D.transpose(0, 2, 1) @ E  # (1, G, R + G)
        B, B_gains = A - D @ on_gains.slice(0, R, 2), D - D @ on_gains.slice(R, 2**31, 2)
        own = (at.chart * identity(g, size_of(g, at.chart, 1))).sum(2).like(here.flat) + sum_of_squares(U) + further
        own = own + (D * (2.0 * noise * of_gains - B_gains)).sum(2, keep=True)
        W = here.patchwise(at.white_signal.unsqueeze(3, 4) + 0.0 * here.y).like(here.flat)
        return [terms, W * B, W * (2.0 * noisy - B), W * W * own]

    def unexplained(g: Graph) -> list[Value]:
        A, noise = (each.here(g).like(known.flat) for each in (rows.A, rows.noise))
        return [g.op("Expand", np.nan, g.ints(6, R, R)), np.nan * A, np.nan * A, np.nan * noise]

    return rows.A.graph.choose(known.explain, explained, unexplained, "explain")
