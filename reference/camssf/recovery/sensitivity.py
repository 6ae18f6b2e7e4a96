"""Recovers the curves on one basis, with their error bands and duality gaps."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camssf.errors import InvalidArgument, NotConverged
from camssf.grid import STEP, WAVELENGTHS, Floats
from camssf.recovery.basis import Basis, read_basis, widened
from camssf.recovery.elastic_net import whiten
from camssf.recovery.linear_model import LinearModel, anchor, linear_model
from camssf.recovery.observation import Observation
from camssf.recovery.onnx_model import SHIPPED, Model, load_model
from camssf.recovery.penalties import penalties
from camssf.recovery.solve import Code, solve

LARGEST_GAP = 1e-9
"""Relative duality gap above which `NotConverged` is raised."""
ENGINES = ("onnx", "reference")
BY_CHANNEL = ("ssf", "ssf_std", "code", "predicted", "gap", "layers_gap", "finish_steps")
"""Outputs whose last axis is the channel; on the paper's basis each channel is a problem of its own."""


@dataclass(frozen=True)
class Hypothesis:
    """One of the compared hypotheses.

    Attributes:
        basis, prior_scale: name of the basis, and width of its prior relative to the learned one.
        log_evidence: ln of the marginal likelihood of the signals, up to a constant common to all hypotheses.
        probability: posterior probability.
        kinds: of each shot's light, "" for a named lamp; empty if all lamps were named.
    """

    basis: str
    prior_scale: float
    log_evidence: float
    probability: float
    kinds: tuple[str, ...] = ()


@dataclass(frozen=True)
class EstimatedLamp:
    """A shot's light as estimated from the signals, where its lamp was not named.

    Attributes:
        kinds: posterior probability of each kind; they add up to 1.
        power: (681,) relative spectral power of mean 1, averaged over the hypotheses.
        std: (681,) one standard deviation of it, within and between the hypotheses.
        kelvin, kelvin_std: correlated colour temperature and one standard deviation, K.
    """

    kinds: dict[str, float]
    power: Floats
    std: Floats
    kelvin: float
    kelvin_std: float


@dataclass(frozen=True)
class Ssf:
    """The recovered spectral sensitivity functions. Columns are R, G, B.

    Attributes:
        values: (681, 3) scaled so that Σ ρ_w L s dλ = 1 for the first lamp; `peak()` gives peak = 1.
        std: (681, 3) posterior standard deviation of the curve of peak 1, times its peak, so 0 at the peak itself;
            None where the basis has no prior.
        code: (r, 3) coefficients x.
        code_covariance: (3 r, 3 r) posterior covariance of x, red's r first, then green's, then blue's, (H + I)⁻¹;
            None where the basis has no prior.
        predicted: (k, n, 3) signals predicted from these curves under `lamp`, 1.
        gap: (3,) relative duality gap of each channel's problem.
        layers_gap: (p,) the same of the layers' solution: p = 1 on a basis with a mean, whose channels are one
            problem, else 3.
        finish_steps: (p,) pivots of the finish; 0 where the layers' gap was small enough.
        log_evidence: ln of the marginal likelihood of the signals up to a constant, `Code.log_evidence`; None where
            the basis has no prior.
        gamma: (3,) the l1 penalty of each channel's problem.
        l2: the quadratic penalty.
        channel_gain: (3,) raw white signal of each channel relative to green; ones where no frame was given.
        basis: its name.
        engine: "onnx" or "reference".
        lamp: (k, 681) each shot's lamp: the given one, changed by the estimate of its modes.
        gain_code: (k, g) v̂, estimated amplitudes of the gain modes φ: y (1 - Σ v̂ φ) compares with `predicted`.
        prior_scale: width of the prior relative to the learned one, 1.
        choice: the compared hypotheses, if basis or kind of light were chosen by their evidence; else empty.
        lights: of each shot the estimated light, None where its lamp was named; empty if all were.
        kinds: of the most probable hypothesis, as in `Hypothesis`.
        between: (3,) share of each channel's variance that is between the hypotheses; None if all lamps were named.
    """

    values: Floats
    std: Floats | None
    code: Floats
    code_covariance: Floats | None
    predicted: Floats
    gap: Floats
    layers_gap: Floats
    finish_steps: NDArray[np.int64]
    log_evidence: float | None
    gamma: Floats
    l2: float
    channel_gain: Floats
    basis: str
    engine: str
    lamp: Floats
    gain_code: Floats = field(default_factory=lambda: np.zeros((1, 0)))
    prior_scale: float = 1.0
    choice: tuple[Hypothesis, ...] = ()
    lights: tuple[EstimatedLamp | None, ...] = ()
    kinds: tuple[str, ...] = ()
    between: Floats | None = None

    def peak(self) -> tuple[Floats, Floats | None]:
        """Curves and bands divided by each channel's peak, both (681, 3)."""
        peak = self.values.max(axis=0)
        return self.values / peak, None if self.std is None else self.std / peak


def answer(
    observation: Observation,
    basis: str | Basis,
    *,
    prior_scale: float = 1.0,
    l2: float | None = None,
    gamma: ArrayLike | None = None,
    nonnegative: bool | None = None,
    engine: str = "onnx",
) -> Ssf:
    """The curves that explain the signals on one basis: `camssf.recovery.hypotheses.recover` without its choice.

    Args:
        observation: the signals, and what is known of chart, white and lamps.
        basis: a name, a file, or a Basis.
        prior_scale: width of the prior relative to the learned one; 1 on the paper's basis.
        l2, gamma, nonnegative, engine: as in `recover`.

    Raises:
        InvalidArgument: invalid values or names.
        NotConverged: a relative duality gap above 1e-9.
    """
    known = basis if isinstance(basis, Basis) else read_basis(str(basis))
    observation.check_for(known)
    if engine not in ENGINES:
        raise InvalidArgument(f"There is no engine {engine!r}.", f"Take one of {', '.join(ENGINES)}.")
    positive = not known.prior if nonnegative is None else nonnegative
    known = widened(known, prior_scale)
    weight, sparsity = penalties(observation, known, l2, gamma, positive)
    if engine == "onnx" and isinstance(basis, str) and basis in SHIPPED:
        return _run(load_model(basis), observation, known, prior_scale, (weight, sparsity, positive))
    linear = linear_model(observation, known)
    code = solve(linear, weight, sparsity[: len(linear.matrix)], nonnegative=positive)
    return replace(
        _curves(observation, known, linear.lamp, code, weight, sparsity),
        gain_code=_gains(observation, linear, code),
        prior_scale=prior_scale,
    )


def _curves(observation: Observation, basis: Basis, lamp: Floats, code: Code, l2: float, gamma: Floats) -> Ssf:
    """The reference's last step: s = μ + Ψ x, scaled so that Σ ρ_w L s dλ = 1 for the first lamp."""
    _check_converged(code.gap)
    basis = anchor(basis, observation.white_reflectance * observation.lamp[0])
    x = code.values.reshape(3, -1)
    curves = basis.mean + np.einsum("cmr,cr->cm", basis.dictionary, x)  # (3, m)
    scale = curves @ (observation.white_reflectance * observation.lamp[0]) * STEP
    _check_responds_to_white(scale)
    std, spread = None, None
    if basis.prior:
        spread = np.linalg.inv(code.precision[0] + np.eye(x.size))
        moves = moves_of_peak_one(basis, curves)
        variance = np.maximum(np.einsum("cmr,crs,cms->cm", moves, own_blocks(spread), moves), 0.0)
        std = (np.sqrt(variance) / scale[:, None]).T
    values = (curves / scale[:, None]).T
    predicted = predict_signals(values, observation.reflectance, lamp, observation.white_reflectance)
    gain = np.ones(3)
    if observation.frames is not None:
        _, white, dark = observation.frames
        means = (white - dark)[0].mean(axis=0)
        gain = means / means[1]
    return Ssf(
        values, std, x.T, spread, predicted, code.gap * np.ones(3), code.layers_gap, code.finish_steps,
        float(code.log_evidence[0]) if basis.prior else None, gamma, l2, gain, basis.name, "reference", lamp,
    )  # fmt: skip


def _gains(observation: Observation, linear: LinearModel, code: Code) -> Floats:
    """v̂ (k, g) = Dᵀ Σ⁻¹ (b - A x): the most probable gains, given the code."""
    k, g, _ = observation.gain_modes.shape
    if not linear.gains.size:
        return np.zeros((k, g))
    rest = linear.target[0] - linear.matrix[0] @ code.values[0]
    rows, rest, _ = whiten(linear.gains, rest, linear.covariance[0])
    return np.asarray(rows.T @ rest).reshape(k, g)


def own_blocks(covariance: Floats) -> Floats:
    """Diagonal blocks (3, r, r), one a channel, of a covariance (3 r, 3 r) of the three channels' codes."""
    r = len(covariance) // 3
    return np.stack([covariance[c * r : (c + 1) * r, c * r : (c + 1) * r] for c in range(3)])


def predict_signals(values: Floats, reflectance: Floats, lamp: Floats, white_reflectance: Floats) -> Floats:
    """Signals (k, n, 3) of patches (n, 681) under lamps (k, 681), Eq. (5), from curves (681, 3) of any scale."""
    seen = (lamp[:, None, :] * reflectance) @ values
    return np.asarray(seen / ((lamp * white_reflectance) @ values)[:, None, :])


def moves_of_peak_one(basis: Basis, curves: Floats) -> Floats:
    """Derivative of the curve of peak 1 by the code, times the peak, (3, m, r).

    With ŝ = s / s_p, p where s peaks, an error d s changes ŝ by (d s - ŝ d s_p) / s_p: Ψ - ŝ Ψ_p.
    """
    top = curves.argmax(axis=1)
    at_peak = np.take_along_axis(basis.dictionary, top[:, None, None], axis=1)  # (3, 1, r)
    shape = curves / np.take_along_axis(curves, top[:, None], axis=1)
    return np.asarray(basis.dictionary - shape[:, :, None] * at_peak)


def _run(
    model: Model, observation: Observation, basis: Basis, prior_scale: float, arguments: tuple[float, Floats, bool]
) -> Ssf:
    """Run the ONNX model. It takes one γ a call, so each different γ of the paper's channels is a call of its own."""
    y, (l2, gamma, nonnegative) = observation.signals, arguments
    chart, white, dark = observation.frames or (y, np.ones_like(y), np.zeros_like(y))
    modes = observation.lamp_modes if observation.lamp_modes.shape[1] else np.zeros((len(y), 1, WAVELENGTHS.size))
    gains = observation.gain_modes if observation.gain_modes.shape[1] else np.zeros((len(y), 1, y.shape[1]))
    inputs: dict[str, Floats] = {
        "chart": chart,
        "white": white,
        "dark": dark,
        "standard_error": observation.errors(basis),
        "reflectance": observation.reflectance,
        "chart_tolerance": observation.chart_tolerance,
        "white_reflectance": observation.white_reflectance,
        "white_tolerance": np.array(observation.white_tolerance),
        "lamp": observation.lamp,
        "lamp_tolerance": observation.lamp_tolerance,
        "lamp_modes": modes,
        "gain_modes": gains,
        "gain_own": np.array(observation.gain_own),
        "l2": np.array(l2),
        "nonnegative": np.array(float(nonnegative)),
        "prior_scale": np.array(prior_scale),
        "explain": np.array(0.0),
    }
    answers = [model.run(inputs | {"gamma": np.array(value)}) for value in np.unique(gamma)]
    order = np.searchsorted(np.unique(gamma), gamma)
    out = {name: value.copy() for name, value in answers[0].items()}
    for c, which in enumerate(order):
        for name in BY_CHANNEL if len(answers) > 1 else ():
            out[name][..., c] = answers[which][name][..., c]
    _check_converged(out["gap"])
    _check_responds_to_white(out["ssf"].max(axis=0))
    std, spread, evidence_ = (
        (out["ssf_std"], out["code_covariance"], float(out["evidence"])) if basis.prior else (None, None, None)
    )
    return Ssf(
        out["ssf"], std, out["code"], spread, out["predicted"], out["gap"], out["layers_gap"],
        np.rint(out["finish_steps"]).astype(np.int64), evidence_, gamma, l2, out["channel_gain"], basis.name, "onnx",
        out["lamp_estimate"], out["gain_code"][:, : observation.gain_modes.shape[1]], prior_scale,
    )  # fmt: skip


def _check_converged(gap: Floats) -> None:
    """Raise unless every gap is a number of at most LARGEST_GAP."""
    if not (gap <= LARGEST_GAP).all():
        raise NotConverged(
            f"The solver's own proof failed: relative duality gap {gap.max():.1e}.",
            "Look for a patch or lamp that does not belong to the photo; otherwise report this with the file.",
            value=float(gap.max()) if np.isfinite(gap).all() else None,
            threshold=LARGEST_GAP,
        )


def _check_responds_to_white(response: Floats) -> None:
    """Raise unless every curve responds to white."""
    if not (np.isfinite(response).all() and (response > 0).all()):
        raise NotConverged(
            "A recovered curve has no response to white: the penalty gamma left nothing of it, or the signals of a "
            "channel are empty.",
            "Take a smaller gamma, and check that the photo is exposed in all three channels.",
        )
