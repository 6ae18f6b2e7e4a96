"""Checks patch statistics: exposure, usable patches, noise, green channels, dirt (rule 6 of docs/verdict.md)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from camssf.photo.patches import FrameMeans, PatchMeans
from camssf.photo.signals import Signals
from camssf.rules import rules
from camssf.spectra import ChartTable
from camssf.verdict.reasons import Checks, Reason, because

_NUMBER = rules().number
VEIL, VEIL_REFUSES = _NUMBER("verdict.veil"), _NUMBER("verdict.veil_refuses")
FEW_PATCHES = rules().whole("verdict.few_patches")
DARK_WHITE = _NUMBER("verdict.dark_white")
SMOOTH, ROUGH = _NUMBER("verdict.smooth"), _NUMBER("verdict.rough")
GREENS, DIRTY = _NUMBER("verdict.greens"), _NUMBER("verdict.dirty")


def exposure(signals: Signals, j: int, shot: PatchMeans, checks: Checks) -> list[Reason]:
    """Check the white's level and the darkest patch's signal of shot j."""
    reasons: list[Reason] = []
    span = shot.saturation - signals.dark[j]
    level = float(((signals.white[j] - signals.dark[j]) / span).mean(axis=0).max())
    checks.note("dark_white", level, j)
    if level < DARK_WHITE:
        reasons.append(because("dark_white", level, {"shot": j + 1, "level": level}))
    veil = float(signals.values[j].min(axis=0).max())
    checks.note("veil", veil, j)
    if veil > VEIL:
        reasons.append(because("darkest_patch", veil, {"shot": j + 1, "share": veil}, fatal=veil > VEIL_REFUSES))
    return reasons


def few(used: NDArray[np.bool_], j: int, means: PatchMeans, checks: Checks) -> list[Reason]:
    """Check that shot j has enough usable patches."""
    count = int(used.sum())
    checks.note("few_patches", count, j)
    if count >= FEW_PATCHES:
        return []
    clipped = bool((means.chart.clipped[~used] > 0).any())
    return [
        because("few_clipped" if clipped else "few_dark", count, {"shot": j + 1, "left": count, "all": used.size})
    ]


def samples(means: PatchMeans, used: NDArray[np.bool_], j: int, table: ChartTable, checks: Checks) -> list[Reason]:
    """Check noise and green channels (rule 6) and outliers of shot j."""
    reasons: list[Reason] = []
    chart = means.chart
    dirty = int(np.argmax(chart.dead.max(axis=1)))
    share = float(chart.dead[dirty].max())
    checks.note("dirty", share, j)
    if share > DIRTY:
        reasons.append(because("dirt", share, {"shot": j + 1, "share": share, "patch": table.patches[dirty]}))
    above = np.maximum(chart.greens.mean(axis=1) - means.black[1], 1.0)
    greens = float(np.median((np.abs(chart.greens[:, 0] - chart.greens[:, 1]) / above)[used]))
    checks.note("greens", greens, j)
    if greens > GREENS:
        reasons.append(because("greens", greens, {"shot": j + 1, "share": greens}))
    if means.white is not None and means.dark is not None:
        grain, texture = noise(chart, means.white, means.dark, used)
        checks.note("smooth", grain, j)
        checks.note("rough", texture, j)
        if grain < SMOOTH:
            reasons.append(because("smooth", grain, {"shot": j + 1, "grain": grain}))
        if texture > ROUGH:
            reasons.append(because("rough", texture, {"shot": j + 1, "texture": texture}))
    return reasons


def noise(chart: FrameMeans, white: FrameMeans, dark: FrameMeans, used: NDArray[np.bool_]) -> tuple[float, float]:
    """Grain and texture of the used patches (rule 6)."""
    V, V_W, V_D = ((f.standard_error**2 * f.count)[used] for f in (chart, white, dark))
    signal = (chart.mean - dark.mean)[used]
    expected = np.maximum(V_D + (V_W - V_D) * signal / (white.mean - dark.mean)[used], 1.0 / 12.0)
    texture = np.sqrt(np.maximum(V - expected, 0.0)) / np.maximum(signal, 1.0)
    return float(np.median(V / expected)), float(np.median(texture))
