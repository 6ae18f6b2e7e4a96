"""Code → ssf: the curves, their bands and their proof."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from camssf.curves.basis import Basis, read_basis
from camssf.curves.engine import OUTPUTS, SHIPPED, Model, load_model
from camssf.curves.sensing import Sensing, anchor, sense
from camssf.curves.unrolled import Code, solve
from camssf.errors import InvalidArgument, LampUnfit, NotConverged
from camssf.grid import STEP, WAVELENGTHS, Floats
from camssf.rules import rules

L2, GAMMA = rules().number("calibration.l2"), rules().number("calibration.gamma")
"""The product's penalties on a whitened basis: almost the Gaussian posterior mean, a little sparser."""
LARGEST_GAP = 1e-6
"""Relative duality gap above which there is no answer."""
ENGINES = ("onnx", "reference")
HIDDEN = rules().number("calibration.hidden")
"""Standard error of a signal that the fit must not see: it weighs nothing."""
SMALLEST_GAMMA = 1e-5
"""The discrepancy principle looks no further down than this share of γ_max."""


@dataclass(frozen=True)
class Ssf:
    """The recovered spectral sensitivity functions. Columns are R, G, B.

    Attributes:
        values: (681, 3) scaled so that Σ ρ_w L s dλ = 1 for the first lamp; `peak()` gives peak = 1.
        std: (681, 3) posterior standard deviation of the curve of peak 1, times its peak, so 0 at the peak itself;
            None where the basis has no prior.
        code: (r, 3) coefficients x.
        predicted: (k, n, 3) the signals that these curves give under `lamp`, 1.
        gap: (3,) relative duality gap of each channel's problem.
        gamma: (3,) the l1 penalty of each channel's problem.
        l2: the quadratic penalty.
        channel_gain: (3,) raw white signal of each channel relative to green; ones where no frame was given.
        basis: its name.
        engine: "onnx" or "reference".
        lamp: (k, 681) each shot's lamp as the answer takes it: as given, but for what the signals say of its modes.
    """

    values: Floats
    std: Floats | None
    code: Floats
    predicted: Floats
    gap: Floats
    gamma: Floats
    l2: float
    channel_gain: Floats
    basis: str
    engine: str
    lamp: Floats

    def peak(self) -> tuple[Floats, Floats | None]:
        """Curves and bands divided by each channel's peak, both (681, 3)."""
        peak = self.values.max(axis=0)
        return self.values / peak, None if self.std is None else self.std / peak


_Frames: TypeAlias = tuple[Floats, ...]
"""Chart, white and dark, each (k, n, 3) DN."""


@dataclass(frozen=True)
class _Evidence:
    """The arguments of `recover`, checked and broadcast: what a solver engine takes."""

    signals: Floats
    standard_error: Floats
    reflectance: Floats
    chart_tolerance: Floats
    white_reflectance: Floats
    white_tolerance: float
    lamp: Floats
    lamp_tolerance: Floats
    lamp_modes: Floats


def recover(
    signals: ArrayLike,
    reflectance: ArrayLike,
    lamp: ArrayLike,
    *,
    standard_error: ArrayLike | None = None,
    chart_tolerance: ArrayLike = 0.03,
    white_reflectance: ArrayLike | None = None,
    white_tolerance: float = 0.01,
    lamp_tolerance: ArrayLike = 0.0,
    lamp_modes: ArrayLike | None = None,
    basis: str | Basis = "cameras",
    l2: float | None = None,
    gamma: ArrayLike | None = None,
    nonnegative: bool | None = None,
    frames: tuple[ArrayLike, ArrayLike, ArrayLike] | None = None,
    engine: str = "onnx",
) -> Ssf:
    """The curves that explain the signals.

    Args:
        signals: (k, n, 3) or (n, 3) of Eq. (5).
        reflectance: (n, 681) of the patches.
        lamp: (k, 681) or (681,) relative power, any scale.
        standard_error: of the signals, same shape; None where unknown.
        chart_tolerance: (n,) or one number, relative.
        white_reflectance: (681,) of the white reference; None for a perfect diffuser.
        white_tolerance: its relative error.
        lamp_tolerance: (k,) or one number, the smooth relative error of each lamp.
        lamp_modes: (k, q, 681) directions in which L may be off, relative to it, each one standard deviation long.
        basis: a name, a file, or a Basis.
        l2, gamma: the penalties λ₂ and γ (one number or one a channel). On a basis with a prior they default to
            1 and 0.05; on the paper's to 0 and to the discrepancy principle: the largest γ whose residual is not
            above the measured noise, rᵀ Σ⁻¹ r ≤ Σ se² / Σ_ii (the ε form, the paper's Eq. (9)), but at least 1e-5
            of the γ that leaves nothing.
        nonnegative: x ≥ 0; None asks for it on a basis without a mean. False gives the paper's literal Eq. (10).
        frames: chart, white and dark (k, n, 3) in DN that the signals came from, for the ratio between the channels;
            the model then forms Eq. (5) itself.
        engine: "onnx", the shipped model, or "reference". A basis without a shipped model takes the reference;
            the answer says which it was.

    With `basis="gaussian"`, no standard errors and zero tolerances Σ = I.

    Raises:
        InvalidArgument: shapes, values or names that do not fit.
        LampUnfit: a lamp without power on the grid.
        NotConverged: a relative duality gap above 1e-6.
    """
    book = basis if isinstance(basis, Basis) else read_basis(str(basis))
    evidence = _check(
        signals, reflectance, lamp, standard_error, chart_tolerance, white_reflectance, white_tolerance,
        lamp_tolerance, lamp_modes, book,
    )  # fmt: skip
    if engine not in ENGINES:
        raise InvalidArgument(f"there is no engine {engine!r}.", f"Take one of {', '.join(ENGINES)}.")
    raw = None if frames is None else tuple(_array("frames", f, evidence.signals.shape) for f in frames)
    positive = not book.prior if nonnegative is None else nonnegative
    weight = (L2 if book.prior else 0.0) if l2 is None else float(_array("l2", l2, ()))
    if gamma is not None:
        sparsity = _array("gamma", gamma)
        if sparsity.shape not in ((), (3,)):
            raise InvalidArgument(f"gamma has shape {sparsity.shape}.", "Give one number, or one a channel.")
        sparsity = np.broadcast_to(sparsity, 3)
    elif book.prior:
        sparsity = np.full(3, GAMMA)
    else:
        noise = np.zeros_like(evidence.signals) if standard_error is None else evidence.standard_error
        sparsity = _discrepancy(_sense(evidence, book), noise, weight, positive)
    if not (np.isfinite(sparsity).all() and (sparsity >= 0).all() and np.isfinite(weight) and weight >= 0):
        raise InvalidArgument(
            f"the penalties l2 = {weight} and gamma = {sparsity.tolist()} must be finite and not negative.",
            "Leave them out to take the defaults.",
        )
    if weight == 0 and (sparsity == 0).any():
        raise InvalidArgument(
            "gamma = 0 and l2 = 0 leave the problem without a unique answer.",
            "Give one of them a positive value, or leave them out to take the defaults.",
        )
    if engine == "onnx" and isinstance(basis, str) and basis in SHIPPED:
        return _run(load_model(basis), evidence, book, weight, sparsity, positive, raw)
    sensing = _sense(evidence, book)
    code = solve(sensing, weight, sparsity, nonnegative=positive)
    return _curves(evidence, book, sensing.lamp, code, weight, sparsity, raw)


def _sense(evidence: _Evidence, book: Basis) -> Sensing:
    return sense(
        evidence.signals,
        evidence.standard_error,
        evidence.reflectance,
        evidence.lamp,
        book,
        chart_tolerance=evidence.chart_tolerance,
        white_reflectance=evidence.white_reflectance,
        white_tolerance=evidence.white_tolerance,
        lamp_tolerance=evidence.lamp_tolerance,
        lamp_modes=evidence.lamp_modes,
    )


def explain(
    signals: ArrayLike,
    reflectance: ArrayLike,
    lamp: ArrayLike,
    *,
    standard_error: ArrayLike | None = None,
    chart_tolerance: ArrayLike = 0.03,
    white_reflectance: ArrayLike | None = None,
    white_tolerance: float = 0.01,
    lamp_tolerance: ArrayLike = 0.0,
    lamp_modes: ArrayLike | None = None,
    basis: str | Basis = "cameras",
) -> dict[str, Floats]:
    """Uncertainty budget: each source's share in the curves' variance, (3,) a source; they add up to 1.

    The posterior mean is x = G b with G = (H + I)⁻¹ Aᵀ Σ⁻¹, so its covariance is the sum over the sources t of
    G Σ_t Gᵀ, and of (I - G A)(I - G A)ᵀ, what the prior leaves open and no patch has seen: "unseen". Shares are of
    the sum over the grid of the variances of the curve of peak 1. Arguments as in `recover`.

    Raises:
        InvalidArgument: as `recover`; also a basis without a prior, which has no variance to share.
    """
    book = basis if isinstance(basis, Basis) else read_basis(str(basis))
    if not book.prior:
        raise InvalidArgument(f"the {book.name} basis has no prior, so no variance.", "Take --basis cameras.")
    evidence = _check(
        signals, reflectance, lamp, standard_error, chart_tolerance, white_reflectance, white_tolerance,
        lamp_tolerance, lamp_modes, book,
    )  # fmt: skip
    sensing = _sense(evidence, book)
    book = anchor(book, evidence.white_reflectance * evidence.lamp[0])
    shares: dict[str, list[float]] = {source: [] for source in (*sensing.terms, "unseen")}
    for c, (A, sigma) in enumerate(zip(sensing.matrix, sensing.covariance, strict=True)):
        weighted = np.linalg.solve(sigma, A)
        gain = np.linalg.solve(A.T @ weighted + np.eye(A.shape[1]), weighted.T)
        curve = book.mean[c] + book.dictionary[c] @ gain @ sensing.target[c]
        moves = _moves(book, np.broadcast_to(curve, book.mean.shape))[c]
        across = moves @ gain
        sizes = {source: float(np.sum((across @ term[c]) * across)) for source, term in sensing.terms.items()}
        sizes["unseen"] = float(np.sum((moves - across @ A) ** 2))
        for source, size in sizes.items():
            shares[source].append(size / sum(sizes.values()))
    return {source: np.array(share) for source, share in shares.items()}


@dataclass(frozen=True)
class Prediction:
    """Signals and how far the true ones may lie from them.

    Attributes:
        values: (k, p, 3), 1.
        std: (k, p, 3) one standard deviation of true, noise-free signal less prediction.
    """

    values: Floats
    std: Floats


def predict(
    ssf: Ssf,
    signals: ArrayLike,
    reflectance: ArrayLike,
    lamp: ArrayLike,
    *,
    of: ArrayLike | None = None,
    of_tolerance: ArrayLike = 0.0,
    standard_error: ArrayLike | None = None,
    chart_tolerance: ArrayLike = 0.03,
    white_reflectance: ArrayLike | None = None,
    white_tolerance: float = 0.01,
    lamp_tolerance: ArrayLike = 0.0,
    lamp_modes: ArrayLike | None = None,
    basis: str | Basis = "cameras",
) -> Prediction:
    """The signals that the curves give of the patches they come from, then of other surfaces `of`, with their bands.

    A true signal is t = A x + e of a row, where e is what chart, white and lamp do to it; the measured ones, with
    noise ν, gave x̂ = G (A x + e + ν). So t - A x̂ = (I - A G)(A x + e) - A G ν, and its variance is the diagonal of
    (I - A G)(A Aᵀ + Σ - N)(I - A G)ᵀ + A G N Gᵀ Aᵀ with N the noise's part of Σ: what the data leave open of the
    curves, and what no data can tell of this very surface and light. A surface that was not measured stands in the
    rows with a standard error without end. The small l1 penalty is left out, as in `explain`. Under a lamp with modes
    the bands are a little wide: of its u each channel counts as known only what the other two tell.

    Args:
        ssf: the answer to the other arguments, as they were given to `recover`.
        of: (p, 681) reflectances of the other surfaces, seen under the same lamps; None for none.
        of_tolerance: how well these are known, (p,) or one number; 0 for surfaces of exactly that reflectance.

    Returns:
        n + p surfaces: the n of `reflectance`, then the p of `of`.

    Raises:
        InvalidArgument: as `recover`; also a basis without a prior, which has no bands.
    """
    book = basis if isinstance(basis, Basis) else read_basis(str(basis))
    if not book.prior:
        raise InvalidArgument(f"the {book.name} basis has no prior, so no bands.", "Take --basis cameras.")
    evidence = _check(
        signals, reflectance, lamp, standard_error, chart_tolerance, white_reflectance, white_tolerance,
        lamp_tolerance, lamp_modes, book,
    )  # fmt: skip
    others = np.zeros((0, WAVELENGTHS.size)) if of is None else np.atleast_2d(_array("of", of))
    if others.shape[1:] != (WAVELENGTHS.size,):
        raise InvalidArgument(f"of has shape {others.shape}.", "Give reflectances (p, 681) on the grid.")
    k, p = len(evidence.signals), len(others)
    all_ = np.concatenate([evidence.reflectance, others])
    values = respond(ssf.values, all_, ssf.lamp, evidence.white_reflectance)
    n = len(evidence.reflectance)
    hidden = evidence.standard_error >= HIDDEN
    sensing = _sense(
        replace(
            evidence,
            signals=np.concatenate([np.where(hidden, values[:, :n], evidence.signals), values[:, n:]], axis=1),
            standard_error=np.concatenate([evidence.standard_error, np.full((k, p, 3), HIDDEN)], axis=1),
            reflectance=all_,
            chart_tolerance=np.concatenate([evidence.chart_tolerance, _tolerance("of_tolerance", of_tolerance, p)]),
        ),
        book,
    )
    # A row is a difference of signals times its curve's white signal over W.
    first = evidence.lamp[0] * evidence.white_reflectance * STEP
    seen = (ssf.lamp * evidence.white_reflectance * STEP) @ ssf.values * (book.mean @ first)  # (k, 3)
    std = np.empty((3, k, n + p))
    for c, (A, sigma) in enumerate(zip(sensing.matrix, sensing.covariance, strict=True)):
        weighted = np.linalg.solve(sigma, A)
        smoother = A @ np.linalg.solve(A.T @ weighted + np.eye(A.shape[1]), weighted.T)
        rest = np.eye(len(A)) - smoother
        noise = np.diag(sensing.terms["noise"][c])
        kept = A @ A.T + sum(term[c] for source, term in sensing.terms.items() if source != "noise")
        variance = np.sum(rest @ kept * rest, axis=1) + smoother**2 @ noise
        std[c] = np.sqrt(variance).reshape(k, n + p) * (sensing.white[c] / seen[:, c])[:, None]
    return Prediction(values, np.moveaxis(std, 0, -1))


def _curves(
    evidence: _Evidence, book: Basis, lamp: Floats, code: Code, l2: float, gamma: Floats, raw: _Frames | None
) -> Ssf:
    """The reference's last step: s = μ + Ψ x, scaled so that Σ ρ_w L s dλ = 1 for the first lamp."""
    _believe(code.gap)
    book = anchor(book, evidence.white_reflectance * evidence.lamp[0])
    curves = book.mean + np.einsum("cmr,cr->cm", book.dictionary, code.values)  # (3, m)
    scale = curves @ (evidence.white_reflectance * evidence.lamp[0]) * STEP
    _respond(scale)
    std = None
    if book.prior:
        spread = np.linalg.inv(code.precision + np.eye(code.values.shape[1]))
        moves = _moves(book, curves)
        variance = np.maximum(np.einsum("cmr,crs,cms->cm", moves, spread, moves), 0.0)
        std = (np.sqrt(variance) / scale[:, None]).T
    values = (curves / scale[:, None]).T
    predicted = respond(values, evidence.reflectance, lamp, evidence.white_reflectance)
    gain = np.ones(3)
    if raw is not None:
        means = (raw[1] - raw[2])[0].mean(axis=0)
        gain = means / means[1]
    return Ssf(values, std, code.values.T, predicted, code.gap, gamma, l2, gain, book.name, "reference", lamp)


def respond(values: Floats, reflectance: Floats, lamp: Floats, white_reflectance: Floats) -> Floats:
    """Signals (k, n, 3) that curves (681, 3) of any scale give of patches (n, 681) under lamps (k, 681), Eq. (5)."""
    seen = (lamp[:, None, :] * reflectance) @ values
    return np.asarray(seen / ((lamp * white_reflectance) @ values)[:, None, :])


def _moves(book: Basis, curves: Floats) -> Floats:
    """How the code moves the curve of peak 1, times the peak, (3, m, r).

    With ŝ = s / s_p, p where s peaks, an error d s moves ŝ by (d s - ŝ d s_p) / s_p: Ψ - ŝ Ψ_p.
    """
    top = curves.argmax(axis=1)
    at_peak = np.take_along_axis(book.dictionary, top[:, None, None], axis=1)  # (3, 1, r)
    shape = curves / np.take_along_axis(curves, top[:, None], axis=1)
    return np.asarray(book.dictionary - shape[:, :, None] * at_peak)


def _run(
    model: Model, evidence: _Evidence, book: Basis, l2: float, gamma: Floats, nonnegative: bool, raw: _Frames | None
) -> Ssf:
    """The model's answer; it takes one γ a call, so channels that differ in γ take a call each."""
    y = evidence.signals
    chart, white, dark = raw if raw is not None else (y, np.ones_like(y), np.zeros_like(y))
    modes = evidence.lamp_modes if evidence.lamp_modes.shape[1] else np.zeros((len(y), 1, WAVELENGTHS.size))
    inputs: dict[str, Floats] = {
        "chart": chart,
        "white": white,
        "dark": dark,
        "standard_error": evidence.standard_error,
        "reflectance": evidence.reflectance,
        "chart_tolerance": evidence.chart_tolerance,
        "white_reflectance": evidence.white_reflectance,
        "white_tolerance": np.array(evidence.white_tolerance),
        "lamp": evidence.lamp,
        "lamp_tolerance": evidence.lamp_tolerance,
        "lamp_modes": modes,
        "l2": np.array(l2),
        "nonnegative": np.array(float(nonnegative)),
    }
    answers = {value: model.run(inputs | {"gamma": np.array(value)}) for value in np.unique(gamma)}
    lamp = answers[gamma[0]]["lamp_estimate"]  # γ has no part in it
    out = {
        name: np.stack([answers[value][name][..., c] for c, value in enumerate(gamma)], axis=-1)
        for name in OUTPUTS
        if name != "lamp_estimate"
    }
    _believe(out["gap"])
    _respond(out["ssf"].max(axis=0))
    std = out["ssf_std"] if book.prior else None
    return Ssf(
        out["ssf"], std, out["code"], out["predicted"], out["gap"], gamma, l2, out["channel_gain"], book.name, "onnx",
        lamp,
    )  # fmt: skip


def _believe(gap: Floats) -> None:
    """Refuse an answer without its proof; a gap that is NaN is none."""
    if not (gap <= LARGEST_GAP).all():
        raise NotConverged(
            f"the solver's own proof failed: relative duality gap {gap.max():.1e}.",
            "Look for a patch or lamp that does not belong to the photo; otherwise report this with the file.",
            value=float(gap.max()) if np.isfinite(gap).all() else None,
            threshold=LARGEST_GAP,
        )


def _respond(response: Floats) -> None:
    """Refuse curves that do not see white."""
    if not (np.isfinite(response).all() and (response > 0).all()):
        raise NotConverged(
            "a recovered curve has no response to white: the penalty gamma left nothing of it, or the signals of a "
            "channel are empty.",
            "Take a smaller gamma, and check that the photo is exposed in all three channels.",
        )


def _discrepancy(sensing: Sensing, noise: Floats, l2: float, nonnegative: bool) -> Floats:
    """The largest γ of each channel whose residual is not above the measured noise (Morozov 1966).

    rᵀ Σ⁻¹ r grows with γ; where even SMALLEST_GAMMA · γ_max leaves more than the noise, that is taken.
    """
    from scipy.optimize import brentq

    chosen = []
    variances = np.moveaxis(noise**2, -1, 0).reshape(3, -1)
    for A, b, sigma, variance in zip(sensing.matrix, sensing.target, sensing.covariance, variances, strict=True):
        inverse = np.linalg.inv(sigma)
        expected = float(np.sum(variance / np.diag(sigma)))
        pull = A.T @ inverse @ b
        largest = float(np.max(pull if nonnegative else np.abs(pull), initial=0.0))
        if largest <= 0:
            chosen.append(1.0)  # nothing to explain: any penalty gives the zero code
            continue
        channel = Sensing(A[None], b[None], sigma[None])
        excess = _excess(channel, inverse, expected, l2, nonnegative)
        low, high = np.log(SMALLEST_GAMMA * largest), np.log(largest)
        if expected == 0 or excess(low) >= 0:
            chosen.append(np.exp(low))
        elif excess(high) <= 0:
            chosen.append(np.exp(high))
        else:
            chosen.append(np.exp(brentq(excess, low, high, xtol=0.01)))
    return np.array(chosen)


def _excess(
    channel: Sensing, inverse: Floats, expected: float, l2: float, nonnegative: bool
) -> Callable[[float], float]:
    """ln(rᵀ Σ⁻¹ r / expected) as a function of ln γ."""

    def excess(log_gamma: float) -> float:
        code = solve(channel, l2, np.array([np.exp(log_gamma)]), nonnegative=nonnegative)
        r = channel.target[0] - channel.matrix[0] @ code.values[0]
        return float(np.log(max(r @ inverse @ r, 1e-300) / expected))

    return excess


def _check(
    signals: ArrayLike,
    reflectance: ArrayLike,
    lamp: ArrayLike,
    standard_error: ArrayLike | None,
    chart_tolerance: ArrayLike,
    white_reflectance: ArrayLike | None,
    white_tolerance: float,
    lamp_tolerance: ArrayLike,
    lamp_modes: ArrayLike | None,
    book: Basis,
) -> _Evidence:
    m = WAVELENGTHS.size
    y = _array("signals", signals)
    y = y[None] if y.ndim == 2 else y
    if y.ndim != 3 or y.shape[2] != 3 or 0 in y.shape:
        raise InvalidArgument(
            f"signals have shape {y.shape}; (k, n, 3) or (n, 3) is needed.", "Give every shot the same patches."
        )
    k, n, _ = y.shape
    R = _array("reflectance", reflectance, (n, m))
    L = _array("lamp", lamp)
    L = np.broadcast_to(L, (k, m)) if L.shape == (m,) else _array("lamp", lamp, (k, m))
    if (L < 0).any() or (L.max(axis=1) <= 0).any():
        raise LampUnfit(
            "the lamp has negative power, or none at all, between 380 and 720 nm.",
            "Give the spectrum of the light that fell on the chart, in nm and relative power.",
        )
    plain = standard_error is None and not np.any(chart_tolerance) and not book.prior
    if standard_error is None:
        se = np.full(y.shape, 1.0 if plain else 0.0)
    else:
        se = _array("standard_error", standard_error)
        if se.size != y.size:
            raise InvalidArgument(
                f"standard_error has {se.size} values, the signals {y.size}.", "Give one for each signal."
            )
        se = se.reshape(y.shape)
    rho = np.ones(m) if white_reflectance is None else _array("white_reflectance", white_reflectance, (m,))
    if not (rho >= 0).all() or not (rho @ L.T > 0).all():
        raise InvalidArgument(
            "the white reference reflects nothing under the lamp.", "Give its reflectance on the grid, 0 to 1."
        )
    modes = np.zeros((k, 0, m)) if lamp_modes is None else _array("lamp_modes", lamp_modes)
    if modes.ndim == 2:
        modes = modes[None]
    if modes.ndim != 3 or modes.shape[::2] != (k, m):
        raise InvalidArgument(
            f"lamp_modes have shape {modes.shape}; ({k}, q, {m}) is needed.", "Give q modes a shot."
        )
    evidence = _Evidence(
        y, se, R, _tolerance("chart_tolerance", chart_tolerance, n), rho,
        float(_tolerance("white_tolerance", white_tolerance, 1)[0]), L,
        _tolerance("lamp_tolerance", lamp_tolerance, k), modes,
    )  # fmt: skip
    if (se < 0).any():
        raise InvalidArgument("a standard error is negative.", "Give standard errors ≥ 0.")
    if not book.prior and k > 1:
        raise InvalidArgument(
            f"the {book.name} basis takes one shot, not {k}: each shot's exposure would be a further unknown.",
            "Give one photo, or take --basis cameras, whose rows are free of exposure.",
        )
    return evidence


def _array(name: str, value: ArrayLike, shape: tuple[int, ...] | None = None) -> Floats:
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidArgument(
            f"{name} is not an array of numbers: {error}.", "Give every shot the same patches and channels."
        ) from error
    if shape is not None and array.shape != shape:
        raise InvalidArgument(f"{name} has shape {array.shape}; {shape} is needed.", "Put it on the 681-point grid.")
    if not np.isfinite(array).all():
        raise InvalidArgument(f"{name} holds NaN or infinity.", "Leave out what could not be measured.")
    return array


def _tolerance(name: str, value: ArrayLike, size: int) -> Floats:
    array = _array(name, value)
    if array.shape not in ((), (1,), (size,)) or (array < 0).any():
        raise InvalidArgument(
            f"{name} must be one number or {size} numbers, not negative; it has shape {array.shape}.",
            "Write 3 % as 0.03.",
        )
    return np.broadcast_to(array.reshape(-1), size).copy()
