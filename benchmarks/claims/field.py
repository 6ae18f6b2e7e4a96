"""A phone, a chart, whatever light: `python -m benchmarks.claims.field --phones phones.csv [--draws 1]`

Each capture is solved and judged as `camssf calibrate` does it: one photo. The chart told is BabelColor's; the one in
the photo has a table between that and Ohta's, or beyond it. Noise hypot(0.1 %, 0.0002). The 18 lamps of
benchmarks.claims.any_light; a CIE lamp is taken out of the table of its kind first. Three rows:

- `framed`: even light, white and dark frame;
- `even`: even light, neither;
- `field`: neither, and drawn anew for every capture: a lens that darkens the corners by 10 to 60 % about a middle
  that is off by up to 10 % of the picture, a chart of 30 to 85 % of the width, turned and tilted by up to 30°, a
  gradient of the light of up to 15 % across it, and a coloured wall whose light grows to at most 3 % on one side.

Each with the lamp named (`known`) and not (`auto`); the last also without gain modes, as it was before there were
any.

Phones are solved with a basis of the other phones, and with one of the other makers' phones; cameras with their maker
left out. `--phones` (or CAMSSF_PHONES) names the table that may not be passed on; without it cameras alone are
judged.

The second table: wrong names that harm (more than 0.03 RMSE worse than the right one), and how many of them are
not accepted, with frames in even light and in the field. Exit status 1 where a bar is missed.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any
from unittest import mock

import numpy as np

from benchmarks.claims.accuracy import LOW
from benchmarks.claims.any_light import BLACK, KIND_OF, OTHER, Taken, frame, judged, unnamed
from benchmarks.claims.faults import HARM
from benchmarks.claims.phones import Device
from benchmarks.claims.wrong_lamps import LEFT_OUT, WRONG, populations, stands_in
from benchmarks.problems import in_roles
from benchmarks.shared import (
    TABLE,
    command_parser,
    console,
    count_missed,
    one_thread,
    progress,
    save,
    standing_in,
    table,
    take_tables,
    versions,
)
from camssf.grid import Floats
from camssf.photo.capture import Capture, MeasuredShot, Photo
from camssf.photo.find.pose import Pose
from camssf.photo.patches import PatchMeans
from camssf.spectra import Light, read_chart, read_lamp
from camssf.spectra.bundled import surfaces
from camssf_lab.learning.training import maker_of
from camssf_lab.simulation.scene import Scene, true_pose

FRAMED, EVEN, FIELD, BARE = "framed", "even", "field", "field, no gain modes"
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
    model = device.name[len(maker) :].strip() if maker else ""
    photo = Photo("0.dng", *SIZE, 1, None, None, False, maker, model, f"{seed:064d}")
    white, dark = frame(LEVEL * np.ones_like(y), 1e-5 * np.ones_like(y)), frame(np.zeros_like(y), np.zeros_like(y))
    framed = row == FRAMED
    means = PatchMeans(
        frame(y + noise, error), white if framed else None, dark if framed else None, np.full(3, BLACK), 16383.0
    )
    chart, *frames = in_roles(photo) if framed else (photo, None, None)
    return Capture((MeasuredShot(stated, chart, *frames, at.pose, means, None),), read_chart(TABLE), None)


@contextmanager
def without_modes() -> Iterator[None]:
    """As it was before there were gain modes."""
    none = lambda capture, per_patch: (np.zeros((len(capture.shots), 0, len(capture.chart.patches))), 0.0)  # noqa: E731
    with mock.patch("camssf.fit.capture_fit.gain_modes", none):
        yield


def of_device(device: Device, key: str, number: int, draws: int) -> Iterator[tuple[str, str, Taken]]:
    """Row, how it was told, and what came of it."""
    maker = maker_of(device.name)
    with standing_in(stands_in(device, key)):
        for draw in range(draws):
            for at, lamp in enumerate(KIND_OF):
                seed = 1000 * number + 100 * draw + at
                for row in (FRAMED, EVEN, FIELD):
                    where = place(np.random.default_rng([seed, row == FIELD]), row)
                    for word, light in ((KNOWN, read_lamp(lamp)), (AUTO, unnamed(lamp))):
                        asked = photographed(device, lamp, light, where, row, maker, seed)
                        yield row, word, judged(asked, device, (lamp,))
                        if row == FIELD and word == KNOWN:
                            with without_modes():
                                yield BARE, word, judged(asked, device, (lamp,))


def misnamed(device: Device, key: str, number: int) -> Iterator[tuple[str, float, str]]:
    """Row, harm and status of every wrong name."""
    maker = maker_of(device.name)
    with standing_in(stands_in(device, key)):
        for at, (stated, true) in enumerate(WRONG):
            seed = 1000 * number + 500 + at
            for row in (FRAMED, FIELD):
                where = place(np.random.default_rng([seed, row == FIELD]), row)
                right, wrong = (
                    judged(photographed(device, true, read_lamp(each), where, row, maker, seed), device, (true,))
                    for each in (true, stated)
                )
                yield row, wrong.rmse - right.rmse, wrong.status


def counted(taken: Sequence[Taken]) -> dict[str, Any]:
    """Means and counts of a row."""
    rmse, covered = np.array([one.rmse for one in taken]), np.array([one.covered for one in taken])
    names = {one.device for one in taken}
    return {
        "captures": len(taken),
        "rmse": float(rmse.mean()),
        "rmse_95": float(np.quantile(rmse, 0.95)),
        "worst": float(rmse.max()),
        "coverage": float(covered.mean()),
        "worst_coverage": float(min(np.mean([one.covered for one in taken if one.device == name]) for name in names)),
        "status": {word: sum(one.status == word for one in taken) for word in ("accepted", "doubtful", "refused")},
        "codes": {code: sum(code in one.codes for one in taken) for one in taken for code in one.codes},
    }


def bars(document: dict[str, Any]) -> list[tuple[str, float, float, float]]:
    """Name, value, least and most that is wanted: issue 16, uneven light."""
    found: list[tuple[str, float, float, float]] = []
    for title in (LEFT_OUT, OTHER):
        if title not in document:
            continue
        rows = document[title]["rows"]
        for word in (KNOWN, AUTO):
            field, even, framed = (rows[f"{row}, {word}"] for row in (FIELD, EVEN, FRAMED))
            found.append((f"{title}, {word}: field over even", field["rmse"] / even["rmse"], 0.0, 1.05))
            found.append((f"{title}, {word}: even over framed", even["rmse"] / framed["rmse"], 0.0, 1.03))
            found.append((f"{title}, {word}: coverage in the field", field["coverage"], 0.94, 0.99))
            accepted = field["status"]["accepted"] / field["captures"]
            found.append((f"{title}, {word}: accepted in the field", accepted, 0.90, 1.0))
        caught = document[title]["misnamed"]
        power = caught[FIELD]["share"] / max(caught[FRAMED]["share"], 1e-9)
        found.append((f"{title}: power over wrong lamps, of that with frames", power, 0.90, 99.0))
    return found


def show(document: dict[str, Any]) -> None:
    """Both tables."""
    head = ["population", "row", "RMSE", "95 %", "worst", "coverage", "worst", "accepted, doubtful, refused", "why"]
    lines = [
        [
            title, name, f"{one['rmse']:.4f}", f"{one['rmse_95']:.3f}", f"{one['worst']:.3f}",
            f"{one['coverage']:.3f}", f"{one['worst_coverage']:.3f}",
            ", ".join(str(count) for count in one["status"].values()),
            ", ".join(f"{code} {count}" for code, count in one["codes"].items()),
        ]
        for title, each in document.items()
        for name, one in each["rows"].items()
    ]  # fmt: skip
    console().print(table("Any light, evenly or not", head, lines))
    lines = [
        [title, row, one["harmful"], one["caught"], f"{one['share']:.3f}"]
        for title, each in document.items()
        for row, one in each["misnamed"].items()
    ]
    console().print(table("Wrong names that harm", ["population", "row", "harmful", "not accepted", "share"], lines))


def main(arguments: list[str] | None = None) -> int:
    parser = command_parser(__spec__, __doc__)
    take_tables(parser, "phones")
    parser.add_argument("--draws", type=int, default=1, help="captures of each device under each lamp")
    parser.add_argument("--only", default="", help="populations whose name begins so")
    options = parser.parse_args(arguments)
    document: dict[str, Any] = {}
    groups = populations(options.phones, None)
    with progress() as bar:
        for title, (devices, key) in groups.items():
            if not title.startswith(options.only):
                continue
            task = bar.add_task(title, total=len(devices))
            rows: dict[str, list[Taken]] = {}
            wrong: dict[str, list[tuple[float, str]]] = {FRAMED: [], FIELD: []}
            for number, device in enumerate(devices):
                for row, word, one in of_device(device, key, number, options.draws):
                    rows.setdefault(f"{row}, {word}", []).append(one)
                for row, harm, status in misnamed(device, key, number):
                    wrong[row].append((harm, status))
                bar.advance(task)
            document[title] = {"rows": {name: counted(each) for name, each in rows.items()}, "misnamed": {}}
            for row, each in wrong.items():
                harmful = [status for harm, status in each if harm > HARM]
                caught = sum(status != "accepted" for status in harmful)
                document[title]["misnamed"][row] = {
                    "harmful": len(harmful), "caught": caught, "share": caught / max(len(harmful), 1),
                }  # fmt: skip
    show(document)
    missed = count_missed(bars(document))
    print(f"written: {save('field', document | {'versions': versions('scipy')})}")
    return int(missed > 0)


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
