"""What are the curves worth?

Each measured camera is recovered with a basis learned without its maker, each measured phone with one of the other
phones (engine `reference`): a chart of Ohta's table is simulated and solved with BabelColor's, 24 patches, 3 %, low
noise, from one shot (D55) and from two (D55, A). The curves then see surfaces under five lamps, and colour goes
through a root-polynomial that they give: 99 that no fit has used (CIE 224:2017, from colour-science; `samples`), and
the 190 of the product's own set, each left out of its own fit (`surfaces`). Mean ΔE00 of

- true: the same transform from the true curves,
- one, two: from the recovered ones,
- chart: a 3 × 3 matrix fitted by least squares on the same chart photographed in that very light, table and noise as
  above,
- elsewhere: such a matrix of D55 used under every lamp (signals white-balanced).

Between cameras: the median ΔE00 of two cameras' colours of the same surface, over pairs. The colours of `camssf
colour` and their regions are judged by `spectrum`.

Converted: each camera's signals of the samples as the next one's (`camssf_colour.convert`), both recovered from two
shots of one chart, lamps drawn off by their 2 %, noise .5 %, the reference off by 1 %: root mean square error before
and after, white is 1, and the share within the 95 % region, lamp named.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from benchmarks.captures import LOW
from benchmarks.claim import Run
from benchmarks.devices import BY_OTHERS, LEFT_OUT, left_out, taught
from benchmarks.shared import chart, lamp
from camssf.colorimetry import FOLDS, delta_e00, fit, signals_of, terms, white_of, xyz_of
from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery.basis import Basis, interpolate
from camssf.recovery.covariance import CHART_CORRELATION, LAMP_CORRELATION, smooth_errors
from camssf.recovery.hypotheses import recover
from camssf.recovery.observation import Observation
from camssf.recovery.sensitivity import SolverSettings
from camssf.spectra import colour_science, read_chart, read_lamp
from camssf.spectra.bundled import observer, surfaces
from camssf_colour import Camera, Reference, View, camera_of_ssf, choose, convert, lab
from camssf_colour.camera import OwnWhite
from camssf_colour.standard import of_surfaces
from camssf_lab.learning.training import maker_of, read_curves

OPTIONS = {"cameras": (13, "of the 52, evenly over their list")}
LAMPS = ("D55", "D65", "A", "LED-B3", "FL2")
SHOTS = {"one": ("D55",), "two": ("D55", "A")}
CHART, WHITE = 0.03, 0.01
SEED = 17
WAYS = ("true", "one", "two", "chart", "elsewhere")
INSIDE = 7.815
"""χ² of three numbers at 95 %."""


@cache
def unseen() -> Floats:
    """(99, 681) colour samples of CIE 224:2017 that no fit here has used."""
    from colour.quality.cfi2017 import load_TCS_CIE2017

    science = colour_science()
    samples = load_TCS_CIE2017(science.SpectralShape(380, 780, 5))
    at = np.arange(380.0, 781.0, 5.0)
    return np.stack([np.interp(WAVELENGTHS, at, each) for each in np.asarray(samples.values).T])


@dataclass(frozen=True)
class Case:
    """A measured camera and the basis that does not know it."""

    name: str
    curves: Floats
    basis: Basis


def cases(count: int, phones: Path | None) -> list[Case]:
    """So many of the shipped cameras, evenly over their list, or all of a file."""
    if phones is None:
        cameras, bases = left_out()
        names = list(cameras)[:: max(1, len(cameras) // count)][:count]
        return [Case(name, cameras[name], bases[maker_of(name)]) for name in names]
    found = read_curves(phones)
    return [
        Case(name, interpolate(values), taught(found, [key for key in found if key != name], label="phones"))
        for name, values in found.items()
    ]


def case_groups(run: Run, count: int) -> Iterator[tuple[str, list[Case]]]:
    """So many cameras, and all phones if their table is in reach; of these what the run asks for."""
    if run.wants(LEFT_OUT):
        yield LEFT_OUT, cases(count, None)
    if run.options.phones is not None and run.wants(BY_OTHERS):
        yield BY_OTHERS, cases(0, run.named("phones"))


def between(labs: list[Floats]) -> float:
    """Median ΔE00 over pairs of cameras and surfaces."""
    pairs = [delta_e00(labs[i], labs[j]) for i in range(len(labs)) for j in range(i)]
    return float(np.median(pairs)) if pairs else float("nan")


def calibrate(case: Case, names: tuple[str, ...], rng: np.random.Generator, *, off: bool) -> Camera:
    """The recovered camera, with its covariance and its own white."""
    lamps = np.stack([lamp(name) for name in names])
    true = np.stack([drawn(each, rng) for each in lamps]) if off else lamps
    seen = read_chart("classic24:ohta").values
    y = ((true[:, None, :] * seen) @ case.curves) / (true @ case.curves)[:, None, :]
    error = np.hypot(LOW[0] * y, LOW[1])
    observation = Observation(
        y + error * rng.normal(size=y.shape), chart(), lamps, standard_error=error, chart_tolerance=CHART,
        white_tolerance=WHITE, lamp_tolerance=0.02 if off else 0.0,
    )  # fmt: skip
    answer = recover(observation, basis=case.basis, settings=SolverSettings(engine="reference"))
    raw = true[0] @ case.curves
    own = OwnWhite(raw / raw[1], read_lamp(names[0]))
    return camera_of_ssf(answer, case.basis, lamps[0], own)


def drawn(power: Floats, rng: np.random.Generator) -> Floats:
    """A lamp off by its smooth 2 %."""
    smooth = smooth_errors(LAMP_CORRELATION, WAVELENGTHS)
    return np.asarray(power * np.maximum(1.0 + 0.02 * (smooth @ rng.normal(size=smooth.shape[1])), 0.02))


def through_chart(case: Case, power: Floats, rng: np.random.Generator) -> Floats:
    """(3, 3) XYZ from white-balanced signals by a chart photographed in that light."""
    y = signals_of(read_chart("classic24:ohta").values, power, case.curves)
    y = y + np.hypot(LOW[0] * y, LOW[1]) * rng.normal(size=y.shape)
    return np.asarray(np.linalg.lstsq(y, xyz_of(chart(), power, observer("1931")), rcond=None)[0])


def colours(case: Case, rng: np.random.Generator) -> dict[str, dict[str, dict[str, Floats]]]:
    """Lab by set of surfaces, lamp and way; "truth" is the observer's."""
    cameras = {word: calibrate(case, names, rng, off=False).values for word, names in SHOTS.items()}
    elsewhere = through_chart(case, lamp("D55"), rng)
    found: dict[str, dict[str, dict[str, Floats]]] = {"samples": {}, "surfaces": {}}
    for name in LAMPS:
        power = lamp(name)
        white = white_of(power)
        here = through_chart(case, power, rng)
        for word, table_ in (("samples", unseen()), ("surfaces", surfaces())):
            y = signals_of(table_, power, case.curves)
            ways = {
                way: through(curves, power, y, word == "surfaces")
                for way, curves in {"true": case.curves, **cameras}.items()
            }
            ways |= {"chart": y @ here, "elsewhere": (y @ elsewhere) * white / white_of(lamp("D55"))}
            found[word][name] = {way: lab(xyz, white) for way, xyz in ways.items()}
            found[word][name]["truth"] = of_surfaces(table_, power, View())[1]
    return found


def through(curves: Floats, power: Floats, y: Floats, left_out_: bool) -> Floats:
    """XYZ of true signals (n, 3) by the transform that curves give; of the product's set each by a fit without it."""
    kind = "root-polynomial"
    if not left_out_:
        return choose(curves, power, kind=kind).apply(y)
    seen, target = signals_of(surfaces(), power, curves), xyz_of(surfaces(), power, observer("1931"))
    fold = np.arange(len(y)) % FOLDS
    found = np.empty_like(y)
    for each in range(FOLDS):
        left = fold == each
        found[left] = terms(y[left], kind) @ fit(seen[~left], target[~left], white_of(power), kind)
    return found


def photographed(case: Case, name: str, rng: np.random.Generator) -> tuple[Floats, Floats, Floats, Floats]:
    """The true light, the raw white of a reference that is off, and the unseen samples' signals with their error."""
    smooth = smooth_errors(CHART_CORRELATION, WAVELENGTHS)
    power = drawn(lamp(name), rng)
    white = 1.0 + WHITE * (smooth @ rng.normal(size=smooth.shape[1]))
    raw = (power * white) @ case.curves
    y = ((power * unseen()) @ case.curves) / raw * (1.0 + 0.01 * rng.normal())
    error = 0.005 * y
    return power, raw, y + error * rng.normal(size=y.shape), error


def converted(one: Case, other: Case, rng: np.random.Generator) -> tuple[float, float, list[float]]:
    """Mean square error of the signals as they are and converted, and χ² of true less converted, lamp named."""
    cameras = [calibrate(case, SHOTS["two"], rng, off=True) for case in (one, other)]
    before, after, found = [], [], list[float]()
    for name in LAMPS:
        power, raw, y, error = photographed(one, name, rng)
        truth = signals_of(unseen(), power, other.curves)
        answer = convert(*cameras, name, y, error, reference=Reference(WHITE, raw))
        off = truth - answer.signals
        found += np.einsum("mc,mc->m", off, np.linalg.solve(answer.covariance, off[..., None])[..., 0]).tolist()
        before.append(float(np.mean((truth - y) ** 2)))
        after.append(float(np.mean(off**2)))
    return float(np.mean(before)), float(np.mean(after)), found


def means(seen: list[dict[str, dict[str, Floats]]]) -> dict[str, dict[str, float]]:
    """ΔE00 by lamp and way, their mean, and the median between cameras."""
    found = {
        name: {way: float(np.mean([delta_e00(c[name]["truth"], c[name][way]) for c in seen])) for way in WAYS}
        for name in LAMPS
    }
    found["mean"] = {way: float(np.mean([found[name][way] for name in LAMPS])) for way in WAYS}
    found["between cameras"] = {
        way: float(np.mean([between([c[name][way] for c in seen]) for name in LAMPS])) for way in WAYS
    }
    return found


BARS = (
    ("two shots over true curves", "mean", "two", "true", 1.15),
    ("one shot over true curves", "mean", "one", "true", 1.25),
    ("two shots over chart in that light", "mean", "two", "chart", 0.6),
    ("between cameras, two shots over chart", "between cameras", "two", "chart", 0.75),
)
"""What, row, way, other way, the most that their ratio may be."""


def claim(run: Run) -> None:
    """ΔE00 of both sets of surfaces, and conversions, for cameras and phones."""
    for title, group in case_groups(run, run.options.cameras):
        rng = np.random.default_rng(SEED)
        seen = [colours(case, rng) for case in run.track(group, title)]
        neighbours = zip(group, [*group[1:], group[0]], strict=True)
        pairs = [converted(*pair, rng) for pair in run.track(neighbours, "conversions")]
        for word in seen[0]:
            mean = means([each[word] for each in seen])
            columns = {"lamp": ""} | dict.fromkeys(WAYS, ".2f")
            rows = [(name, *row.values()) for name, row in mean.items()]
            run.table(f"{title} ({len(group)}): mean ΔE00 of {word}", columns, rows)
            for what, row, one, other, most in BARS:
                run.bar(f"{title}, {word}: {what}", mean[row][one] / mean[row][other], most=most)
        squares = np.sqrt(np.mean([pair[:2] for pair in pairs], axis=0))
        inside = np.mean(np.concatenate([pair[2] for pair in pairs]) < INSIDE)
        columns = dict.fromkeys(("error before", "after"), ".4f") | {"inside 95 %": ".3f"}
        run.table(f"{title}: signals as the next one's", columns, [(*squares, inside)])
