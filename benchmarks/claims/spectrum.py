"""What does a posterior of reflectance tell? `python -m benchmarks.claims.spectrum [--phones [phones.csv]]`

Cameras are recovered as in `colour`: a basis that does not know them, a chart of Ohta's table solved with
BabelColor's, one shot (D55), two (D55, A), or one whose light is not named. Then `camssf_colour.spectrum` with the
prior "general" sees surfaces that its prior does not hold: each set of the library is left out in turn (`GROUPS`), of
the skins those of the other laboratory stay, counted eight times. Lights: D55, D65, A, LED-B3, FL2 and an LED of our
own (`MADE`).

- Colour: ΔE00 without noise, by curves (true, one, two, unnamed); transform: the root-polynomial, curves of
  one shot. The set `rawtoaces` is what that transform is fitted to, so it is left out of this column.
- Between: median ΔE00 of two cameras' colours of the same skin, curves of one shot.
- Region: share of Lab within its 95 % region; lamp off by 2 % in calibration and in use, noise .5 %, the reference
  off by 1 %: lamp named, by kind, and auto.
- Spectra: RMSE and share within the 95 % bands, 400 to 700 nm; D65, and D65 with the LED; true curves, noise .5 %.
- Indices: error of erythema and melanin in standard deviations over people, and share within the 95 % band.
- Change: skins with .5 standard deviations more erythema by oxyhaemoglobin alone (or deoxyhaemoglobin), R exp(-k ε);
  prior of the other laboratory's skins, as it is and widened: which share of the change of the index is answered.

`--phones FILE` takes measured phones of one's own, `--phones` alone those that CAMSSF_PHONES names, each with a basis
learned from the others. `--every N` takes each Nth surface. `--bars` makes a missed bar the exit status 1.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from benchmarks.claims.accuracy import LOW
from benchmarks.claims.colour import CHART, INSIDE, KINDS, SEED, SHOTS, WHITE, Case, calibrate, cases, drawn
from benchmarks.shared import (
    chart,
    command_parser,
    console,
    count_missed,
    lamp,
    one_thread,
    parse_with_phones,
    progress,
    save,
    table,
)
from camssf.colorimetry import delta_e00, signals_of, white_of
from camssf.grid import WAVELENGTHS, Floats
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
    guesses = []
    for kind in FAMILIES:
        known = read_lamp(kind)
        guesses.append(
            LampGuess(
                (kind,),
                Observation(
                    signals, chart(), known.values[None], standard_error=error[None], chart_tolerance=CHART,
                    white_tolerance=WHITE, lamp_tolerance=known.tolerance, lamp_modes=known.modes[None],
                ),
                0.0,
            )
        )  # fmt: skip
    answer = recover(guesses, basis=case.basis, settings=SolverSettings(engine="reference"))
    best = max(answer.choice, key=lambda each: each.probability)
    white = next(guess.observation.lamp[0] for guess in guesses if guess.kinds == best.kinds)
    return camera_of_ssf(answer, case.basis, white)


def cameras(case: Case, rng: np.random.Generator) -> dict[str, Camera]:
    """The camera by what is known of its curves."""
    found = {"true": Camera("true", case.curves, np.zeros((0, *case.curves.shape)))}
    found |= {word: calibrate(case, names, rng, off=False) for word, names in SHOTS.items()}
    return found | {"unnamed": unnamed(case, rng)}


def colours(case: Case, known: dict[str, Camera], every: int) -> Iterator[tuple[str, str, str, Floats, Floats]]:
    """Group, light, way, true Lab and stated Lab."""
    for name in GROUPS:
        _, fine, _ = group(name)
        fine = fine[::every]
        for word in LIGHTS:
            source = light(word)
            y = signals_of(fine, source.values, case.curves)
            truth = of_surfaces(fine, source.values, View())[1]
            for way, camera in known.items():
                found = spectrum(camera, LitSurfaces(source, y, 1e-4, Reference(0.0)), prior=prior_without(name))
                yield name, word, way, truth, found.lab
            if name != "rawtoaces":
                fitted = choose(known["one"].values, source.values)
                yield name, word, "transform", truth, lab(fitted.apply(y), white_of(source.values))


def regions(case: Case, rng: np.random.Generator, every: int) -> Iterator[tuple[str, str, Floats]]:
    """Group, what was told of the lamp, and χ² of true less stated Lab."""
    camera = calibrate(case, SHOTS["two"], rng, off=True)
    smooth = smooth_errors(CHART_CORRELATION, WAVELENGTHS)
    for name in GROUPS:
        _, fine, _ = group(name)
        fine = fine[:: 2 * every]
        for word, kind in KINDS.items():
            power = drawn(lamp(word), rng)
            white = 1.0 + WHITE * (smooth @ rng.normal(size=smooth.shape[1]))
            raw = (power * white) @ case.curves
            y = ((power * fine) @ case.curves) / raw * (1.0 + 0.01 * rng.normal())
            error = NOISE * y
            y = y + error * rng.normal(size=y.shape)
            truth = of_surfaces(fine, power, View())[1]
            for way, lamp_name in (("named", word), ("kind", kind), ("auto", "auto")):
                lit = LitSurfaces(lamp_name, y, error, Reference(WHITE, raw))
                answer = spectrum(camera, lit, prior=prior_without(name))
                off = truth - answer.lab
                solved = np.linalg.solve(answer.lab_covariance, off[..., None])[..., 0]
                yield name, way, np.einsum("mc,mc->m", off, solved)


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


def main(arguments: list[str] | None = None) -> int:
    """The command."""
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("--cameras", type=int, default=6, help="of the 52, evenly over their list")
    parser.add_argument("--every", type=int, default=3, help="take each Nth surface")
    parser.add_argument("--bars", action="store_true", help="exit with 1 where a bar is missed")
    options = parse_with_phones(parser, arguments)
    if options is None:
        return 2
    rng = np.random.default_rng(SEED)
    delta: dict[tuple[str, str], list[Floats]] = {}
    skins: dict[tuple[str, str, str], list[Floats]] = {}
    chi: dict[tuple[str, str], list[Floats]] = {}
    errors: dict[tuple[str, str], list[tuple[float, float]]] = {}
    index: dict[tuple[str, str], list[Floats]] = {}
    answered: dict[tuple[str, str, str], list[float]] = {}
    spread = people()
    found = cases(options.cameras, None if options.phones is None else Path(options.phones))
    with progress() as bar:
        task = bar.add_task("cameras", total=len(found))
        for case in found:
            known = cameras(case, rng)
            for name, word, way, truth, stated in colours(case, known, options.every):
                delta.setdefault((name, way), []).append(delta_e00(truth, stated))
                if group(name)[2]:
                    skins.setdefault((name, word, way), []).append(stated)
            for name, way, squares in regions(case, rng, options.every):
                chi.setdefault((_kind(name), way), []).append(squares)
            for name, lights, rows, answer in spectra(case, known, rng, options.every):
                off = (answer.reflectance - rows)[:, INNER]
                held = np.abs(off) < 1.96 * answer.standard_deviation[:, INNER]
                key = (_kind(name), lights)
                errors.setdefault(key, []).extend(
                    zip(np.sqrt(np.mean(off**2, axis=1)), held.mean(axis=1), strict=True)
                )
                if group(name)[2]:
                    for word, size in spread.items():
                        weights = shipped_index(word)
                        value, std = indices(answer, weights)
                        miss = value - absorbance(rows) @ weights
                        index.setdefault((word, lights), []).append(np.stack([miss / size, miss / std]))
            for label, absorber, lights, share in changes(case, known, options.every):
                answered.setdefault((label, absorber, lights), []).append(share)
            bar.advance(task)
    return show(options.bars, len(found), delta, skins, chi, errors, index, answered)


def _kind(name: str) -> str:
    return "skin" if group(name)[2] else "general"


def show(
    strict: bool,
    count: int,
    delta: dict[tuple[str, str], list[Floats]],
    skins: dict[tuple[str, str, str], list[Floats]],
    chi: dict[tuple[str, str], list[Floats]],
    errors: dict[tuple[str, str], list[tuple[float, float]]],
    index: dict[tuple[str, str], list[Floats]],
    answered: dict[tuple[str, str, str], list[float]],
) -> int:
    """Tables, bars and the result's file; the exit status."""
    ways = (*CURVES, "transform")
    general = [name for name in GROUPS if not group(name)[2]]
    skin = [name for name in GROUPS if group(name)[2]]
    every: dict[tuple[str, str], Floats] = {key: np.concatenate(each) for key, each in delta.items()}
    for kind, names in (("general", general), ("skin", skin)):
        for way in ways:
            every[kind, way] = np.concatenate([every[name, way] for name in names if (name, way) in every])
    rows = [
        (name, *(f"{every[name, way].mean():.2f}" if (name, way) in every else "" for way in ways))
        for name in (*GROUPS, "general", "skin")
    ]
    rows += [
        (f"{kind}, 95th percentile", *(f"{np.percentile(every[kind, way], 95):.2f}" for way in ways))
        for kind in ("general", "skin")
    ]
    console().print(table(f"ΔE00, {count} cameras", ("left out", *ways), rows))
    between = {
        way: float(np.mean([_between(each) for (_, _, own), each in skins.items() if own == way])) for way in ways
    }
    console().print(table("skin between cameras, median ΔE00", ways, [[f"{between[way]:.2f}" for way in ways]]))
    inside = {key: float(np.mean(np.concatenate(each) < INSIDE)) for key, each in chi.items()}
    lines = [
        (kind, *(f"{inside[kind, way]:.3f}" for way in ("named", "kind", "auto"))) for kind in ("general", "skin")
    ]
    console().print(table("within the 95 % region of Lab", ("", "named", "by kind", "auto"), lines))
    bands = {key: tuple(np.mean(error, axis=0).tolist()) for key, error in errors.items()}
    lines = [(kind, *(f"{v:.4f}" for n in PAIRS for v in bands[kind, n])) for kind in ("general", "skin")]
    heads = ("", "one light: RMSE", "in the band", "two lights: RMSE", "in the band")
    console().print(table("spectra", heads, lines))
    read = {
        key: (float(np.sqrt(np.mean(values[0] ** 2))), float(np.mean(np.abs(values[1]) < 1.96)))
        for key, each in index.items()
        for values in [np.concatenate(each, axis=1)]
    }
    lines = [(word, *(f"{v:.3f}" for n in PAIRS for v in read[word, n])) for word in ("erythema", "melanin")]
    heads = ("", "one light: error", "in the band", "two lights: error", "in the band")
    console().print(table("indices, in standard deviations over people", heads, lines))
    share = {key: float(np.mean(each)) for key, each in answered.items()}
    lines = [
        (label, absorber, *(f"{share[label, absorber, n]:.2f}" for n in PAIRS))
        for label in ("population", "widened")
        for absorber in ("oxyhaemoglobin", "deoxyhaemoglobin")
    ]
    console().print(table("share of a change that is answered", ("prior", "change", "one light", "two"), lines))
    far = float("inf")
    bars = [
        (f"general, ΔE00, curves {way}", float(every["general", way].mean()), 0.0, most)
        for way, most in (("true", 1.06), ("one", 1.22), ("two", 1.19), ("unnamed", 1.38))
    ]
    bars += [
        (f"general, 95th percentile, curves {way}", float(np.percentile(every["general", way], 95)), 0.0, most)
        for way, most in (("true", 3.1), ("one", 3.4))
    ]
    bars += [
        (f"skin, ΔE00, curves {way}", float(every["skin", way].mean()), 0.0, most)
        for way, most in (("true", 0.55), ("one", 0.60))
    ]
    bars += [("skin between cameras", between["one"], 0.0, 0.40)]
    bars += [("region, general, named", inside["general", "named"], 0.92, 0.97)]
    bars += [("region, skin, named", inside["skin", "named"], 0.95, 1.0)]
    bars += [(f"region, {k}, {w}", inside[k, w], 0.92, 1.0) for k in ("general", "skin") for w in ("kind", "auto")]
    bars += [
        (f"spectra, {kind}, lights: {n}", bands[kind, n][0], 0.0, most)
        for kind, n, most in (("skin", "one", 0.012), ("general", "one", 0.070), ("general", "two", 0.046))
    ]
    bars += [(f"bands, {k}, lights: {n}", bands[k, n][1], 0.93, 0.98) for k in ("general", "skin") for n in PAIRS]
    bars += [
        (f"erythema, lights: {n}", read["erythema", n][0], 0.0, most) for n, most in (("one", 0.25), ("two", 0.19))
    ]
    bars += [("change of oxyhaemoglobin, two lights", share["widened", "oxyhaemoglobin", "two"], 0.85, far)]
    missed = count_missed(bars)
    content = {
        "cameras": count,
        "delta_e00": {f"{name}, {way}": float(each.mean()) for (name, way), each in every.items()},
        "between": between,
        "inside": {", ".join(key): value for key, value in inside.items()},
        "spectra": {", ".join(key): value for key, value in bands.items()},
        "indices": {", ".join(key): value for key, value in read.items()},
        "answered": {", ".join(key): value for key, value in share.items()},
    }
    print(save("spectrum", content))
    return int(strict and missed > 0)


def _between(labs: list[Floats]) -> float:
    """Median ΔE00 over pairs of cameras and surfaces."""
    pairs = [delta_e00(labs[i], labs[j]) for i in range(len(labs)) for j in range(i)]
    return float(np.median(pairs)) if pairs else float("nan")


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
