"""Solves the fit of a capture: on any of its patches, each shot alone, under each public table, and fold by fold.

`uncertainty_budget` states the sources of the band's width, in the style of the GUM (JCGM 100:2008).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camssf.errors import InvalidArgument
from camssf.fit.capture_fit import BOWL, PLANE, CaptureFit
from camssf.fit.scores import FAINTEST, Scores, validate
from camssf.grid import Floats
from camssf.options import Options
from camssf.recovery.basis import LEARNED, basis_of, widened
from camssf.recovery.budget import explain
from camssf.recovery.covariance import CHART_CORRELATION, LAMP_CORRELATION
from camssf.recovery.evidence import log_evidences
from camssf.recovery.hypotheses import CLEAR, LampGuess, likely_kinds, recover
from camssf.recovery.prediction import Prediction, predict, predict_together
from camssf.recovery.sensitivity import Problem, SolverSettings, Ssf, predict_signals, solve_together
from camssf.rules import rules
from camssf.shapes import Rgb, Size, Text
from camssf.spectra import ChartTable
from camssf.spectra.lights import PossibleLamps, kind_of

MOST_UNNAMED = rules().whole("lamp.most")
"""Largest number of shots whose light is not named."""
COMBINED = rules().whole("lamp.combined")
"""Most combinations of several shots' lamps."""


def recover_fit(fit: CaptureFit, used: NDArray[np.bool_], gamma: ArrayLike | None) -> Ssf:
    """`recover` on the used patches (k, n); the result predicts all n patches.

    Raises:
        InvalidArgument: the light of more than MOST_UNNAMED shots is not named; else as `recover`.
        NotConverged: as `recover`.
    """
    return recover(
        _guesses(fit, used) if any(fit.uncertain) else fit.given(used),
        basis=fit.basis,
        prior=fit.prior_odds,
        prior_scale=fit.prior_scale,
        of=fit.capture.chart.values,
        settings=_settings(fit.options, gamma),
    )


def _settings(options: Options, gamma: ArrayLike | None) -> SolverSettings:
    return SolverSettings(l2=options.l2, gamma=gamma, nonnegative=options.nonnegative, engine=options.engine)


def recover_each_shot(fit: CaptureFit) -> list[Ssf]:
    """The solution of each shot alone; empty if there is only one shot."""
    k = len(fit.capture.shots)
    shots = np.eye(k, dtype=bool)[:, :, None] if k > 1 else ()
    return [recover_fit(fit, fit.signals.used & shot, fit.options.gamma) for shot in shots]


def recover_folds(
    fit: CaptureFit, masks: Sequence[NDArray[np.bool_]], gamma: ArrayLike | None
) -> list[tuple[Ssf, Floats | None]]:
    """`recover_fit` and `prediction_bands` on each of several masks (k, n) of one capture.

    On a learned basis under named lamps all are solved together: what a mask leaves out is masked.
    """
    table = fit.capture.chart
    if any(fit.uncertain) or not (isinstance(fit.basis, str) and fit.basis in LEARNED):
        answers = [recover_fit(fit, mask, gamma) for mask in masks]
        return [(ssf, prediction_bands(fit, mask, ssf)) for mask, ssf in zip(masks, answers, strict=True)]
    taken = np.any(masks, axis=(0, 1))
    whole = fit.given(np.any(masks, axis=0))
    observations = [replace(whole, used=mask[:, taken]) for mask in masks]
    problems = [Problem(observation, fit.basis, fit.prior_scale) for observation in observations]
    answers = solve_together(problems, _settings(fit.options, gamma))
    predictions = predict_together(
        answers, observations, of=table.values[~taken], of_tolerance=table.tolerance[~taken],
        of_gains=fit.gains[0][:, :, ~taken], basis=fit.basis,
    )  # fmt: skip
    rho = whole.white_reflectance
    return [
        (
            replace(ssf, predicted=predict_signals(ssf.values, table.values, ssf.lamp, rho)),
            _by_patch(one, taken),
        )
        for ssf, one in zip(answers, predictions, strict=True)
    ]


def _by_patch(prediction: Prediction, first: NDArray[np.bool_]) -> Floats:
    """The standard deviations (k, n, 3) of a prediction of the patches `first`, then of the others, by patch."""
    std = np.empty_like(prediction.std)
    std[:, first], std[:, ~first] = prediction.std[:, : first.sum()], prediction.std[:, first.sum() :]
    return std


def prediction_bands(fit: CaptureFit, used: NDArray[np.bool_], ssf: Ssf) -> Floats | None:
    """(k, n, 3) standard deviation of each true signal minus its prediction by a fit to the used patches."""
    if ssf.std is None:
        return None
    table, taken = fit.capture.chart, np.asarray(used.any(axis=0))
    others, tolerance = table.values[~taken], table.tolerance[~taken]
    modes = fit.gains[0][:, :, ~taken]
    prediction = predict(ssf, fit.given(used), of=others, of_tolerance=tolerance, of_gains=modes, basis=fit.basis)
    return _by_patch(prediction, taken)


def _guesses(fit: CaptureFit, used: NDArray[np.bool_]) -> list[LampGuess]:
    """The combinations of the possible lamps of the shots."""
    if sum(fit.unnamed) > MOST_UNNAMED:
        raise InvalidArgument(
            f"The light of {sum(fit.unnamed)} shots was not named; at most {MOST_UNNAMED} can be estimated at once.",
            "Name the lamp of the others, at least its kind: daylight, bulb, white-led or fluorescent.",
        )
    kinds = combined([_kinds(fit, used, j) for j in range(len(fit.capture.shots))])
    return [_guess(fit, used, kind) for kind in kinds]


def combined(kinds: Sequence[Sequence[tuple[str, float]]]) -> list[tuple[str, ...]]:
    """The combinations of the shots' kinds, at most COMBINED of them: the most probable by each shot alone.

    They stand in the order of the kinds; of equally probable ones the first stay.
    """
    some: list[tuple[tuple[str, ...], float]] = [((), 1.0)]
    for own in kinds:
        every = [((*before, kind), p * probability) for before, p in some for kind, probability in own]
        best = sorted(range(len(every)), key=lambda i: -every[i][1])[:COMBINED]
        some = [every[i] for i in sorted(best)]
    return [kind for kind, _ in some]


def _kinds(fit: CaptureFit, used: NDArray[np.bool_], j: int) -> list[tuple[str, float]]:
    """The lamps of shot j's light that are combined with those of the other shots; "" if it is certain.

    Their probabilities are those by the shot alone; equal if there is no other uncertain light.
    """
    light = fit.capture.shots[j].lamp
    if not isinstance(light, PossibleLamps):
        return [("", 1.0)]
    kinds = [lamp.name for lamp in light.lamps]
    if sum(fit.uncertain) == 1:
        return [(kind, 1.0) for kind in kinds]
    alone, own = fit.of_shot(j), used[j : j + 1]
    likely = likely_kinds([_guess(alone, own, (kind,)) for kind in kinds], fit.basis, fit.prior_odds)
    return list(likely.items())


def _guess(fit: CaptureFit, used: NDArray[np.bool_], kinds: tuple[str, ...]) -> LampGuess:
    belief = sum(
        dict(zip([lamp.name for lamp in shot.lamp.lamps], shot.lamp.log_prior, strict=True))[kind]
        for kind, shot in zip(kinds, fit.capture.shots, strict=True)
        if isinstance(shot.lamp, PossibleLamps)
    )
    tabulated = any(not kind or kind_of(kind) is None for kind in kinds)
    return LampGuess(kinds, fit.with_kinds(kinds).given(used), belief, tabulated)


OTHER_TABLE = rules().number("choice.other_table")
"""Prior odds of another public table against the default one."""


def likeliest_table(fit: CaptureFit, ssf: Ssf) -> ChartTable:
    """The table of the chart in the photo: the fit's own, unless the posterior odds of another reach CLEAR.

    The evidence of each table is computed on the basis, the kinds of light and the fading that `ssf` found. A basis
    without a prior has no evidence, and keeps the fit's table.
    """
    chart = fit.capture.chart
    others = chart.other_tables() if ssf.std is not None else ()
    if not others:
        return chart
    posed = fit.conditioned_on(ssf)
    basis = widened(basis_of(posed.basis), posed.prior_scale)

    tables = [table.faded(ssf.chart_fading) for table in (chart, *others)]
    own, *nats = log_evidences([posed.with_chart(table).given(fit.signals.used) for table in tables], basis)
    best = int(np.argmax(nats))
    return others[best] if nats[best] - own + np.log(OTHER_TABLE) >= np.log(CLEAR) else chart


FOLDS = rules().whole("calibration.folds")
"""Number of folds; each patch is predicted by a fit that leaves its fold out."""


@dataclass(frozen=True)
class CrossValidation:
    """Predictions of patches by fits that did not use them.

    Attributes:
        values: (k, n, 3) predictions in even light, as `Ssf.predicted`; NaN where every fit used the patch.
        std: (k, n, 3) one standard deviation of the true signals minus these; None without a prior.
        method: the method, in words.
    """

    values: Floats
    std: Floats | None
    method: str


def cross_validate(fit: CaptureFit, ssf: Ssf, predicted_std: Floats | None) -> CrossValidation:
    """Predict the patches that `ssf` did not use by `ssf` itself; if there are none, all patches fold by fold."""
    capture, signals = fit.capture, fit.signals
    rest = ~fit.allowed
    if capture.shots[0].means.white is None:
        rest = rest & (np.arange(rest.size) != capture.chart.white)  # its signal is 1 whatever the curves
    if rest.any():
        out = rest[None, :, None]
        std = None if predicted_std is None else np.where(out, predicted_std, np.nan)
        method = f"{int(rest.sum())} patches that did not enter the fit"
        return CrossValidation(np.where(out, ssf.predicted, np.nan), std, method)
    taken, level = np.flatnonzero(signals.used.any(axis=0)), fit.level(ssf)[:, :, None]
    values = np.full(ssf.predicted.shape, np.nan)
    std = None if predicted_std is None else values.copy()
    folds = np.zeros((FOLDS, rest.size), dtype=bool)
    for fold, left_out in enumerate(folds):
        left_out[taken[fold::FOLDS]] = True
    masks = [signals.used & ~left_out for left_out in folds]
    solved = recover_folds(fit, masks, ssf.gamma)
    for left_out, (answer, band) in zip(folds, solved, strict=True):
        # Each fold estimates its own illumination. Its predictions are rescaled to the full fit's.
        scale = (level / fit.level(answer)[:, :, None])[:, left_out]
        values[:, left_out] = scale * answer.predicted[:, left_out]
        if std is not None and band is not None:
            std[:, left_out] = scale * band[:, left_out]
    values[~signals.used] = np.nan
    return CrossValidation(
        values, std, f"each of {taken.size} patches, by a fit that left its quarter of the chart out"
    )


def score(fit: CaptureFit, ssf: Ssf, held_out: CrossValidation) -> Scores:
    """`validate` on the cross-validated predictions; `ssf.predicted` fills the places that do not count.

    The signals are corrected to even light.
    """
    counts = np.all(np.isfinite(held_out.values), axis=2)
    predicted = np.where(counts[:, :, None], held_out.values, ssf.predicted)
    table = fit.capture.chart
    return validate(fit.levelled(ssf), predicted, table, fit.lamps, unseen=counts, method=held_out.method)


@dataclass(frozen=True, eq=False)
class UncertaintySource:
    """One source of the band.

    Attributes:
        source: its name.
        size: how large it was taken to be, in words.
        share: part of each channel's variance.
    """

    source: Text
    size: Text
    share: Rgb


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """The width of the band and where it comes from. Widths are means of the 95 % band's half-width, 400 to 700 nm.

    Attributes:
        half_width: in parts of the peak.
        half_width_without_photo: the same of the basis alone, before any photo.
        alone: of each shot alone, if there are several.
        budget: the sources.
    """

    half_width: Size
    half_width_without_photo: Size | None
    alone: tuple[Size, ...]
    budget: tuple[UncertaintySource, ...]


def uncertainty_budget(fit: CaptureFit, ssf: Ssf, alone: Sequence[Ssf]) -> Uncertainty | None:
    """The band's width, its width with each shot alone, and the share of each source.

    None on a basis without a prior, which has no band.
    """
    width = ssf.half_width
    if width is None:
        return None
    capture, signals = fit.capture, fit.signals
    shares = explain(fit.given(signals.used), basis=fit.basis, prior_scale=fit.prior_scale)
    noise = float(np.median((signals.standard_error / np.maximum(signals.values, FAINTEST))[signals.used]))
    _, white = fit.white_reference()
    lamps = fit.lamps
    sizes = {
        "noise": f"standard errors of the signals, median {noise:.2%}",
        "chart": f"{np.median(capture.chart.tolerance):.1%} a patch, smooth over {CHART_CORRELATION:g} nm, "
        "more in the deep red, the same under every lamp",
        "white": f"{white:.1%}, smooth over {CHART_CORRELATION:g} nm",
        "lamp": ", ".join(f"{lamp.tolerance:.1%}" for lamp in lamps) + f", smooth over {LAMP_CORRELATION:g} nm",
        "lamp modes": ", ".join(f"{kind_of(lamp.name) or lamp.name}: {len(lamp.modes)}" for lamp in lamps),
        "uneven light": _evenness(fit),
        "unseen": "the part of the prior's variance that the signals do not reduce, and what every basis misses",
    }
    between = ssf.between
    if between is not None:  # `shares` are those of the most probable hypothesis only
        inside = 1.0 - between
        shares = {source: inside * share for source, share in shares.items()} | {"which lamp": between}
        sizes["which lamp"] = "the difference between the results for each kind of light"
    return Uncertainty(
        half_width=width,
        half_width_without_photo=ssf.half_width_without_photo,
        alone=tuple(answer.half_width or 0.0 for answer in alone),
        budget=tuple(UncertaintySource(source, sizes[source], share) for source, share in shares.items()),
    )


def _evenness(fit: CaptureFit) -> str:
    if fit.options.light_per_patch is not None:
        return f"{fit.options.light_per_patch:.1%} from patch to patch, the same for all channels"
    if not fit.gains[0].size:
        return "none: a white frame was taken"
    return f"{PLANE:.0%} of plane and {BOWL:.0%} of bowl across the chart, no white frame"
