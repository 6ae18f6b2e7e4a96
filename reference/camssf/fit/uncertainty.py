"""Uncertainty budget of a fit, in the style of the GUM (JCGM 100:2008)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from camssf.fit.capture_fit import CaptureFit
from camssf.fit.gain_modes import BOWL, PLANE
from camssf.fit.scores import FAINTEST
from camssf.recovery.budget import explain
from camssf.recovery.covariance import CHART_CORRELATION, LAMP_CORRELATION
from camssf.recovery.sensitivity import Ssf


def uncertainty_budget(fit: CaptureFit, ssf: Ssf, alone: Sequence[Ssf]) -> dict[str, Any] | None:
    """The band's width, its width with each shot alone, and the share of each source, as in the result's JSON.

    None on a basis without a prior, which has no band.
    """
    if ssf.std is None:
        return None
    capture, signals = fit.capture, fit.signals
    shares = explain(fit.given(signals.used), basis=fit.basis, prior_scale=fit.prior_scale)
    noise = float(np.median((signals.standard_error / np.maximum(signals.values, FAINTEST))[signals.used]))
    _, white = fit.white_reference()
    lamps = fit.lamps
    sizes = {
        "noise": f"standard errors of the signals, median {noise:.2%}",
        "chart": f"{np.median(capture.chart.tolerance):.1%} a patch, smooth over {CHART_CORRELATION:g} nm, "
        "the same under every lamp",
        "white": f"{white:.1%}, smooth over {CHART_CORRELATION:g} nm",
        "lamp": ", ".join(f"{lamp.tolerance:.1%}" for lamp in lamps) + f", smooth over {LAMP_CORRELATION:g} nm",
        "lamp modes": ", ".join(f"{lamp.name}: {len(lamp.modes)}" for lamp in lamps),
        "uneven light": _evenness(fit),
        "unseen": "the part of the prior's variance that the signals do not reduce",
    }
    between = ssf.light.between
    if between is not None:  # `shares` are those of the most probable hypothesis only
        inside = 1.0 - between
        shares = {source: inside * share for source, share in shares.items()} | {"which lamp": between}
        sizes["which lamp"] = "the difference between the results for each kind of light"
    return {
        "half_width": ssf.half_width,
        "half_width_without_photo": None if ssf.posterior is None else ssf.posterior.half_width_without_photo,
        "alone": [answer.half_width for answer in alone],
        "budget": [
            {"source": source, "size": sizes[source], "share": share.tolist()} for source, share in shares.items()
        ],
    }


def _evenness(fit: CaptureFit) -> str:
    if fit.options.light_per_patch is not None:
        return f"{fit.options.light_per_patch:.1%} from patch to patch, the same for all channels"
    if not fit.gains[0].size:
        return "none: a white frame was taken"
    return f"{PLANE:.0%} of plane and {BOWL:.0%} of bowl across the chart, no white frame"
