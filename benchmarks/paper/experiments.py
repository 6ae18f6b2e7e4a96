"""The paper's experiments, each for one camera; `python -m benchmarks paper` runs them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import TypeAlias

import numpy as np

from benchmarks.claims.colour import unseen
from benchmarks.devices import errors, left_out
from benchmarks.paper.rivals import FIGURE_4, OURS, TABLE_1, Given, method
from benchmarks.shared import CURVES, chart, lamp
from camssf.errors import NotConverged
from camssf.fit.scores import rmsre
from camssf.grid import Floats
from camssf.recovery.basis import Basis, read_basis
from camssf.spectra import read_camera
from camssf_lab.learning.training import maker_of, read_curves

SEED = 7
TWELVE, ALL = slice(6, 18), slice(0, 24)
NOISES = (0.0, 0.005, 0.01)
LAMPS = ("equal-energy", "D55", "A", "LED-B3")
IGNORED = ("D55", "D65", "A", "LED-B3", "LED-V1", "FL2")
Scores: TypeAlias = dict[str, list[float]]
"""Of one camera: what was tried → numbers, one a run or one a weight."""


@dataclass(frozen=True)
class Camera:
    """A measured camera and what may be learned without its maker.

    Attributes:
        name, maker: of the camera.
        curve: (681, 3).
        training: (cameras, 69, 3) of the other makers.
        basis: learned from them.
    """

    name: str
    maker: str
    curve: Floats
    training: Floats
    basis: Basis


@cache
def cameras() -> tuple[Camera, ...]:
    """The 52, then colour-science's two; of Sigma there is no other, so its basis is the shipped one."""
    measured, bases = left_out()
    nodes = read_curves(CURVES)
    known = {name: read_camera(name).values for name in ("Nikon 5100 (NPL)", "Sigma SDMerill (NPL)")}
    makers = {name: maker_of(name) for name in nodes}
    found = []
    for name, curve in (measured | known).items():
        maker = maker_of(name)
        training = np.stack([node for other, node in nodes.items() if makers[other] != maker])
        found.append(Camera(name, maker, curve, training, bases.get(maker, read_basis("cameras"))))
    return tuple(found)


def photograph(
    camera: Camera, seen: Floats, light: Floats, noise: float, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Signals of Eq. (5) (n, 3) and their standard error."""
    y = (seen * light) @ camera.curve / (light @ camera.curve)
    error = noise * np.hypot(y, 0.2)
    return y + error * rng.normal(size=y.shape), error


def score(curves: Floats, camera: Camera) -> float:
    """RMSE of curves divided by their peaks; a curve that is nowhere positive is wrong by the whole truth."""
    peak = curves.max(axis=0)
    shape = np.where(peak > 0, curves, 0.0) / np.where(peak > 0, peak, 1.0)
    return float(errors(shape, None, camera.curve)[0].mean())


def given(camera: Camera, patches: slice, name: str, noise: float, rng: np.random.Generator) -> Given:
    """A capture of some patches under a known lamp."""
    table_, light = chart()[patches], lamp(name)
    y, error = photograph(camera, table_, light, noise, rng)
    return Given(y, error, table_, light, camera.training, camera.basis)


def attempt(name: str, shown: Given, camera: Camera, weight: float = 0.0) -> float:
    """The score of one method; NaN where camssf's solver refuses its own answer."""
    try:
        return score(method(name).estimate(shown, weight), camera)
    except NotConverged:
        return float("nan")


# the experiments, each for one camera


def figure_4(camera: Camera, index: int) -> Scores:
    """Fig. 4: QR, pseudo-inverse, l1; 12 patches, D55."""
    found: Scores = {}
    for noise in NOISES:
        shown = given(camera, TWELVE, "D55", noise, np.random.default_rng([SEED, 2, index]))
        for name in (*FIGURE_4, *OURS):
            found[f"{name}|{noise}"] = [attempt(name, shown, camera, w) for w in method(name).weights]
    return found


def rivals(camera: Camera, index: int) -> Scores:
    """Table 1's families: noise × lamp, 24 patches."""
    found: Scores = {}
    for j, light in enumerate(LAMPS):
        for noise in NOISES:
            shown = given(camera, ALL, light, noise, np.random.default_rng([SEED, 3, index, j]))
            for name in (*TABLE_1, *OURS):
                found[f"{name}|{noise}|{light}"] = [attempt(name, shown, camera, w) for w in method(name).weights]
    return found


def lamps(camera: Camera, index: int) -> Scores:
    """The lamp ignored (the paper's Eq. (5) to (10) as they stand) and known; no noise. RMSE and RMSRE."""
    found: Scores = {}
    others = samples()
    for name in IGNORED:
        light = lamp(name)
        y, error = photograph(camera, chart()[TWELVE], light, 0.0, np.random.default_rng(0))
        truth = (others * light) @ camera.curve / (light @ camera.curve)
        for case in ("known", "ignored"):
            believed = light if case == "known" else np.ones_like(light)
            shown = Given(y, error, chart()[TWELVE], believed, camera.training, camera.basis)
            for rival in ("paper", "product"):
                found[f"{rival}|{case}|{name}"] = [float("nan")] * 2
                try:
                    curves = method(rival).estimate(shown, 0.0)
                except NotConverged:
                    continue
                predicted = (others * believed) @ curves / (believed @ curves)
                wrong = rmsre(truth[None], predicted[None], np.ones((1, len(others)), dtype=bool))
                found[f"{rival}|{case}|{name}"] = [score(curves, camera), float(wrong.mean())]
    return found


@cache
def samples() -> Floats:
    """(96, 681) reflectances of real surfaces in place of an SG's 96 colours, whose table is not public.

    CIE 224:2017's test colours (paints, textiles, skin, plants, plastics, printed matter), without the three darkest.
    None is a patch of the chart.
    """
    values = unseen()
    return values[np.sort(np.argsort(values.mean(axis=1))[3:])]


EXPERIMENTS: dict[str, Callable[[Camera, int], Scores]] = {
    "rivals": rivals,
    "figure_4": figure_4,
    "lamps": lamps,
}


def run(experiment: str, index: int) -> Scores:
    """One experiment on one camera: what a process is given to do."""
    return EXPERIMENTS[experiment](cameras()[index], index)
