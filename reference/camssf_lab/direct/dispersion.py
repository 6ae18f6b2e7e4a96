"""Calibrates the wavelength of each pixel in a spectrum of sunlight from its Fraunhofer lines.

No data of the spectrograph are needed. First the spectrum's fine structure is matched to a template of the sun's
strong lines, for all plausible wavelength ranges, both directions and a slight curvature; the best match predicts the
position of each line. Then the centre of each line is fitted there, and a parabola through the centres is the
dispersion: λ = c₀ + c₁ t + c₂ t², t the pixel in half-widths of the lit part.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from camssf.errors import CalibrationError
from camssf.grid import Floats
from camssf.messages import fail

LINES = (
    ("K", 393.366, 0.25, 0.50),
    ("H", 396.847, 0.25, 0.30),
    ("Hδ", 410.174, 0.20, 0.05),
    ("G", 430.60, 0.30, 0.40),
    ("Fe", 438.60, 0.45, 0.10),
    ("F", 486.134, 0.15, 0.14),
    ("b", 517.55, 0.25, 0.12),
    ("E", 526.99, 0.20, 0.07),
    ("D", 589.251, 0.15, 0.09),
    ("C", 656.281, 0.10, 0.13),
    ("B", 687.45, 0.35, 0.22),
)
"""Name, wavelength in air (nm), its standard error at a resolution of 1 to 3 nm (nm), and depth at 2 nm.

Single lines have their tabulated wavelengths. Blends are at their centres of gravity: b of b1, b2, b4 (518.362,
517.270, 516.733), D of D2, D1 (588.995, 589.592), E of 526.954 and 527.036, G of the CH band at 430 to 431.5. B, the
oxygen band of the air with its head at 686.719, is at the middle of the band."""
OTHERS = (
    (382.8, 0.25), (413.9, 0.02), (419.6, 0.04), (445.7, 0.05), (453.2, 0.03), (459.5, 0.03), (470.3, 0.05),
    (501.4, 0.05), (507.9, 0.02), (533.2, 0.04), (540.6, 0.07), (559.1, 0.04), (570.5, 0.03), (616.4, 0.03),
    (628.2, 0.05), (649.4, 0.04), (701.5, 0.04), (719.0, 0.22), (728.0, 0.08), (760.8, 0.90), (817.0, 0.20),
    (823.0, 0.20), (935.0, 0.60),
)  # fmt: skip
"""(wavelength in nm, depth) of fainter blends of the sun (iron, calcium, magnesium) and of oxygen and water in the
air; only for the template, not for the fit."""
FEWEST, SPAN = 5, 150.0
"""Smallest number of lines for a dispersion, and the smallest range that they span, nm."""
LARGEST_RESIDUAL, LARGEST_RMS = 1.0, 0.3
"""Largest residual of a line, and largest RMS residual of all lines, nm."""
BENT, MOST_BENT = 0.004, 0.012
"""Curvature |c₂ / c₁| of the dispersion: one standard deviation, and the maximum. A lens of 100 mm on 150 lines/mm
gives 0.001, one of 35 mm at 15 degrees 0.008."""
FAINT = 0.05
"""Dips below this fraction of the largest signal are ignored; they may be due to the camera's filters."""
LEAST_LIKENESS = 0.52
"""Smallest correlation of the fine structure with the template; below it the light is taken not to be sunlight."""
_DARK = 0.02
_WINDOW = 4.0


_Dip: TypeAlias = tuple[str, float, float, float, float]
"""Name, tabulated wavelength (nm), t of its centre, weight (1 / nm), depth."""


@dataclass(frozen=True)
class FoundLine:
    """A line in the frame: tabulated wavelength (nm), position (px), and wavelength of the dispersion there (nm)."""

    name: str
    nm: float
    pixel: float
    fitted: float
    depth: float

    @property
    def residual(self) -> float:
        """Fitted minus tabulated wavelength, nm."""
        return self.fitted - self.nm


@dataclass(frozen=True)
class Dispersion:
    """Wavelength as a function of the pixel.

    Attributes:
        coefficients: (3,) of t⁰, t¹, t², nm.
        middle, half: t = (pixel - middle) / half.
        lines: the lines that were fitted.
        likeness: correlation of the fine structure with the template.
    """

    coefficients: Floats
    middle: float
    half: float
    lines: tuple[FoundLine, ...]
    likeness: float

    def wavelength(self, pixel: Floats) -> Floats:
        """Wavelengths of pixels, nm."""
        return np.asarray(
            np.polynomial.polynomial.polyval((pixel - self.middle) / self.half, self.coefficients), float
        )

    def slope(self, pixel: Floats) -> Floats:
        """Signed dispersion at pixels, nm a pixel."""
        steps = np.polynomial.polynomial.polyder(self.coefficients)
        return np.asarray(
            np.polynomial.polynomial.polyval((pixel - self.middle) / self.half, steps) / self.half, float
        )

    @property
    def residual(self) -> float:
        """Root mean square of the lines' residuals, nm."""
        return float(np.sqrt(np.mean([line.residual**2 for line in self.lines])))


def disperse(pixel: Floats, signal: Floats, name: str = "the frame") -> Dispersion:
    """Find the Fraunhofer lines of a spectrum and fit its dispersion.

    Args:
        pixel: (w,) positions, increasing.
        signal: (w, c) of sunlight in each channel, with any smooth response.
        name: of the frame, for messages.

    Raises:
        LampUnfit: too few lines; likely no sunlight, out of focus, or too faint.
    """
    total = signal.sum(axis=1)
    lit = np.flatnonzero(total > _DARK * total.max())
    x, y = pixel[lit[0] : lit[-1] + 1], signal[lit[0] : lit[-1] + 1]
    if x.size < 100:
        raise _few(name, 0, "the spectrum is only " + f"{x.size} samples wide")
    middle, half = float(x[0] + x[-1]) / 2, float(x[-1] - x[0]) / 2
    t = (x - middle) / half
    fine = fine_structure(y)
    # Near its ends the fine structure is an artefact of the ends.
    sure = _soften(y.sum(axis=1), len(y) / 300.0) > FAINT * total.max()
    sure[: len(y) // 20] = sure[-(len(y) // 20) :] = False
    laid = _lay(t, fine)
    if laid[0][1] < LEAST_LIKENESS:
        raise _few(name, 0, f"its fine structure is not the sun's (correlation {laid[0][1]:.2f})")
    # A wrong match may correlate as well by chance, but then fewer dips are at the positions of lines.
    tried = [_measure(t, fine, sure, start, alike) for start, alike in laid]
    coefficients, dips, likeness = max(tried, key=lambda each: len(each[1]) + each[2])
    reach = max((nm for _, nm, *_ in dips), default=0.0) - min((nm for _, nm, *_ in dips), default=0.0)
    if len(dips) < FEWEST or reach < SPAN:
        raise _few(name, len(dips), f"only {len(dips)} lines over {reach:.0f} nm could be measured")
    lines = tuple(
        FoundLine(line, nm, middle + half * at, float(np.polynomial.polynomial.polyval(at, coefficients)), depth)
        for line, nm, at, _, depth in dips
    )
    return Dispersion(coefficients, middle, half, lines, likeness)


def _measure(
    t: Floats, fine: Floats, sure: NDArray[np.bool_], start: Floats, likeness: float
) -> tuple[Floats, list[_Dip], float]:
    """Fit the dips near the lines predicted by `start`: coefficients (3,), the dips, and `likeness` unchanged."""
    coefficients, dips = start, list[_Dip]()
    for _ in range(3):
        dips = _dips(t, fine, sure, coefficients)
        coefficients, dips = _fit(dips, coefficients)
    return coefficients, dips, likeness


def fine_structure(signal: Floats) -> Floats:
    """The fine structure of a spectrum: ln of each channel minus its smooth part, averaged with signals as weights.

    The smooth part is a quartic filter over a fourteenth of the spectrum (Savitzky and Golay 1964); it removes the
    filter curves and keeps lines. It is applied to each channel, because their sum bends where the channels cross.

    Args:
        signal: (w, c).

    Returns:
        (w,), clipped to -0.2 to 0.1.
    """
    from scipy.signal import savgol_filter

    top = signal.max(axis=0)
    logs = np.log(np.maximum(signal, 0.1 * _DARK * np.where(top > 0, top, 1.0)))
    narrow = logs - savgol_filter(logs, len(signal) // 28 * 2 + 1, 4, axis=0)
    weight = np.maximum(signal, 0.0)
    total = weight.sum(axis=1)
    seen = total + 0.01 * total.max()
    return np.asarray(np.clip((narrow * weight).sum(axis=1) / np.where(seen > 0, seen, 1.0), -0.2, 0.1))


def _drawing(wavelengths: Floats, sigma: float) -> Floats:
    """The template: the sun's lines as Gaussians, minus the smooth part; `wavelengths` every 0.5 nm."""
    from scipy.signal import savgol_filter

    drawn = np.zeros_like(wavelengths)
    for nm, depth in [(nm, depth) for _, nm, _, depth in LINES] + list(OTHERS):
        drawn -= depth * np.exp(-0.5 * ((wavelengths - nm) / sigma) ** 2)
    return np.asarray(np.clip(drawn - savgol_filter(drawn, 47, 4), -0.2, 0.1))


def _lay(t: Floats, fine: Floats) -> list[tuple[Floats, float]]:
    """Match the fine structure to the template: (coefficients (3,), penalised correlation) pairs, best first."""
    from scipy.optimize import minimize

    coarse = np.linspace(-1.0, 1.0, 300)
    sample = np.interp(coarse, t, _soften(fine, len(t) / 300.0))
    sample = (sample - sample.mean()) / np.linalg.norm(sample - sample.mean())
    scale = np.arange(280.0, 1100.0, 0.5)
    drawn, sharp = _drawing(scale, 2.0), _drawing(scale, 1.2)
    ends = np.stack(np.meshgrid(np.arange(320.0, 470.0, 2.0), np.arange(640.0, 1000.0, 2.0)), axis=-1).reshape(-1, 2)
    ends = np.concatenate([ends, ends[:, ::-1]])
    candidates: list[tuple[float, Floats]] = []
    start = np.stack([ends.mean(axis=1), np.diff(ends, axis=1)[:, 0] / 2, np.zeros(len(ends))], axis=1)
    for block in np.array_split(start, 40):
        nm = block[:, :1] + block[:, 1:2] * coarse
        laid = drawn[np.clip(np.rint((nm - scale[0]) / 0.5).astype(int), 0, scale.size - 1)]
        laid = laid - laid.mean(axis=1, keepdims=True)
        alike = laid @ sample / np.maximum(np.linalg.norm(laid, axis=1), 1e-9)
        candidates += [(float(alike[i]), block[i]) for i in np.argsort(alike)[-3:]]
    apart: list[Floats] = []
    for _, candidate in sorted(candidates, key=lambda pair: -pair[0]):
        if len(apart) < 12 and all(np.abs(candidate - other).max() > 5.0 for other in apart):
            apart.append(candidate)

    def unlike(coefficients: Floats) -> float:
        laid = np.interp(np.polynomial.polynomial.polyval(t, coefficients), scale, sharp)
        bent = coefficients[2] / (BENT * coefficients[1])
        return 0.02 * float(bent) ** 2 - _correlation(laid, fine)

    refined = [
        minimize(
            unlike,
            start,
            method="Nelder-Mead",
            options={"initial_simplex": start + np.vstack([np.zeros(3), np.diag([3.0, 3.0, 0.5])]), "xatol": 0.02},
        )
        for start in apart
    ]
    refined.sort(key=lambda each: float(each.fun))
    return [(np.asarray(minimum.x), -float(minimum.fun)) for minimum in refined[:4]]


def _correlation(a: Floats, b: Floats) -> float:
    a, b = a - a.mean(), b - b.mean()
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / size if size > 0 else 0.0


def _soften(values: Floats, sigma: float) -> Floats:
    from scipy.ndimage import gaussian_filter1d

    return np.asarray(gaussian_filter1d(values, sigma))


def _dips(t: Floats, fine: Floats, sure: NDArray[np.bool_], coefficients: Floats) -> list[_Dip]:
    """Fit a Gaussian dip on a parabola to the fine structure around each line where `sure` is True."""
    from scipy.optimize import curve_fit

    nm = np.polynomial.polynomial.polyval(t, coefficients)
    dips: list[_Dip] = []
    for name, table, spread, _ in LINES:
        near = np.abs(nm - table) <= _WINDOW
        if near.sum() < 9 or not sure[np.argmin(np.abs(nm - table))]:
            continue
        off, level = nm[near] - table, fine[near]
        dip = float(
            off[np.argmin(np.where(np.abs(off) <= 2.0, level - np.polyval(np.polyfit(off, level, 1), off), 9))]
        )
        try:
            best, covariance = curve_fit(
                _dip,
                off,
                level,
                p0=(level.max(), 0.0, 0.0, 0.1, dip, 1.0),
                bounds=([-np.inf] * 3 + [0.0, -2.5, 0.4], [np.inf] * 3 + [3.0, 2.5, 2.0]),
                max_nfev=400,
            )
        except RuntimeError:  # no fit: no line
            continue
        error = float(np.sqrt(max(covariance[4, 4], 0.0)))
        depth, centre, width = (float(value) for value in best[3:])
        without = np.std(level - np.polyval(np.polyfit(off, level, 2), off))
        clear = without > 2.0 * np.std(level - _dip(off, *best))
        if not clear or not error < 0.25 or depth < 0.01 or abs(centre) > 2.4 or width > 1.9:
            continue
        at = float(
            np.interp(table + centre, nm, t) if nm[-1] > nm[0] else np.interp(table + centre, nm[::-1], t[::-1])
        )
        dips.append((name, table, at, 1.0 / float(np.hypot(spread, error)), depth))
    return dips


def _dip(off: Floats, c0: float, c1: float, c2: float, depth: float, centre: float, width: float) -> Any:
    return c0 + off * (c1 + off * c2) - depth * np.exp(-0.5 * ((off - centre) / width) ** 2)


def _fit(dips: list[_Dip], before: Floats) -> tuple[Floats, list[_Dip]]:
    """Fit a parabola to the dips without outliers: coefficients and dips; `before` and none if too few agree."""
    while len(dips) >= FEWEST:
        at = np.array([line[2] for line in dips])
        nm = np.array([line[1] for line in dips])
        weight = np.array([line[3] for line in dips])
        # The last row is a prior on the curvature: zero, with a standard deviation of BENT times the slope.
        rows = np.vstack([weight[:, None] * at[:, None] ** np.arange(3), [0.0, 0.0, 1.0 / (BENT * abs(before[1]))]])
        coefficients = np.linalg.lstsq(rows, np.append(weight * nm, 0.0), rcond=None)[0]
        off = np.abs(np.polynomial.polynomial.polyval(at, coefficients) - nm)
        worst = int(np.argmax(off))
        if off[worst] <= LARGEST_RESIDUAL and np.sqrt(np.mean(off**2)) <= LARGEST_RMS:
            sound = abs(coefficients[2]) <= MOST_BENT * abs(coefficients[1])
            return (np.asarray(coefficients), dips) if sound else (before, [])
        dips = dips[:worst] + dips[worst + 1 :]
    return before, dips


def _few(name: str, count: int, why: str) -> CalibrationError:
    return fail(
        "lamp_unfit.few_lines",
        value=float(count),
        threshold=float(FEWEST),
        file=name,
        detail=why,
        least=FEWEST,
        span=SPAN,
    )
