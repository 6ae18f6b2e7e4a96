"""Recovers the curves on one basis, with their error bands and duality gaps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from camssf.errors import InvalidArgument
from camssf.grid import BAND, WAVELENGTHS, Floats
from camssf.messages import fail
from camssf.recovery.basis import LEARNED, Basis, basis_of, interpolate, misfit_profile, widened
from camssf.recovery.inputs import observation_arrays, stacks_of
from camssf.recovery.observation import Observation
from camssf.recovery.onnx_model import SHIPPED, Model, load_model, run_stack
from camssf.recovery.penalties import penalties
from camssf.recovery.posterior import peak_normalised_jacobian
from camssf.recovery.reference_model import ReferenceModel
from camssf.rules import rules
from camssf.shapes import Counts, Number, Power, Rgb, Share, Size, Spectrum, Text, Vector

LARGEST_GAP = rules().number("calibration.largest_gap")
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

    basis: Text
    log_evidence: Number
    probability: Share
    kinds: tuple[Text, ...] = ()


@dataclass(frozen=True)
class EstimatedLamp:
    """A shot's light as estimated from the signals, where its lamp was not named.

    Attributes:
        kinds: posterior probability of each kind; they add up to 1.
        power: (681,) relative spectral power of mean 1, averaged over the hypotheses.
        std: (681,) one standard deviation of it, within and between the hypotheses.
        kelvin, kelvin_std: correlated colour temperature and one standard deviation, K.
    """

    kinds: dict[Text, Share]
    power: Spectrum
    std: Power
    kelvin: Size
    kelvin_std: Size


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
class Proof:
    """How near the code is to the optimum.

    Attributes:
        gap: (3,) relative duality gap of each channel's problem.
        layers_gap: (p,) the same of the layers' solution: p = 1 on a basis with a mean, whose channels are one
            problem, else 3.
        finish_steps: (p,) pivots of the finish; 0 where the layers' gap was small enough.
    """

    gap: Rgb
    layers_gap: Vector
    finish_steps: Counts


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
            `Ssf.engine` names the engine used.
    """

    l2: float | None = None
    gamma: ArrayLike | None = None
    nonnegative: bool | None = None
    engine: str = "onnx"


SOLVER_DEFAULTS = SolverSettings()


@dataclass(frozen=True)
class Ssf:
    """The recovered spectral sensitivity functions. Columns are R, G, B.

    What follows from a prior is None on a basis without one: `std`, `code_covariance`, `log_evidence`,
    `half_width_without_photo`.

    Attributes:
        basis: its name.
        engine: what solved it, "onnx" or "reference".
        l2: the quadratic penalty.
        gamma: (3,) the l1 penalty of each channel's problem.
        values: (681, 3) scaled so that Σ ρ_w L s dλ = 1 for the first lamp; `peak()` gives peak = 1.
        code: (r, 3) coefficients x.
        predicted: (k, n, 3) signals predicted from these curves under `lamp`, 1.
        proof: duality gaps.
        lamp: (k, 681) each shot's lamp: the given one, changed by the estimate of its modes. If a light was not
            named, the mean of the hypotheses' lamps, each scaled to a mean of 1.
        gain_code: (k, g) v̂, estimated amplitudes of the gain modes φ: y (1 - Σ v̂ φ) compares with `predicted`.
        channel_gain: (3,) raw white signal of each channel relative to green; ones where no frame was given.
        std: (681, 3) standard deviation of the curve of peak 1, times its peak; at the peak itself it is only what
            every basis misses.
        code_covariance: (3 r, 3 r) of x, red's r first, then green's, then blue's, (H + I)⁻¹.
        log_evidence: ln of the marginal likelihood of the signals up to a constant.
        half_width_without_photo: `half_width` of the basis's mean camera under the prior of the learned width: what
            is known before any photo.
        prior_scale: width of the prior relative to the learned one, 1.
        chart_fading: by how much the chart has faded in this answer (`faded_chart`); 0 for none.
        family_test: whether the camera belongs to the family of its basis, if the basis was chosen; else None. If it
            does not, the answer is that of a wider prior (`prior_scale`).
        choice: the compared hypotheses, if basis or kind of light were chosen by their evidence; else empty.
        lights: of each shot the estimated light, None where its lamp was named; empty if all were.
        kinds: of the most probable hypothesis, as in `Hypothesis`.
        between: (3,) share of each channel's variance that is between the hypotheses; None if all lamps were named.
        half_width_of_basis: `half_width` of the most probable basis's hypotheses alone, of one width of its prior;
            None if that is the whole answer.
    """

    basis: str
    engine: str
    l2: float
    gamma: Floats
    values: Floats
    code: Floats
    predicted: Floats
    proof: Proof
    lamp: Floats
    gain_code: Floats
    channel_gain: Floats
    std: Floats | None = None
    code_covariance: Floats | None = None
    log_evidence: float | None = None
    half_width_without_photo: float | None = None
    prior_scale: float = 1.0
    chart_fading: float = 0.0
    family_test: FamilyTest | None = None
    choice: tuple[Hypothesis, ...] = ()
    lights: tuple[EstimatedLamp | None, ...] = ()
    kinds: tuple[str, ...] = ()
    between: Floats | None = None
    half_width_of_basis: float | None = None

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
        width = self.half_width if self.half_width_of_basis is None else self.half_width_of_basis
        without = self.half_width_without_photo
        return None if without is None or width is None else width / without

    def peak(self) -> tuple[Floats, Floats | None]:
        """Curves and bands divided by each channel's peak, both (681, 3)."""
        peak = self.values.max(axis=0)
        return self.values / peak, None if self.std is None else self.std / peak


@dataclass(frozen=True)
class Problem:
    """What is solved: the signals of an observation on one basis.

    Attributes:
        observation: the signals, and what is known of chart, white and lamps.
        basis: a name, a file, or a Basis.
        prior_scale: width of the prior relative to the learned one; 1 on the paper's basis.
    """

    observation: Observation
    basis: str | Basis
    prior_scale: float = 1.0


def solve_on_basis(
    observation: Observation,
    basis: str | Basis,
    *,
    prior_scale: float = 1.0,
    settings: SolverSettings = SOLVER_DEFAULTS,
) -> Ssf:
    """The curves that explain the signals on one basis: `camssf.recovery.hypotheses.recover` without its choice.

    Args:
        observation, basis, prior_scale: as in `Problem`.
        settings: penalties, signs and engine.

    Raises:
        InvalidArgument: invalid values or names.
        NotConverged: a relative duality gap above 1e-9.
    """
    return _solve_alone(Problem(observation, basis, prior_scale), settings)


def solve_together(problems: Sequence[Problem], settings: SolverSettings = SOLVER_DEFAULTS) -> list[Ssf]:
    """`solve_on_basis` of several problems on the signals of one capture.

    On learned bases the engine "onnx" solves those that make a stack (`stacks_of`) and have one width in one call.

    Raises:
        InvalidArgument, NotConverged: as `solve_on_basis`.
    """

    def of_call(i: int) -> tuple[object, ...]:
        """What else one call of the model has in common; the problem's own number if it is solved alone."""
        basis, (_, *frames) = problems[i].basis, problems[i].observation.frames or (None,)
        if settings.engine != "onnx" or not (isinstance(basis, str) and basis in LEARNED):
            return (i,)
        return (problems[i].prior_scale, *(frame.tobytes() for frame in frames))

    answers: dict[int, Ssf] = {}
    for stack in stacks_of([problem.observation for problem in problems], of_call):
        of_stack = [problems[i] for i in stack]
        solved = _solve_stack(of_stack, settings) if len(stack) > 1 else [_solve_alone(of_stack[0], settings)]
        answers |= zip(stack, solved, strict=True)
    return [answers[i] for i in range(len(problems))]


def _solve_alone(problem: Problem, settings: SolverSettings) -> Ssf:
    posed = _pose(problem, settings)
    # A model takes one γ a call, so each different γ of the paper's channels is a call of its own.
    outputs = [posed.model.run(posed.inputs | {"gamma": np.array(value)}) for value in np.unique(posed.gamma)]
    order = np.searchsorted(np.unique(posed.gamma), posed.gamma)
    out = {name: value.copy() for name, value in outputs[0].items()}
    for c, which in enumerate(order):
        for name in BY_CHANNEL if len(outputs) > 1 else ():
            out[name][..., c] = outputs[which][name][..., c]
    return _answer(posed, out)


def _solve_stack(problems: Sequence[Problem], settings: SolverSettings) -> list[Ssf]:
    posed = [_pose(problem, settings) for problem in problems]
    inputs = [one.inputs | {"gamma": np.array(one.gamma[0])} for one in posed]
    outputs = run_stack([load_model(one.basis.name) for one in posed], inputs)
    return [_answer(*pair) for pair in zip(posed, outputs, strict=True)]


@dataclass(frozen=True)
class _Posed:
    """A problem with its model, the penalties that it is solved with, and the model's inputs but for γ."""

    problem: Problem
    basis: Basis
    model: Model | ReferenceModel
    l2: float
    gamma: Floats
    inputs: dict[str, Floats]


def _pose(problem: Problem, settings: SolverSettings) -> _Posed:
    """Pose a problem; raises as `solve_on_basis`."""
    observation, basis, known = problem.observation, problem.basis, basis_of(problem.basis)
    observation.check_for(known)
    if settings.engine not in ENGINES:
        raise InvalidArgument(f"There is no engine {settings.engine!r}.", f"Take one of {', '.join(ENGINES)}.")
    positive = not known.prior if settings.nonnegative is None else settings.nonnegative
    l2, gamma = penalties(observation, widened(known, problem.prior_scale), settings.l2, settings.gamma, positive)
    shipped = settings.engine == "onnx" and isinstance(basis, str) and basis in SHIPPED
    y = observation.signals
    chart, white, dark = observation.frames or (y, np.ones_like(y), np.zeros_like(y))
    inputs = observation_arrays(observation, known) | {
        "chart": chart,
        "white": white,
        "dark": dark,
        "l2": np.array(l2),
        "nonnegative": np.array(float(positive)),
        "prior_scale": np.array(problem.prior_scale),
        "explain": np.array(0.0),
    }
    return _Posed(problem, known, load_model(str(basis)) if shipped else ReferenceModel(known), l2, gamma, inputs)


def _answer(posed: _Posed, out: dict[str, Floats]) -> Ssf:
    """The curves from a model's outputs; raises as `solve_on_basis`."""
    _check_converged(out["gap"])
    _check_responds_to_white(out["ssf"].max(axis=0))
    prior, gains = posed.basis.prior, posed.problem.observation.gain_modes.shape[1]
    return Ssf(
        basis=posed.basis.name,
        engine="onnx" if isinstance(posed.model, Model) else "reference",
        l2=posed.l2,
        gamma=posed.gamma,
        values=out["ssf"],
        code=out["code"],
        predicted=out["predicted"],
        proof=Proof(out["gap"], out["layers_gap"], np.rint(out["finish_steps"]).astype(np.int64)),
        lamp=out["lamp_estimate"],
        gain_code=out["gain_code"][:, :gains],
        channel_gain=out["channel_gain"],
        std=out["ssf_std"] if prior else None,
        code_covariance=out["code_covariance"] if prior else None,
        log_evidence=float(out["evidence"]) if prior else None,
        half_width_without_photo=half_width_of(prior_std(posed.basis)) if prior else None,
        prior_scale=posed.problem.prior_scale,
    )


def predict_signals(values: Floats, reflectance: Floats, lamp: Floats, white_reflectance: Floats) -> Floats:
    """Signals (k, n, 3) of patches (n, 681) under lamps (k, 681), Eq. (5), from curves (681, 3) of any scale."""
    signal_integrals = (lamp[:, None, :] * reflectance) @ values
    return np.asarray(signal_integrals / ((lamp * white_reflectance) @ values)[:, None, :])


def prior_std(basis: Basis) -> Floats:
    """(681, 3) one standard deviation of the curves of peak 1 before any photo, about the basis's mean."""
    moves = peak_normalised_jacobian(basis.dictionary, basis.mean)
    std = np.sqrt(np.einsum("cmr,cmr->cm", moves, moves)) / basis.mean.max(axis=1)[:, None]
    return np.asarray(np.hypot(std, interpolate(misfit_profile()[..., None])[..., 0])).T


def half_width_of(std: Floats) -> float:
    """Mean half-width of the 95 % band, 400 to 700 nm, of standard deviations (681, 3)."""
    return float(half_widths_of(std).mean())


def half_widths_of(std: Floats) -> Floats:
    """The mean half-width of each channel, (3,)."""
    visible = (WAVELENGTHS >= 400.0) & (WAVELENGTHS <= 700.0)
    return np.asarray(BAND * std[visible].mean(axis=0))


def _check_converged(gap: Floats) -> None:
    """Raise unless every gap is a number of at most LARGEST_GAP."""
    if not (gap <= LARGEST_GAP).all():
        raise fail(
            "not_converged.gap",
            value=float(gap.max()) if np.isfinite(gap).all() else None,
            threshold=LARGEST_GAP,
            gap=gap.max(),
        )


def _check_responds_to_white(response: Floats) -> None:
    """Raise unless every curve responds to white."""
    if not (np.isfinite(response).all() and (response > 0).all()):
        raise fail("not_converged.no_response")
