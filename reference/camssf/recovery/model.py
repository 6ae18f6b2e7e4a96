"""The whole computation as functions of arrays by name: from frames to curves, bands, budget and predictions.

`camssf_onnx` records these two functions as the shipped models; the engine "reference" runs them on NumPy. Inputs and
outputs are those of docs/architecture.md, "The model".
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from camssf.grid import STEP, WAVELENGTHS
from camssf.recovery.arrays import Array, cond, eye, inverse, namespace
from camssf.recovery.basis import interpolate
from camssf.recovery.covariance import SOURCES
from camssf.recovery.elastic_net import ElasticNet
from camssf.recovery.layers import splitting, weight
from camssf.recovery.optimum import optimum
from camssf.recovery.posterior import (
    budget,
    evidence_of,
    log_evidence,
    modes_of_lamps,
    predicted_std,
    std_of_curves,
)
from camssf.recovery.rows import Hypotheses, paper_rows
from camssf.recovery.whitening import Whitened, whitened_model

M = WAVELENGTHS.size


def learned_model(inputs: Mapping[str, Array]) -> dict[str, Array]:
    """All outputs on bases with a mean, whose three channels are one problem; h hypotheses."""
    white, signals = _signals(inputs)
    xp = namespace(signals)
    named: dict[str, Array] = {**inputs, "signals": signals}
    named["dictionary"] = inputs["prior_scale"] * inputs["dictionary"]
    hypotheses = Hypotheses(**{field.name: named[field.name] for field in fields(Hypotheses)})
    model = whitened_model(hypotheses, inputs["explain"])
    h = model.folded.h
    shapes = output_shapes(h, model.folded.sizes)

    def solved() -> list[Array]:
        outputs = _solved(inputs, model)
        return [outputs[name] for name in shapes]

    def weighed() -> list[Array]:
        weights = evidence_of(model)
        return [weights if name == "evidence" else _unknown(xp, shape) for name, shape in shapes.items()]

    outputs = dict(zip(shapes, cond(inputs["solve"] > 0.5, solved, weighed), strict=True))
    return outputs | {"signals": signals, "channel_gain": _channel_gain(white)}


def output_shapes(h: Any, sizes: tuple[Any, ...], problems: int = 1) -> dict[str, tuple[Any, ...]]:
    """The shape of each output but `signals` and `channel_gain`, for h hypotheses and k, n, q, g, r."""
    k, n, q, g, r = sizes
    return {
        "ssf": (h, M, 3), "ssf_std": (h, M, 3), "code": (h, r, 3), "code_covariance": (h, 3 * r, 3 * r),
        "predicted": (h, k, n, 3), "predicted_std": (h, k, n, 3), "budget": (h, len(SOURCES) + 1, 3), "gap": (h, 3),
        "layers_gap": (h, problems), "finish_steps": (h, problems), "evidence": (h,), "lamp_estimate": (h, k, M),
        "mode_estimate": (h, k, q), "mode_covariance": (h, k * q, k * q), "gain_code": (h, k, g),
        "gain_estimate": (h, k, n),
    }  # fmt: skip


def _solved(inputs: Mapping[str, Array], model: Whitened) -> dict[str, Array]:
    """The optimum of every hypothesis, and what follows from it."""
    xp, folded, hypotheses = namespace(model.A), model.folded, model.folded.hypotheses
    h, (k, n, q, g, r) = folded.h, folded.sizes
    problem = ElasticNet(model.A, model.b, inputs["l2"], inputs["gamma"], inputs["nonnegative"] > 0.5)
    one = eye(xp, 3 * r)
    # One call inverts for the code's posterior covariance and for the layers' W.
    inverses, log_dets = inverse(xp.concat([problem.H + one, problem.H + weight(problem) * one], axis=0))
    spread = inverses[:h, ...]
    solution = optimum(problem, splitting(problem, inverses[h:, ...]))
    mean = spread @ problem.g
    mode_estimate, mode_covariance = modes_of_lamps(model, mean, spread)
    # v̂ = Dᵀ Σ⁻¹ (b - A x): the most probable gains, given the code.
    gain_code = xp.reshape(model.gains.mT @ (problem.b - problem.A @ solution.x), (h, k, g))

    code = xp.reshape(solution.x, (h, 3, r))
    curves = folded.mean + (folded.atoms @ code[..., None])[..., 0]
    first = folded.white[:, 0, :, None]  # (h, v, 1)
    scale = curves @ first  # (h, 3, 1): Σ ρ_w L s dλ = 1 for the first lamp
    std = std_of_curves(folded.atoms, curves, spread) / scale
    ssf = interpolate((curves / scale).mT)  # (h, m, 3)
    lamp = hypotheses.lamp * interpolate(model.lamp.mT).mT
    response = (lamp * hypotheses.white_reflectance[:, None, :]) @ ssf  # (h, k, 3)
    seen = (lamp[:, :, None, :] * hypotheses.reflectance[:, None, ...]) @ ssf[:, None, ...]

    def explained() -> list[Array]:
        reach = response * STEP * (folded.mean @ first).mT
        return [budget(model, mean, spread), predicted_std(model, spread, reach)]

    def unexplained() -> list[Array]:
        return [_unknown(xp, (h, len(SOURCES) + 1, 3)), _unknown(xp, (h, k, n, 3))]

    of_sources, of_signals = cond(inputs["explain"] > 0.5, explained, unexplained)
    return {
        "ssf": ssf,
        "ssf_std": std.mT,
        "code": code.mT,
        "code_covariance": spread,
        "predicted": seen / response[:, :, None, :],
        "predicted_std": of_signals,
        "budget": of_sources,
        "gap": xp.broadcast_to(solution.gap[:, :, 0], (h, 3)),
        "layers_gap": solution.layers_gap[:, :, 0],
        "finish_steps": solution.pivots[:, :, 0],
        "evidence": log_evidence(problem.A, problem.b, mean, model.log_det + log_dets[:h]),
        "lamp_estimate": lamp,
        "mode_estimate": xp.reshape(mode_estimate, (h, k, q)),
        "mode_covariance": mode_covariance,
        "gain_code": gain_code,
        "gain_estimate": (gain_code[:, :, None, :] @ hypotheses.gain_modes)[:, :, 0, :],
    }


def paper_model(inputs: Mapping[str, Array], dictionary: Array) -> dict[str, Array]:
    """All outputs on the paper's basis: one shot, a problem a channel, no prior, so no bands.

    Args:
        inputs: by name.
        dictionary: (681, r) Ψ, the same for the channels.
    """
    white, signals = _signals(inputs)
    xp, r = namespace(signals), dictionary.shape[-1]
    (_, k, n, _), q, g = signals.shape, inputs["lamp_modes"].shape[2], inputs["gain_modes"].shape[1]
    lamp, chart, rho = inputs["lamp"][0, ...], inputs["reflectance"][0, ...], inputs["white_reflectance"][0, ...]
    A, b, variance = paper_rows(
        signals[0, 0, ...], inputs["standard_error"][0, 0, ...], inputs["chart_tolerance"], chart, rho, lamp[0, ...],
        dictionary,
    )  # fmt: skip
    deviation = xp.sqrt(variance)
    problem = ElasticNet(A / deviation, b / deviation, inputs["l2"], inputs["gamma"], inputs["nonnegative"] > 0.5)
    solved = optimum(problem)
    curves = (dictionary @ solved.x)[..., 0].mT  # (m, 3)
    ssf = curves / ((lamp[:1, :] * (rho * STEP)) @ curves)
    gain_code = xp.zeros((k, g), dtype=xp.float64)
    outputs = {
        "ssf": ssf,
        "code": solved.x[..., 0].mT,
        "predicted": ((lamp[:, None, :] * chart) @ ssf) / ((lamp * rho) @ ssf)[:, None, :],
        "gap": solved.gap[:, 0, 0],
        "layers_gap": solved.layers_gap[:, 0, 0],
        "finish_steps": solved.pivots[:, 0, 0],
        "lamp_estimate": lamp,
        "gain_code": gain_code,
        "gain_estimate": xp.zeros((k, n), dtype=xp.float64),
    }
    shapes = output_shapes(1, (k, n, q, g, r), 3)
    outputs |= {name: _unknown(xp, shape[1:]) for name, shape in shapes.items() if name not in outputs}  # of a prior
    outputs = {name: value[None, ...] for name, value in outputs.items()}  # of the one hypothesis
    return outputs | {"signals": signals, "channel_gain": _channel_gain(white)}


def _signals(inputs: Mapping[str, Array]) -> tuple[Array, Array]:
    """White minus dark (k, n, 3), and the signals of Eq. (5), (chart - dark) / (white - dark), (e, k, n, 3)."""
    white = inputs["white"] - inputs["dark"]
    return white, (inputs["chart"] - inputs["dark"]) / white


def _channel_gain(white: Array) -> Array:
    """Raw white of the first shot, relative to green, (3,)."""
    means = namespace(white).mean(white[0, ...], axis=0)
    return means / means[1:2]


def _unknown(xp: Any, shape: tuple[Any, ...]) -> Array:
    """NaN in place of an output."""
    return xp.full(shape, np.nan, dtype=xp.float64)
