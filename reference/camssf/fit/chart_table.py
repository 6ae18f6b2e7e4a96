"""Chooses between the public tables of a chart whose name states none of them."""

from __future__ import annotations

import numpy as np

from camssf.fit.capture_fit import CaptureFit
from camssf.recovery.basis import basis_of, widened
from camssf.recovery.hypotheses import CLEAR
from camssf.recovery.sensitivity import Ssf
from camssf.recovery.solve import log_evidences
from camssf.rules import rules
from camssf.spectra import ChartTable

OTHER_TABLE = rules().number("choice.other_table")
"""Prior odds of another public table against the default one."""


def likeliest_table(fit: CaptureFit, ssf: Ssf) -> ChartTable:
    """The table of the chart in the photo: the fit's own, unless the posterior odds of another reach CLEAR.

    The evidence of each table is computed on the basis, the kinds of light and the fading that `ssf` found. A basis
    without a prior has no evidence, and keeps the fit's table.
    """
    chart = fit.capture.chart
    others = chart.other_tables() if ssf.posterior is not None else ()
    if not others:
        return chart
    posed = fit.conditioned_on(ssf)
    basis = widened(basis_of(posed.basis), posed.prior_scale)

    tables = [table.faded(ssf.settings.chart_fading) for table in (chart, *others)]
    own, *nats = log_evidences([posed.with_chart(table).given(fit.signals.used) for table in tables], basis)
    best = int(np.argmax(nats))
    return others[best] if nats[best] - own + np.log(OTHER_TABLE) >= np.log(CLEAR) else chart
