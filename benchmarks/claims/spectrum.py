"""What does a posterior of reflectance tell?

Cameras are recovered as in `colour`: a basis that does not know them, a chart of Ohta's table solved with
BabelColor's, one shot (D55), two (D55, A), or one whose light is not named. Then `camssf_colour.spectrum` with the
prior "general" sees surfaces that its prior does not hold: each set of the library is left out in turn (`GROUPS`), of
the skins those of the other laboratory stay, counted eight times. Lights: D55, D65, A, LED-B3, FL2 and an LED of our
own (`MADE`).

- Colour: ΔE00 without noise, by curves (true, one, two, unnamed); transform: the root-polynomial, curves of
  one shot. The set `rawtoaces` is what that transform is fitted to, so it is left out of this column.
- Region: share of Lab within its 95 % region; lamp off by 2 % in calibration and in use, noise .5 %, the reference
  off by 1 %, the lamp named.
- Spectra: RMSE and share within the 95 % bands, 400 to 700 nm; D65, and D65 with the LED; true curves, noise .5 %.
- Indices: error of erythema and melanin in standard deviations over people, and share within the 95 % band.
- Change: skins with .5 standard deviations more erythema by oxyhaemoglobin alone (or deoxyhaemoglobin), R exp(-k ε);
  prior of the other laboratory's skins, as it is and widened: which share of the change of the index is answered.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache
from itertools import product
from typing import Any

import numpy as np

from benchmarks.captures import LOW
from benchmarks.claim import Run
from benchmarks.claims.colour import CHART, INSIDE, LAMPS, SEED, SHOTS, WHITE, Case, calibrate, case_groups, drawn
from benchmarks.shared import chart, lamp
from camssf.colorimetry import delta_e00, signals_of, white_of
from camssf.grid import BAND, WAVELENGTHS, Floats
from camssf.recovery.covariance import CHART_CORRELATION, smooth_errors
from camssf.recovery.hypotheses import LampGuess, recover
from camssf.recovery.observation import Observation
from camssf.recovery.sensitivity import SolverSettings
from camssf.spectra import Lamp, read_chart, read_lamp
from camssf.spectra.bundled import SURFACE_NODES, absorbers, surface_sets
from camssf.spectra.families import FAMILIES
from camssf_colour import (
    Camera,
    LitSurfaces,
    Reference,
    SurfacePrior,
    SurfaceSpectra,
    View,
    camera_of_ssf,
    choose,
    lab,
    prior_of,
    spectrum,
)
from camssf_colour.absorbance import absorbance, indices, shipped_index
from camssf_colour.standard import of_surfaces
from camssf_colour.surface_prior import SKINS_COUNT, skin_changes

OPTIONS = {
    "cameras": (6, "of the 52, evenly over their list"),
    "every": (3, "take each Nth surface"),
}
GROUPS = {
    "rawtoaces": ("rawtoaces",),
    "cie": ("cie2017", "cri", "cqs"),
    "dupont": ("vhrel_dupont",),
    "munsell": ("vhrel_munsell",),
    "objects": ("vhrel_objects",),
    "esser": ("esser",),
    "vhrel skin": ("vhrel_skin",),
    "hyspex skin": ("hyspex_skin",),
}
"""Sets that are left out together."""
MADE = "made LED"
LIGHTS = ("D55", "D65", "A", "LED-B3", "FL2", MADE)
CURVES = ("true", *SHOTS, "unnamed")
NOISE = 0.005
STEP = 0.5
"""Change of the erythema index, standard deviations over people."""
INNER = slice(2, 33)
"""400 to 700 nm."""


def light(name: str) -> Lamp:
    """A lamp by name, exact; or the LED: a blue peak of 452 nm, a phosphor at 575 nm."""
    power = lamp(name) if name != MADE else _bell(452, 9) + 0.62 * _bell(575, 52)
    return replace(read_lamp("D55" if name == MADE else name), name=name, values=power, tolerance=0.0)


def _bell(centre: float, width: float) -> Floats:
    return np.asarray(np.exp(-0.5 * ((WAVELENGTHS - centre) / width) ** 2))


@cache
def group(name: str) -> tuple[Floats, Floats, bool]:
    """The reflectances of a group: (n, 35), on the grid (n, 681), and whether it is skin."""
    rows = np.concatenate([each.values for each in surface_sets() if each.name in GROUPS[name]])
    fine = np.stack([np.interp(WAVELENGTHS, SURFACE_NODES, row) for row in rows])
    return rows, fine, "skin" in name


@cache
def prior_without(name: str) -> SurfacePrior:
    """The prior "general" without a group."""
    sets = [each for each in surface_sets() if each.name not in GROUPS[name]]
    counts = np.concatenate([np.full(len(each.values), SKINS_COUNT if each.kind == "skin" else 1.0) for each in sets])
    return prior_of(np.concatenate([each.values for each in sets]), f"without {name}", counts=counts)


def unnamed(case: Case, rng: np.random.Generator) -> Camera:
    """The camera recovered from one shot in D55 whose light is not named."""
    power = lamp("D55")
    seen = read_chart("classic24:ohta").values
    y = ((power * seen) @ case.curves) / (power @ case.curves)
    error = np.hypot(LOW[0] * y, LOW[1])
    signals = (y + error * rng.normal(size=y.shape))[None]

    def observed(known: Lamp) -> Observation:
        return Observation(
            signals, chart(), known.values[None], standard_error=error[None], chart_tolerance=CHART,
            white_tolerance=WHITE, lamp_tolerance=known.tolerance, lamp_modes=known.modes[None],
        )  # fmt: skip

    guesses = [LampGuess((kind,), observed(read_lamp(kind)), 0.0) for kind in FAMILIES]
    answer = recover(guesses, basis=case.basis, settings=SolverSettings(engine="reference"))
    best = max(answer.choice, key=lambda each: each.probability)
    white = next(guess.observation.lamp[0] for guess in guesses if guess.kinds == best.kinds)
    return camera_of_ssf(answer, case.basis, white)


def cameras(case: Case, rng: np.random.Generator) -> dict[str, Camera]:
    """The camera by what is known of its curves."""
    found = {"true": Camera("true", case.curves, np.zeros((0, *case.curves.shape)))}
    found |= {word: calibrate(case, names, rng, off=False) for word, names in SHOTS.items()}
    return found | {"unnamed": unnamed(case, rng)}


def colours(case: Case, known: dict[str, Camera], every: int) -> Iterator[tuple[str, str, Floats, Floats]]:
    """Group, way, true Lab and stated Lab, under each light."""
    for name in GROUPS:
        _, fine, _ = group(name)
        fine = fine[::every]
        for word in LIGHTS:
            source = light(word)
            y = signals_of(fine, source.values, case.curves)
            truth = of_surfaces(fine, source.values, View())[1]
            for way, camera in known.items():
                found = spectrum(camera, LitSurfaces(source, y, 1e-4, Reference(0.0)), prior=prior_without(name))
                yield name, way, truth, found.lab
            if name != "rawtoaces":
                fitted = choose(known["one"].values, source.values)
                yield name, "transform", truth, lab(fitted.apply(y), white_of(source.values))


def regions(case: Case, rng: np.random.Generator, every: int) -> Iterator[tuple[str, Floats]]:
    """Group, and χ² of true less stated Lab, the lamp named."""
    camera = calibrate(case, SHOTS["two"], rng, off=True)
    smooth = smooth_errors(CHART_CORRELATION, WAVELENGTHS)
    for name in GROUPS:
        _, fine, _ = group(name)
        fine = fine[:: 2 * every]
        for word in LAMPS:
            power = drawn(lamp(word), rng)
            white = 1.0 + WHITE * (smooth @ rng.normal(size=smooth.shape[1]))
            raw = (power * white) @ case.curves
            y = ((power * fine) @ case.curves) / raw * (1.0 + 0.01 * rng.normal())
            error = NOISE * y
            y = y + error * rng.normal(size=y.shape)
            truth = of_surfaces(fine, power, View())[1]
            lit = LitSurfaces(word, y, error, Reference(WHITE, raw))
            answer = spectrum(camera, lit, prior=prior_without(name))
            off = truth - answer.lab
            solved = np.linalg.solve(answer.lab_covariance, off[..., None])[..., 0]
            yield name, np.einsum("mc,mc->m", off, solved)


def photographed(case: Case, fine: Floats, words: Sequence[str], rng: np.random.Generator) -> list[LitSurfaces]:
    """The surfaces under each light, noise .5 %."""
    found = []
    for word in words:
        source = light(word)
        y = signals_of(fine, source.values, case.curves)
        found.append(LitSurfaces(source, y + NOISE * y * rng.normal(size=y.shape), NOISE * y, Reference(0.0)))
    return found


PAIRS = {"one": ("D65",), "two": ("D65", MADE)}
"""Lights of a spectrum."""


def spectra(
    case: Case, known: dict[str, Camera], rng: np.random.Generator, every: int
) -> Iterator[tuple[str, str, Floats, SurfaceSpectra]]:
    """Group, number of lights, true reflectances (m, 35) and spectra."""
    for name in GROUPS:
        rows, fine, _ = group(name)
        for word, words in PAIRS.items():
            lit = photographed(case, fine[::every], words, rng)
            yield name, word, rows[::every], spectrum(known["true"], *lit, prior=prior_without(name))


def people() -> dict[str, float]:
    """Standard deviation of each index over the skins of the library."""
    rows = np.concatenate([group(name)[0] for name in GROUPS if group(name)[2]])
    return {name: float(np.std(absorbance(rows) @ shipped_index(name))) for name in ("erythema", "melanin")}


def changes(case: Case, known: dict[str, Camera], every: int) -> Iterator[tuple[str, str, str, float]]:
    """Prior, absorber, number of lights and the share of a change of the erythema index that is answered."""
    index, size = shipped_index("erythema"), STEP * people()["erythema"]
    skins = {name: group(name)[0] for name in GROUPS if group(name)[2]}
    for name, rows in skins.items():
        others = np.concatenate([skin for key, skin in skins.items() if key != name])
        priors = {"population": prior_of(others), "widened": prior_of(others, changes=skin_changes())}
        for absorber in ("oxyhaemoglobin", "deoxyhaemoglobin"):
            curve = absorbers()[absorber]
            strength = size / float(curve @ index / np.log(10.0))
            before = rows[::every]
            after = before * np.exp(-strength * curve)
            for word, words in PAIRS.items():
                for label, prior in priors.items():
                    read = []
                    for state in (before, after):
                        fine = np.stack([np.interp(WAVELENGTHS, SURFACE_NODES, row) for row in state])
                        lit = [
                            LitSurfaces(light(each), y := signals_of(fine, light(each).values, case.curves),
                                        NOISE * y, Reference(0.0))
                            for each in words
                        ]  # fmt: skip
                        read.append(indices(spectrum(known["true"], *lit, prior=prior), index)[0])
                    yield label, absorber, word, float(np.mean(read[1] - read[0]) / size)


def kind_of(name: str) -> str:
    """Skin, or general surfaces."""
    return "skin" if group(name)[2] else "general"


class Measured:
    """Numbers of all cameras, by the words of their row."""

    def __init__(self, every: int) -> None:
        self.delta: dict[tuple[str, str], list[Floats]] = {}
        self.chi: dict[str, list[Floats]] = {}
        self.errors: dict[tuple[str, str], list[Any]] = {}
        self.index: dict[tuple[str, str], list[Floats]] = {}
        self.answered: dict[tuple[str, str, str], list[float]] = {}
        self.every, self.spread = every, people()

    def add(self, case: Case, rng: np.random.Generator) -> None:
        """All of one camera."""
        known = cameras(case, rng)
        for name, way, truth, stated in colours(case, known, self.every):
            self.delta.setdefault((name, way), []).append(delta_e00(truth, stated))
        for name, squares in regions(case, rng, self.every):
            self.chi.setdefault(kind_of(name), []).append(squares)
        for name, lights, rows, answer in spectra(case, known, rng, self.every):
            off = (answer.reflectance - rows)[:, INNER]
            held = np.abs(off) < BAND * answer.standard_deviation[:, INNER]
            pairs = zip(np.sqrt(np.mean(off**2, axis=1)), held.mean(axis=1), strict=True)
            self.errors.setdefault((kind_of(name), lights), []).extend(pairs)
            for word, size in self.spread.items() if group(name)[2] else ():
                weights = shipped_index(word)
                value, std = indices(answer, weights)
                miss = value - absorbance(rows) @ weights
                self.index.setdefault((word, lights), []).append(np.stack([miss / size, miss / std]))
        for label, absorber, lights, share in changes(case, known, self.every):
            self.answered.setdefault((label, absorber, lights), []).append(share)


def claim(run: Run) -> None:
    """All tables and bars, for cameras and phones."""
    for title, found in case_groups(run, run.options.cameras):
        rng, measured = np.random.default_rng(SEED), Measured(run.options.every)
        for case in run.track(found, title):
            measured.add(case, rng)
        show(run, f"{title} ({len(found)})", measured)


def show(run: Run, title: str, measured: Measured) -> None:
    """Tables and bars."""
    ways = (*CURVES, "transform")
    every = {key: np.concatenate(own) for key, own in measured.delta.items()}
    for kind, way in product(("general", "skin"), ways):
        own = [every[name, way] for name in GROUPS if kind_of(name) == kind and (name, way) in every]
        every[kind, way] = np.concatenate(own)
    rows: list[Any] = [(kind, *(every[kind, way].mean() for way in ways)) for kind in ("general", "skin")]
    tails = {kind: {way: float(np.percentile(every[kind, way], 95)) for way in ways} for kind in ("general", "skin")}
    rows += [(f"{kind}, 95th percentile", *tail.values()) for kind, tail in tails.items()]
    run.table(f"{title}: ΔE00", {"left out": ""} | dict.fromkeys(ways, ".2f"), rows)
    inside = {kind: float(np.mean(np.concatenate(own) < INSIDE)) for kind, own in measured.chi.items()}
    rows = [(kind, inside[kind]) for kind in ("general", "skin")]
    run.table(f"{title}: within the 95 % region of Lab", {"": "", "lamp named": ".3f"}, rows)
    bands = {key: np.mean(error, axis=0).tolist() for key, error in measured.errors.items()}
    columns = dict.fromkeys(("one light: RMSE", "in the band", "two lights: RMSE", "in their band"), ".4f")
    rows = [(kind, *(value for n in PAIRS for value in bands[kind, n])) for kind in ("general", "skin")]
    run.table(f"{title}: spectra", {"": ""} | columns, rows)
    read = {}
    for key, own in measured.index.items():
        values = np.concatenate(own, axis=1)
        read[key] = float(np.sqrt(np.mean(values[0] ** 2))), float(np.mean(np.abs(values[1]) < BAND))
    columns = dict.fromkeys(("one light: error", "in the band", "two lights: error", "in their band"), ".3f")
    rows = [(word, *(value for n in PAIRS for value in read[word, n])) for word in ("erythema", "melanin")]
    run.table(f"{title}: indices, in standard deviations over people", {"": ""} | columns, rows)
    share = {key: float(np.mean(own)) for key, own in measured.answered.items()}
    pairs = product(("population", "widened"), ("oxyhaemoglobin", "deoxyhaemoglobin"))
    rows = [(*pair, *(share[(*pair, n)] for n in PAIRS)) for pair in pairs]
    columns = {"prior": "", "change": "", "one light": ".2f", "two": ".2f"}
    run.table(f"{title}: share of a change that is answered", columns, rows)

    def bar(name: str, value: float, **limits: float) -> None:
        run.bar(f"{title}: {name}", value, **limits)

    for kind, way, most in (
        ("general", "true", 1.06), ("general", "one", 1.22), ("general", "two", 1.19), ("general", "unnamed", 1.38),
        ("skin", "true", 0.55), ("skin", "one", 0.60),
    ):  # fmt: skip
        bar(f"{kind}, ΔE00, curves {way}", every[kind, way].mean(), most=most)
    for way, most in (("true", 3.1), ("one", 3.4)):
        bar(f"general, 95th percentile, curves {way}", tails["general"][way], most=most)
    bar("region, general", inside["general"], least=0.92, most=0.97)
    bar("region, skin", inside["skin"], least=0.95)
    for kind, n, most in (("skin", "one", 0.012), ("general", "one", 0.070), ("general", "two", 0.046)):
        bar(f"spectra, {kind}, lights: {n}", bands[kind, n][0], most=most)
    for kind, n in product(("general", "skin"), PAIRS):
        bar(f"bands, {kind}, lights: {n}", bands[kind, n][1], least=0.93, most=0.98)
    for n, most in (("one", 0.25), ("two", 0.19)):
        bar(f"erythema, lights: {n}", read["erythema", n][0], most=most)
    bar("change of oxyhaemoglobin, two lights", share["widened", "oxyhaemoglobin", "two"], least=0.85)
