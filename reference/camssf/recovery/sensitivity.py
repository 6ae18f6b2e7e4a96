"""Recovers the curves on one basis, with their error bands and duality gaps."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camssf.errors import InvalidArgument, NotConverged
from camssf.grid import STEP, WAVELENGTHS, Floats
from camssf.recovery.basis import Basis, basis_of, widened
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
        basis: its name.
        log_evidence: ln of the marginal likelihood of the signals, up to a constant common to all hypotheses.
        probability: posterior probability.
        kinds: of each shot's light, "" for a named lamp; empty if all lamps were named.
    """

    basis: str
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
class FamilyTest:
    """Whether a camera belongs to the family of its basis.

    Attributes:
        length: z(x), the length of the code as a standard normal number under the prior.
        lamp_residual: gain in ln of the evidence if named lamps may err by much more than declared; None if none was
            named.
        longest, largest: their limits.
    """

    length: float
    lamp_residual: float | None
    longest: float
    largest: float

    @property
    def passed(self) -> bool:
        """Whether both numbers are within their limits."""
        return self.length <= self.longest and (self.lamp_residual is None or self.lamp_residual <= self.largest)


@dataclass(frozen=True)
class Posterior:
    """Uncertainty of the curves; it exists only where the basis has a prior. Columns are R, G, B.

    Attributes:
        std: (681, 3) standard deviation of the curve of peak 1, times its peak, so 0 at the peak itself.
        code_covariance: (3 r, 3 r) of x, red's r first, then green's, then blue's, (H + I)⁻¹.
        log_evidence: ln of the marginal likelihood of the signals up to a constant, `Code.log_evidence`.
        family_test: whether the camera belongs to the family of its basis, if the basis was chosen; else None. If it
            does not, the answer is that of a wider prior (`FitSettings.prior_scale`).
        half_width_without_photo: `Ssf.half_width` of the basis's mean camera under the prior of the learned width:
            what is known before any photo.
    """

    std: Floats
    code_covariance: Floats
    log_evidence: float
    family_test: FamilyTest | None = None
    half_width_without_photo: float | None = None


@dataclass(frozen=True)
class Proof:
    """How near the code is to the optimum.

    Attributes:
        gap: (3,) relative duality gap of each channel's problem.
        layers_gap: (p,) the same of the layers' solution: p = 1 on a basis with a mean, whose channels are one
            problem, else 3.
        finish_steps: (p,) pivots of the finish; 0 where the layers' gap was small enough.
    """

    gap: Floats
    layers_gap: Floats
    finish_steps: NDArray[np.int64]


@dataclass(frozen=True)
class Illumination:
    """The light of the shots as the fit estimates it.

    Attributes:
        lamp: (k, 681) each shot's lamp: the given one, changed by the estimate of its modes.
        gain_code: (k, g) v̂, estimated amplitudes of the gain modes φ: y (1 - Σ v̂ φ) compares with `Ssf.predicted`.
        channel_gain: (3,) raw white signal of each channel relative to green; ones where no frame was given.
        lights: of each shot the estimated light, None where its lamp was named; empty if all were.
        kinds: of the most probable hypothesis, as in `Hypothesis`.
        between: (3,) share of each channel's variance that is between the hypotheses; None if all lamps were named.
        half_width_of_basis: `Ssf.half_width` of the most probable basis's hypotheses alone; None if all lamps were
            named.
    """

    lamp: Floats
    gain_code: Floats
    channel_gain: Floats
    lights: tuple[EstimatedLamp | None, ...] = ()
    kinds: tuple[str, ...] = ()
    between: Floats | None = None
    half_width_of_basis: float | None = None


@dataclass(frozen=True)
class SolverSettings:
    """How a basis is solved; None for the basis' default.

    Attributes:
        l2, gamma: the penalties λ₂ and γ. On a basis with a prior, where the channels are one problem, γ is one
            number, and the defaults are 1 and 0.05. On the paper's basis γ may be one number a channel, and the
            defaults are 0 and the discrepancy principle: the largest γ whose residual is not above the measured
            noise, rᵀ Σ⁻¹ r ≤ Σ se² / Σ_ii (the ε form, the paper's Eq. (9)), but at least 1e-5 of the γ that makes x
            zero.
        nonnegative: whether x ≥ 0; None: only on a basis without a prior. False gives the paper's literal Eq. (10).
        engine: "onnx", the shipped model, or "reference". A basis without a shipped model always uses the reference;
            `FitSettings.engine` names the engine used.
    """

    l2: float | None = None
    gamma: ArrayLike | None = None
    nonnegative: bool | None = None
    engine: str = "onnx"


SOLVER_DEFAULTS = SolverSettings()


@dataclass(frozen=True)
class FitSettings:
    """The settings that the curves were recovered with.

    Attributes:
        basis: its name.
        prior_scale: width of the prior relative to the learned one, 1.
        l2: the quadratic penalty.
        gamma: (3,) the l1 penalty of each channel's problem.
        engine: "onnx" or "reference".
        chart_fading: by how much the chart has faded in this answer (`faded_chart`); 0 for none.
    """

    basis: str
    prior_scale: float
    l2: float
    gamma: Floats
    engine: str
    chart_fading: float = 0.0


@dataclass(frozen=True)
class Ssf:
    """The recovered spectral sensitivity functions. Columns are R, G, B.

    Attributes:
        values: (681, 3) scaled so that Σ ρ_w L s dλ = 1 for the first lamp; `peak()` gives peak = 1.
        code: (r, 3) coefficients x.
        posterior: bands, covariance and evidence; None where the basis has no prior.
        predicted: (k, n, 3) signals predicted from these curves under `light.lamp`, 1.
        light: the light of the shots.
        proof: duality gaps.
        settings: basis, penalties and engine.
        choice: the compared hypotheses, if basis or kind of light were chosen by their evidence; else empty.
    """

    values: Floats
    code: Floats
    posterior: Posterior | None
    predicted: Floats
    light: Illumination
    proof: Proof
    settings: FitSettings
    choice: tuple[Hypothesis, ...] = ()

    @property
    def std(self) -> Floats | None:
        """(681, 3) one standard deviation of `values`, as `Posterior.std`; None where the basis has no prior."""
        return None if self.posterior is None else self.posterior.std

    @property
    def family_test(self) -> FamilyTest | None:
        """`Posterior.family_test`."""
        return None if self.posterior is None else self.posterior.family_test

    @property
    def half_width(self) -> float | None:
        """Mean half-width of the 95 % band, 400 to 700 nm, in parts of the peak; None without a band."""
        std = self.peak()[1]
        return None if std is None else half_width_of(std)

    @property
    def band_ratio(self) -> float | None:
        """Half-width of the band over that without a photo; None without a prior.

        Both are those of the most probable basis: whether the camera belongs to it is another question.
        """
        without = None if self.posterior is None else self.posterior.half_width_without_photo
        width = self.half_width if self.light.half_width_of_basis is None else self.light.half_width_of_basis
        return None if without is None or width is None else width / without

    def tested(self, test: FamilyTest, chart_fading: float) -> Ssf:
        """The answer with its `family_test`, and by how much the chart has faded."""
        assert self.posterior is not None  # every family has a prior
        settings = replace(self.settings, chart_fading=chart_fading)
        return replace(self, posterior=replace(self.posterior, family_test=test), settings=settings)

    def peak(self) -> tuple[Floats, Floats | None]:
        """Curves and bands divided by each channel's peak, both (681, 3)."""
        peak = self.values.max(axis=0)
        return self.values / peak, None if self.std is None else self.std / peak


def answer(
    observation: Observation,
    basis: str | Basis,
    *,
    prior_scale: float = 1.0,
    settings: SolverSettings = SOLVER_DEFAULTS,
) -> Ssf:
    """The curves that explain the signals on one basis: `camssf.recovery.hypotheses.recover` without its choice.

    Args:
        observation: the signals, and what is known of chart, white and lamps.
        basis: a name, a file, or a Basis.
        prior_scale: width of the prior relative to the learned one; 1 on the paper's basis.
        settings: penalties, signs and engine.

    Raises:
        InvalidArgument: invalid values or names.
        NotConverged: a relative duality gap above 1e-9.
    """
    known = basis_of(basis)
    observation.check_for(known)
    engine = settings.engine
    if engine not in ENGINES:
        raise InvalidArgument(f"There is no engine {engine!r}.", f"Take one of {', '.join(ENGINES)}.")
    positive = not known.prior if settings.nonnegative is None else settings.nonnegative
    without_photo = half_width_of(prior_std(known)) if known.prior else None
    known = widened(known, prior_scale)
    l2, gamma = penalties(observation, known, settings.l2, settings.gamma, positive)
    model = load_model(basis) if engine == "onnx" and isinstance(basis, str) and basis in SHIPPED else None
    fitted = FitSettings(known.name, prior_scale, l2, gamma, "reference" if model is None else "onnx")
    if model is not None:
        found = _run(model, observation, known, fitted, positive)
    else:
        linear = linear_model(observation, known)
        code = solve(linear, l2, gamma[: len(linear.matrix)], nonnegative=positive)
        found = _curves(observation, known, linear, code, fitted)
    if found.posterior is None:
        return found
    return replace(found, posterior=replace(found.posterior, half_width_without_photo=without_photo))


def _curves(observation: Observation, basis: Basis, linear: LinearModel, code: Code, settings: FitSettings) -> Ssf:
    """The reference's last step: s = μ + Ψ x, scaled so that Σ ρ_w L s dλ = 1 for the first lamp."""
    _check_converged(code.gap)
    basis = anchor(basis, observation.white_reflectance * observation.lamp[0])
    x = code.values.reshape(3, -1)
    curves = basis.mean + np.einsum("cmr,cr->cm", basis.dictionary, x)  # (3, m)
    scale = curves @ (observation.white_reflectance * observation.lamp[0]) * STEP
    _check_responds_to_white(scale)
    posterior = None
    if basis.prior:
        spread = np.linalg.inv(code.precision[0] + np.eye(x.size))
        moves = moves_of_peak_one(basis, curves)
        variance = np.maximum(np.einsum("cmr,crs,cms->cm", moves, own_blocks(spread), moves), 0.0)
        posterior = Posterior((np.sqrt(variance) / scale[:, None]).T, spread, float(code.log_evidence[0]))
    values = (curves / scale[:, None]).T
    gain = np.ones(3)
    if observation.frames is not None:
        _, white, dark = observation.frames
        means = (white - dark)[0].mean(axis=0)
        gain = means / means[1]
    return Ssf(
        values=values,
        code=x.T,
        posterior=posterior,
        predicted=predict_signals(values, observation.reflectance, linear.lamp, observation.white_reflectance),
        light=Illumination(linear.lamp, _gains(observation, linear, code), gain),
        proof=Proof(code.gap * np.ones(3), code.layers_gap, code.finish_steps),
        settings=settings,
    )


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


def prior_std(basis: Basis) -> Floats:
    """(681, 3) one standard deviation of the curves of peak 1 before any photo, about the basis's mean."""
    moves = moves_of_peak_one(basis, basis.mean)
    return np.asarray(np.sqrt(np.einsum("cmr,cmr->cm", moves, moves)) / basis.mean.max(axis=1)[:, None]).T


def half_width_of(std: Floats) -> float:
    """Mean half-width of the 95 % band, 400 to 700 nm, of standard deviations (681, 3)."""
    return float(half_widths_of(std).mean())


def half_widths_of(std: Floats) -> Floats:
    """The mean half-width of each channel, (3,)."""
    visible = (WAVELENGTHS >= 400.0) & (WAVELENGTHS <= 700.0)
    return np.asarray(1.96 * std[visible].mean(axis=0))


def _run(model: Model, observation: Observation, basis: Basis, settings: FitSettings, nonnegative: bool) -> Ssf:
    """Run the ONNX model. It takes one γ a call, so each different γ of the paper's channels is a call of its own."""
    y, gamma = observation.signals, settings.gamma
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
        "l2": np.array(settings.l2),
        "nonnegative": np.array(float(nonnegative)),
        "prior_scale": np.array(settings.prior_scale),
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
    posterior = Posterior(out["ssf_std"], out["code_covariance"], float(out["evidence"])) if basis.prior else None
    gain_code = out["gain_code"][:, : observation.gain_modes.shape[1]]
    return Ssf(
        values=out["ssf"],
        code=out["code"],
        posterior=posterior,
        predicted=out["predicted"],
        light=Illumination(out["lamp_estimate"], gain_code, out["channel_gain"]),
        proof=Proof(out["gap"], out["layers_gap"], np.rint(out["finish_steps"]).astype(np.int64)),
        settings=settings,
    )


def _check_converged(gap: Floats) -> None:
    """Raise unless every gap is a number of at most LARGEST_GAP."""
    if not (gap <= LARGEST_GAP).all():
        raise NotConverged(
            f"The solver did not converge: relative duality gap {gap.max():.1e}.",
            "Look for a patch or lamp that does not belong to the photo; otherwise report this with the file.",
            value=float(gap.max()) if np.isfinite(gap).all() else None,
            threshold=LARGEST_GAP,
        )


def _check_responds_to_white(response: Floats) -> None:
    """Raise unless every curve responds to white."""
    if not (np.isfinite(response).all() and (response > 0).all()):
        raise NotConverged(
            "A recovered curve has no response to white: the penalty gamma is too large, or the signals of a "
            "channel are empty.",
            "Take a smaller gamma, and check that the photo is exposed in all three channels.",
        )
