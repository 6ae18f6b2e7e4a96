"""Are the answers optimal?

Seeded calls of the product as it ships: measured cameras on the learned bases with its penalties (λ₂ 1, γ 0.05), 12
and 24 patches of another measured table or of the stated tolerance, one to three shots, lamps by name and by kind,
noise up to 2 %. Each is solved by the NumPy reference and by the shipped ONNX model. How many end with the layers'
answer (`finish_steps` 0) and a gap <= 1e-10 (bar: 99 %), and how far the curves are from the exact ones, in parts of
their peak (bar: 1e-7 in all). Exact is the finish from the layers' answer, whatever their own proof says.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.claim import Run
from benchmarks.claims.lamps import draw as draw_kind
from benchmarks.shared import cameras, lamp
from camssf.fit.capture_fit import lamp_modes
from camssf.grid import Floats
from camssf.recovery.basis import LEARNED, Basis, interpolate, read_basis
from camssf.recovery.covariance import CHART_CORRELATION, smooth_errors
from camssf.recovery.layers import DEPTH, splitting
from camssf.recovery.observation import Observation
from camssf.recovery.penalties import GAMMA, L2
from camssf.recovery.pivoting import pivot_to_optimum
from camssf.recovery.rows import anchor
from camssf.recovery.sensitivity import LARGEST_GAP, SolverSettings, solve_on_basis
from camssf.spectra import Lamp, read_chart, read_lamp
from camssf.spectra.families import FAMILIES
from golden.linear_model import linear_model

OPTIONS = {"count": (10_000, "calls")}
ALONE_GAP, ALONE_BAR, ALONE_SHARE = 1e-10, 1e-7, 0.99
"""Gap and curve of the layers on the product's defaults; share of calls that need no finish."""
LAMPS = ("A", "D50", "D55", "D65", "equal-energy", "FL2", "FL11", "HP1", "LED-B3", "LED-V1", "2400K", "3000K")
ENGINES = ("reference", "onnx")
SEED = 0


def light_of(name: str, rng: np.random.Generator) -> tuple[Lamp, Floats]:
    """The lamp that a call names, and the real one's power; of a kind a real lamp is drawn, and one shape named."""
    if name not in FAMILIES:
        return replace(read_lamp(name), tolerance=0.02, modes=np.zeros((0, lamp(name).size))), lamp(name)
    power, light = draw_kind(name, rng)
    return light.lamps[int(rng.integers(len(light.lamps)))], power


def draw(seed: int, index: int) -> tuple[Observation, str]:
    """The call of that number, the same on every machine: what a user tells it, and the basis."""
    rng = np.random.default_rng([seed, index, 1])
    known = cameras()
    name, n = str(rng.choice(list(known))), int(rng.choice((12, 24)))
    names = [str(x) for x in rng.choice((*LAMPS, *FAMILIES), int(rng.integers(1, 4)), replace=False)]
    patches = slice(6, 18) if n == 12 else slice(0, 24)
    table = read_chart("classic24").values[patches]
    if rng.random() < 0.5:
        seen = read_chart("classic24:ohta").values[patches]
    else:
        errors = interpolate(smooth_errors(CHART_CORRELATION))
        seen = table * (1.0 + 0.02 * (errors @ rng.normal(size=(errors.shape[1], n))).T)
    named, powers = zip(*(light_of(name, rng) for name in names), strict=True)
    noise, basis = float(rng.uniform(0.0005, 0.02)), str(rng.choice(LEARNED))
    light = np.stack(powers)
    y = ((light[:, None, :] * seen) @ known[name]) / (light @ known[name])[:, None, :]
    error = noise * np.hypot(y, 0.05)
    observation = Observation(
        y + error * rng.normal(size=y.shape), table, np.stack([one.values for one in named]), standard_error=error,
        chart_tolerance=0.03, white_tolerance=0.01, lamp_tolerance=np.array([one.tolerance for one in named]),
        lamp_modes=lamp_modes(named),
    )  # fmt: skip
    return observation, basis


def exact(observation: Observation, basis: Basis) -> Floats:
    """(681, 3) the curves by the walk from the layers' answer, whether their own proof asks for it or not."""
    book = anchor(basis, observation.white_reflectance * observation.lamp[0])
    convex = linear_model(observation, book).whitened(L2, GAMMA)
    z = splitting(convex).unroll(DEPTH)
    code = pivot_to_optimum(convex, z, np.full((len(z), 1, 1), np.inf))[0].reshape(3, -1)
    return np.asarray(book.mean + np.einsum("cmr,cr->cm", book.dictionary, code)).T


def distance(curves: Floats, truth: Floats) -> float:
    """Largest difference of curves (681, 3), each divided by its own value where `truth` peaks."""
    at = np.abs(truth).argmax(axis=0)[None]
    return float(np.abs(curves / np.take_along_axis(curves, at, 0) - truth / np.take_along_axis(truth, at, 0)).max())


def judge(observation: Observation, basis: str) -> dict[str, tuple[float, float, float]]:
    """By engine: steps of the finish, own gap, and the curves' distance from the exact ones."""
    truth, found = exact(observation, read_basis(basis)), {}
    for engine in ENGINES:
        ssf = solve_on_basis(observation, basis, settings=SolverSettings(engine=engine))
        found[engine] = float(ssf.proof.finish_steps.max()), float(ssf.proof.gap.max()), distance(ssf.values, truth)
    return found


def claim(run: Run) -> None:
    """A row and bars an engine."""
    calls = [judge(*draw(SEED, index)) for index in run.track(range(run.options.count), "calls")]
    rows = []
    for engine in ENGINES:
        steps, gap, off = np.array([call[engine] for call in calls]).T
        alone = np.mean((steps == 0) & (gap <= ALONE_GAP))
        rows.append((engine, len(calls), alone, int(steps.max()), gap.max(), off.max(), int(off.argmax())))
        run.bar(f"{engine}: the layers' answer in the product's calls", alone, least=ALONE_SHARE)
        run.bar(f"{engine}: worst gap", gap.max(), most=LARGEST_GAP)
        run.bar(f"{engine}: worst curve of the product's calls", off.max(), most=ALONE_BAR)
    columns = {"engine": "", "calls": "d", "layers, gap <= 1e-10": ".2%", "most steps": "d"}
    columns |= {"worst gap": ".1e", "worst curve": ".1e", "of number": "d"}
    run.table("The product's defaults", columns, rows)
