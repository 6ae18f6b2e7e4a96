"""Code → ssf: the curves, their bands and their proof."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camssf.curves.basis import Basis, read_basis, widened
from camssf.curves.code import Code, solve
from camssf.curves.engine import SHIPPED, Model, load_model
from camssf.curves.evidence import Evidence
from camssf.curves.penalties import penalties
from camssf.curves.problem import whiten
from camssf.curves.sensing import Sensing, anchor, sense
from camssf.errors import InvalidArgument, NotConverged
from camssf.grid import STEP, WAVELENGTHS, Floats

LARGEST_GAP = 1e-9
"""Relative duality gap above which there is no answer."""
ENGINES = ("onnx", "reference")
BY_CHANNEL = ("ssf", "ssf_std", "code", "predicted", "gap", "layers_gap", "finish_steps")
"""Outputs of the paper's model whose last axis is the channel, each from its own problem."""


@dataclass(frozen=True)
class Weight:
    """One hypothesis among those that were weighed.

    Attributes:
        basis, prior_scale: which it is.
        log_evidence: ln of the marginal likelihood of the signals under it, but for a constant common to all.
        probability: its weight among them, with what was believed beforehand.
        kinds: of each shot's light, where one was not named; "" for a lamp that was. Empty where all were.
    """

    basis: str
    prior_scale: float
    log_evidence: float
    probability: float
    kinds: tuple[str, ...] = ()


@dataclass(frozen=True)
class FoundLight:
    """What the signals say of a light that nobody named.

    Attributes:
        kinds: how probable each kind is; they add up to 1.
        power: (681,) relative spectral power, mean 1: the mean over kinds.
        std: (681,) one standard deviation of it, over kinds, their modes and what these leave.
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
        predicted: (k, n, 3) the signals that these curves give under `lamp`, 1.
        gap: (3,) relative duality gap of the problem that each channel stands in.
        layers_gap: (p,) the same of the layers' answer: p = 1 on a basis with a mean, whose channels are one problem,
            else 3.
        finish_steps: (p,) pivots that the finish took; 0 where the layers' own proof was enough.
        log_evidence: ln of the marginal likelihood of the signals but for a constant, `Code.log_evidence`; None where
            the basis has no prior.
        gamma: (3,) the l1 penalty of the problem that each channel stands in.
        l2: the quadratic penalty.
        channel_gain: (3,) raw white signal of each channel relative to green; ones where no frame was given.
        basis: its name.
        engine: "onnx" or "reference".
        lamp: (k, 681) each shot's lamp as the answer takes it: as given, but for what the signals say of its modes.
        gain_code: (k, g) v̂, what the signals say of the gain modes φ: y (1 - Σ v̂ φ) is to be held against
            `predicted`.
        prior_scale: how much wider than its basis the prior was taken, 1.
        choice: what was weighed where the evidence chose the basis or a light's kind; empty where all was told.
        lights: of each shot what the signals say of its light, None where it was named; empty where all were.
        kinds: the likeliest hypothesis on them, as in `Weight`.
        between: (3,) share of each channel's variance that stands between the hypotheses on the light.
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
    choice: tuple[Weight, ...] = ()
    lights: tuple[FoundLight | None, ...] = ()
    kinds: tuple[str, ...] = ()
    between: Floats | None = None

    def peak(self) -> tuple[Floats, Floats | None]:
        """Curves and bands divided by each channel's peak, both (681, 3)."""
        peak = self.values.max(axis=0)
        return self.values / peak, None if self.std is None else self.std / peak


def answer(
    evidence: Evidence,
    basis: str | Basis,
    *,
    prior_scale: float = 1.0,
    l2: float | None = None,
    gamma: ArrayLike | None = None,
    nonnegative: bool | None = None,
    engine: str = "onnx",
) -> Ssf:
    """The curves that explain the signals, on one basis: `camssf.curves.choice.recover` without its choice.

    Args:
        evidence: the signals, and what is known of chart, white and lamps.
        basis: a name, a file, or a Basis.
        prior_scale: how much wider the cameras spread than those that the basis was learned from; 1 on the paper's.
        l2, gamma, nonnegative, engine: as there.

    Raises:
        InvalidArgument: values or names that do not fit.
        NotConverged: a relative duality gap above 1e-9.
    """
    known = basis if isinstance(basis, Basis) else read_basis(str(basis))
    evidence.check_for(known)
    if engine not in ENGINES:
        raise InvalidArgument(f"There is no engine {engine!r}.", f"Take one of {', '.join(ENGINES)}.")
    positive = not known.prior if nonnegative is None else nonnegative
    known = widened(known, prior_scale)
    weight, sparsity = penalties(evidence, known, l2, gamma, positive)
    if engine == "onnx" and isinstance(basis, str) and basis in SHIPPED:
        return _run(load_model(basis), evidence, known, prior_scale, (weight, sparsity, positive))
    sensing = sense(evidence, known)
    code = solve(sensing, weight, sparsity[: len(sensing.matrix)], nonnegative=positive)
    return replace(
        _curves(evidence, known, sensing.lamp, code, weight, sparsity),
        gain_code=_gains(evidence, sensing, code),
        prior_scale=prior_scale,
    )


def _curves(evidence: Evidence, basis: Basis, lamp: Floats, code: Code, l2: float, gamma: Floats) -> Ssf:
    """The reference's last step: s = μ + Ψ x, scaled so that Σ ρ_w L s dλ = 1 for the first lamp."""
    _believe(code.gap)
    basis = anchor(basis, evidence.white_reflectance * evidence.lamp[0])
    x = code.values.reshape(3, -1)
    curves = basis.mean + np.einsum("cmr,cr->cm", basis.dictionary, x)  # (3, m)
    scale = curves @ (evidence.white_reflectance * evidence.lamp[0]) * STEP
    _respond(scale)
    std, spread = None, None
    if basis.prior:
        spread = np.linalg.inv(code.precision[0] + np.eye(x.size))
        moves = moves_of_peak_one(basis, curves)
        variance = np.maximum(np.einsum("cmr,crs,cms->cm", moves, own_blocks(spread), moves), 0.0)
        std = (np.sqrt(variance) / scale[:, None]).T
    values = (curves / scale[:, None]).T
    predicted = respond(values, evidence.reflectance, lamp, evidence.white_reflectance)
    gain = np.ones(3)
    if evidence.frames is not None:
        _, white, dark = evidence.frames
        means = (white - dark)[0].mean(axis=0)
        gain = means / means[1]
    return Ssf(
        values, std, x.T, spread, predicted, code.gap * np.ones(3), code.layers_gap, code.finish_steps,
        float(code.log_evidence[0]) if basis.prior else None, gamma, l2, gain, basis.name, "reference", lamp,
    )  # fmt: skip


def _gains(evidence: Evidence, sensing: Sensing, code: Code) -> Floats:
    """v̂ (k, g) beside the code, Dᵀ Σ⁻¹ (b - A x): the likeliest gains once the curves are known."""
    k, g, _ = evidence.gain_modes.shape
    if not sensing.gains.size:
        return np.zeros((k, g))
    rest = sensing.target[0] - sensing.matrix[0] @ code.values[0]
    rows, rest, _ = whiten(sensing.gains, rest, sensing.covariance[0])
    return np.asarray(rows.T @ rest).reshape(k, g)


def own_blocks(covariance: Floats) -> Floats:
    """(3 r, 3 r) of the three channels' codes → (3, r, r), each channel's own."""
    r = len(covariance) // 3
    return np.stack([covariance[c * r : (c + 1) * r, c * r : (c + 1) * r] for c in range(3)])


def respond(values: Floats, reflectance: Floats, lamp: Floats, white_reflectance: Floats) -> Floats:
    """Signals (k, n, 3) that curves (681, 3) of any scale give of patches (n, 681) under lamps (k, 681), Eq. (5)."""
    seen = (lamp[:, None, :] * reflectance) @ values
    return np.asarray(seen / ((lamp * white_reflectance) @ values)[:, None, :])


def moves_of_peak_one(basis: Basis, curves: Floats) -> Floats:
    """How the code moves the curve of peak 1, times the peak, (3, m, r).

    With ŝ = s / s_p, p where s peaks, an error d s moves ŝ by (d s - ŝ d s_p) / s_p: Ψ - ŝ Ψ_p.
    """
    top = curves.argmax(axis=1)
    at_peak = np.take_along_axis(basis.dictionary, top[:, None, None], axis=1)  # (3, 1, r)
    shape = curves / np.take_along_axis(curves, top[:, None], axis=1)
    return np.asarray(basis.dictionary - shape[:, :, None] * at_peak)


def _run(model: Model, evidence: Evidence, basis: Basis, prior_scale: float, how: tuple[float, Floats, bool]) -> Ssf:
    """The model's answer. It takes one γ a call; the paper's channels that differ in it take a call each."""
    y, (l2, gamma, nonnegative) = evidence.signals, how
    chart, white, dark = evidence.frames or (y, np.ones_like(y), np.zeros_like(y))
    modes = evidence.lamp_modes if evidence.lamp_modes.shape[1] else np.zeros((len(y), 1, WAVELENGTHS.size))
    gains = evidence.gain_modes if evidence.gain_modes.shape[1] else np.zeros((len(y), 1, y.shape[1]))
    inputs: dict[str, Floats] = {
        "chart": chart,
        "white": white,
        "dark": dark,
        "standard_error": evidence.errors(basis),
        "reflectance": evidence.reflectance,
        "chart_tolerance": evidence.chart_tolerance,
        "white_reflectance": evidence.white_reflectance,
        "white_tolerance": np.array(evidence.white_tolerance),
        "lamp": evidence.lamp,
        "lamp_tolerance": evidence.lamp_tolerance,
        "lamp_modes": modes,
        "gain_modes": gains,
        "gain_own": np.array(evidence.gain_own),
        "l2": np.array(l2),
        "nonnegative": np.array(float(nonnegative)),
        "prior_scale": np.array(prior_scale),
    }
    answers = [model.run(inputs | {"gamma": np.array(value)}) for value in np.unique(gamma)]
    order = np.searchsorted(np.unique(gamma), gamma)
    out = {name: value.copy() for name, value in answers[0].items()}
    for c, which in enumerate(order):
        for name in BY_CHANNEL if len(answers) > 1 else ():
            out[name][..., c] = answers[which][name][..., c]
    _believe(out["gap"])
    _respond(out["ssf"].max(axis=0))
    std, spread, evidence_ = (
        (out["ssf_std"], out["code_covariance"], float(out["evidence"])) if basis.prior else (None, None, None)
    )
    return Ssf(
        out["ssf"], std, out["code"], spread, out["predicted"], out["gap"], out["layers_gap"],
        np.rint(out["finish_steps"]).astype(np.int64), evidence_, gamma, l2, out["channel_gain"], basis.name, "onnx",
        out["lamp_estimate"], out["gain_code"][:, : evidence.gain_modes.shape[1]], prior_scale,
    )  # fmt: skip


def _believe(gap: Floats) -> None:
    """Refuse an answer without its proof; a gap that is NaN is none."""
    if not (gap <= LARGEST_GAP).all():
        raise NotConverged(
            f"The solver's own proof failed: relative duality gap {gap.max():.1e}.",
            "Look for a patch or lamp that does not belong to the photo; otherwise report this with the file.",
            value=float(gap.max()) if np.isfinite(gap).all() else None,
            threshold=LARGEST_GAP,
        )


def _respond(response: Floats) -> None:
    """Refuse curves that do not see white."""
    if not (np.isfinite(response).all() and (response > 0).all()):
        raise NotConverged(
            "A recovered curve has no response to white: the penalty gamma left nothing of it, or the signals of a "
            "channel are empty.",
            "Take a smaller gamma, and check that the photo is exposed in all three channels.",
        )
