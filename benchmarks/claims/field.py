"""A phone, a chart, whatever light: what are curves worth without frames in uneven light?

Each capture is solved and judged as `camssf calibrate` does it: one photo. The chart told is BabelColor's; the one in
the photo has a table between that and Ohta's, or beyond it. Noise hypot(0.1 %, 0.0002). The 18 ordinary lamps of
`any_light`; a CIE lamp is taken out of the table of its kind first. Two rows:

- `framed`: even light, white and dark frame;
- `field`: neither, and drawn anew for every capture: a lens that darkens the corners by 10 to 60 % about a middle
  that is off by up to 10 % of the picture, a chart of 30 to 85 % of the width, turned and tilted by up to 30°, a
  gradient of the light of up to 15 % across it, and a coloured wall whose light grows to at most 3 % on one side.

Each with the lamp named (`known`) and not (`auto`). Phones are solved with a basis of the other phones, and with one
of the other makers' phones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.captures import (
    BLACK,
    KIND_OF,
    LOW,
    SATURATION,
    Groups,
    Taken,
    frame,
    in_roles,
    judged,
    model_of,
    power,
    unnamed,
)
from benchmarks.claim import Run
from benchmarks.devices import BY_OTHER_MAKER, BY_OTHERS, Device, populations
from benchmarks.shared import TABLE
from camssf.grid import Floats
from camssf.photo.capture import Capture, MeasuredShot, Photo
from camssf.photo.find.pose import Pose
from camssf.photo.patches import PatchMeans
from camssf.spectra import Light, read_chart, read_lamp
from camssf.spectra.bundled import surfaces
from camssf_lab.simulation.scene import Scene, true_pose

FRAMED, FIELD = "framed", "field"
KNOWN, AUTO = "known", "auto"
SIZE = (4000, 3000)
LOST, GRADIENT, WALL = (0.1, 0.6), 0.15, 0.03
LEVEL = 0.7
"""Of the brightest white signal, in parts of the range."""


@dataclass(frozen=True)
class Place:
    """Where a chart was photographed.

    Attributes:
        pose: of the chart.
        light: (n,) relative light on the patches.
        wall: (n, 681) what a coloured wall adds, relative to the lamp.
        table: (n, 681) the chart's true reflectances.
    """

    pose: Pose
    light: Floats
    wall: Floats
    table: Floats


def place(rng: np.random.Generator, row: str) -> Place:
    """One of a row's."""
    stated, other = read_chart("classic24").values, read_chart("classic24:ohta").values
    t = rng.uniform(0.6, 1.2)
    chart = np.clip(stated + t * (other - stated), 0.0, 1.0)
    if row != FIELD:
        return Place(true_pose(Scene(size=SIZE)), np.ones(24), np.zeros_like(chart), chart)
    scene = Scene(
        size=SIZE, fill=rng.uniform(0.3, 0.85), rotation=rng.uniform(-30, 30), tilt=rng.uniform(-30, 30),
        centre=(rng.uniform(0.42, 0.58), rng.uniform(0.42, 0.58)),
    )  # fmt: skip
    pose = true_pose(scene)
    centres = pose.patches.mean(axis=1) - 0.5 * np.array(SIZE)
    half = 0.5 * np.hypot(*SIZE)
    middle = rng.uniform(-0.1, 0.1, 2) * np.array(SIZE)
    squares = np.sum(((centres - middle) / half) ** 2, axis=1)
    fall = (1.0 / np.sqrt(1.0 - rng.uniform(*LOST)) - 1.0) * squares
    along = centres / np.abs(centres).max()
    angle, turn = rng.uniform(0, 2 * np.pi, 2)
    gradient = 0.5 * rng.uniform(0, GRADIENT) * along @ [np.cos(angle), np.sin(angle)]
    side = 0.5 * (1.0 + along @ [np.cos(turn), np.sin(turn)])
    paints = surfaces()
    wall = paints[rng.integers(len(paints))]
    return Place(
        pose, (1.0 + fall) ** -2 * (1.0 + gradient),
        rng.uniform(0, WALL) * np.clip(side, 0, 1)[:, None] * wall / wall.max(), chart,
    )  # fmt: skip


def photographed(device: Device, lamp: str, stated: Light, at: Place, row: str, maker: str, seed: int) -> Capture:
    """The capture of one row."""
    power = read_lamp(lamp).values
    seen = ((power * at.table * (1.0 + at.wall)) @ device.curves) / (power @ device.curves)
    y = LEVEL * seen * (at.light / at.light.max())[:, None]
    error = np.hypot(LOW[0] * y, LOW[1] * LEVEL)
    noise = error * np.random.default_rng(seed).normal(size=y.shape)
    photo = Photo("0.dng", *SIZE, 1, None, None, False, maker, model_of(device, maker), f"{seed:064d}")
    white, dark = frame(LEVEL * np.ones_like(y), 1e-5 * np.ones_like(y)), frame(np.zeros_like(y), np.zeros_like(y))
    framed = row == FRAMED
    means = PatchMeans(
        frame(y + noise, error), white if framed else None, dark if framed else None, np.full(3, BLACK), SATURATION
    )
    chart, *frames = in_roles(photo) if framed else (photo, None, None)
    return Capture((MeasuredShot(stated, chart, *frames, at.pose, means, None),), read_chart(TABLE), None)


def taken(device: Device, lamp: str, light: Light, row: str, seed: int) -> Taken:
    """One capture of a row, judged."""
    where = place(np.random.default_rng([seed, row == FIELD]), row)
    asked = photographed(device, lamp, light, where, row, device.maker, seed)
    return judged(asked, device, {lamp: power(lamp)})


def claim(run: Run) -> None:
    """The rows of each population."""
    groups = Groups()
    for population in populations(run, BY_OTHERS, BY_OTHER_MAKER):
        for number, device in enumerate(run.track(population.devices, population.title)):
            with device.left_out(population.key):
                for at, lamp in enumerate(KIND_OF):
                    seed = 1000 * number + at
                    for row in (FRAMED, FIELD):
                        groups.add(taken(device, lamp, read_lamp(lamp), row, seed), population.title, row, KNOWN)
                        groups.add(taken(device, lamp, unnamed(lamp), row, seed), population.title, row, AUTO)
    columns = {"population": "", "row": "", "lamp": ""} | dict.fromkeys(("RMSE", "no photo"), ".4f")
    columns |= dict.fromkeys(("worst", "coverage", "worst device"), ".3f")
    columns |= {"accepted, doubtful, refused": "{}, {}, {}", "why": ""}
    rows = [
        (*key, group.rmse, group.mean("no_photo"), group.worst, group.coverage, min(group.by_device("covered")),
         group.counts, group.codes)
        for key, group in groups.items()
    ]  # fmt: skip
    run.table("Any light, evenly or not", columns, rows)
    for title, word in dict.fromkeys((title, word) for title, _, word in groups):
        field, framed = (groups[title, row, word] for row in (FIELD, FRAMED))
        run.bar(f"{title}, {word}: field over framed", field.rmse / framed.rmse, most=1.05)
        run.bar(f"{title}, {word}: coverage in the field", field.coverage, least=0.94, most=0.99)
        run.bar(f"{title}, {word}: accepted in the field", len(field.accepted) / len(field), least=0.90)
