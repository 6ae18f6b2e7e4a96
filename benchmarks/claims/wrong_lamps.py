"""Does the verdict see a lamp that is named wrongly? `python -m benchmarks.claims.wrong_lamps --phones phones.csv`

Each capture is simulated as samples of a sensor, measured, solved and judged on `auto` as `camssf calibrate` does it:
one shot with white and dark frame, of the chart whose table is told and of Ohta's, under lamps exactly as their
tables. The file has no colour matrix, so that the chart alone can tell. A wrong name harms where the curves are worse
by more than 0.03 RMSE than under the right one.

Phones are solved with a basis of the other phones, and with one of the other makers' phones; cameras with their maker
left out; another laboratory's cameras with both bases as shipped. Each with the file's maker named, and without.
`--phones` (or CAMSSF_PHONES) and `--foreign` (CAMSSF_FOREIGN) name the tables that may not be passed on, as in
benchmarks.claims.phones; without them cameras alone are judged, every sixth of the 52.

The second table: no dark frame, and the file's black level off by parts of the sensor's range.

Exit status 1 where a bar is missed, each with the maker named: phones, basis of the others: at most 2 % of the clean
captures doubted, none refused, 95 % of the harmful names caught; another laboratory's cameras: 85 % caught, the bands
of what is accepted cover 92 %, of the worst camera 80 %.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.claims.faults import HARM, Outcome, shoot, solved, stage
from benchmarks.claims.phones import CAMERAS, OTHER_MAKER, OTHERS, PHONES, Device, foreign_cameras, measured_cameras
from benchmarks.claims.phones import phones_left_out as phones_of
from benchmarks.shared import command_parser, console, one_thread, progress, save, table, take_tables, versions
from camssf.errors import CalibrationError
from camssf.photo.capture import MeasuredShot
from camssf.recovery.basis import Basis
from camssf.spectra import read_chart, read_lamp
from camssf_lab.learning.training import maker_of, read_curves

WRONG = (
    ("A", "LED-BH1"), ("A", "LED-B1"), ("LED-B3", "LED-B4"), ("D55", "D:15000"), ("D65", "A"), ("A", "D55"),
    ("D55", "FL2"), ("FL2", "FL11"), ("LED-B3", "LED-V1"), ("D65", "LED-B3"), ("D55", "LED-B5"), ("FL2", "A"),
    ("bulb", "LED-BH1"), ("bulb", "LED-B1"), ("daylight", "LED-B4"), ("equal-energy", "A"),
)  # fmt: skip
"""Told, true."""
RIGHT = (
    *((lamp, lamp) for lamp in ("D55", "D65", "A", "LED-B3", "FL2")), ("bulb", "A"), ("daylight", "D:5000"),
)  # fmt: skip
LEFT_OUT, FOREIGN = "phones, basis of the others", "another laboratory's cameras"
NAMED = "maker named"
BLACK_LEVEL = "black_level"
CHARTS = ("classic24", "classic24:ohta")
BLACK = (0.0, -0.005, -0.002, 0.002, 0.005, 0.01)
"""Of the sensor's range: the file's black less the true one."""


@dataclass(frozen=True)
class Told:
    """One capture, judged.

    Attributes:
        device, lamp, light, chart: whose, the lamp told, the true one, and the chart in the photo.
        outcome: of the verdict.
        harm: RMSE beyond that under the right name; 0 where that was told.
    """

    device: str
    lamp: str
    light: str
    chart: str
    outcome: Outcome
    harm: float


def taken(device: Device, light: str, chart: str, number: int) -> MeasuredShot:
    """The chart under that light, measured; its file holds no colour matrix."""
    staged = stage(number, device.name, device.curves, light)
    setup = replace(
        staged.setup, lamp=read_lamp(light), table=replace(read_chart(chart), name=CHARTS[0]), white_level=1.0
    )
    shot = shoot(staged, setup, search=False)
    return replace(shot, photo=replace(shot.photo, colour_matrices=()))


def judged(shot: MeasuredShot, lamp: str, maker: str, basis: Basis, device: Device) -> Outcome:
    """The verdict of the shot under that name of its lamp; a maker's file names the model, too, as phones do."""
    model = device.name[len(maker) :].strip() if maker else ""
    changed = replace(shot, lamp=read_lamp(lamp), photo=replace(shot.photo, make=maker, model=model))
    return solved([changed], basis, device.curves)


def of_device(device: Device, basis: Basis, maker: str, number: int) -> Iterator[Told]:
    """Every right and wrong name, both charts."""
    for chart in CHARTS:
        shots = {light: taken(device, light, chart, number) for _, light in (*RIGHT, *WRONG)}
        right = {light: judged(shot, light, maker, basis, device) for light, shot in shots.items()}
        for lamp, light in RIGHT:
            known = right[light] if lamp == light else judged(shots[light], lamp, maker, basis, device)
            yield Told(device.name, lamp, light, chart, known, 0.0)
        for lamp, light in WRONG:
            outcome, known = judged(shots[light], lamp, maker, basis, device), right[light]
            worse = (outcome.rmse or np.inf) - (known.rmse or np.inf)
            yield Told(device.name, lamp, light, chart, outcome, float(worse))


def black_levels(device: Device, basis: Basis, number: int) -> Iterator[tuple[float, Outcome]]:
    """No dark frame, and the file's black level off."""
    for light in ("D55", "A", "LED-B3"):
        shot = taken(device, light, CHARTS[1], number)
        for off in BLACK:
            means = shot.means
            black = means.black + off * (means.saturation - means.black)
            changed = replace(shot, dark=None, means=replace(means, dark=None, black=black))
            yield off, judged(changed, light, "", basis, device)


def row(rows: Sequence[Told]) -> dict[str, Any]:
    """Counts."""
    clean = [one for one in rows if one.harm == 0.0]
    harmful = [one for one in rows if one.harm > HARM]
    missed = [one for one in harmful if not one.outcome.caught]
    return {
        "clean": len(clean),
        "clean_doubtful": sum(one.outcome.status == "doubtful" for one in clean),
        "clean_refused": sum(one.outcome.status == "refused" for one in clean),
        "clean_codes": sorted({code for one in clean for code in one.outcome.codes}),
        "coverage": _mean([one.outcome.covered for one in clean if not one.outcome.caught]),
        "worst_coverage": min(
            _mean([one.outcome.covered for one in clean if one.device == name and not one.outcome.caught] or [1.0])
            for name in {one.device for one in clean}
        ),
        "rmse": _mean([one.outcome.rmse for one in clean]),
        "harmful": len(harmful),
        "harmful_caught": len(harmful) - len(missed),
        "harmful_refused": sum(one.outcome.status == "refused" for one in harmful),
        "missed": [f"{one.device}: {one.lamp} for {one.light}, {one.chart}" for one in missed],
    }


def _mean(values: Sequence[float | None]) -> float:
    return float(np.mean([value for value in values if value is not None])) if values else float("nan")


def bars(document: dict[str, Any]) -> list[dict[str, Any]]:
    """Of the populations that were judged, their values and whether they are met; printed."""
    made: list[dict[str, Any]] = []

    def add(name: str, value: float, limit: float, *, least: bool) -> None:
        met = bool(value >= limit if least else value <= limit)
        made.append({"bar": name, "value": value, "limit": limit, "at_least": least, "met": met})

    for title, caught in ((LEFT_OUT, 0.95), (FOREIGN, 0.85)):
        if title not in document:
            continue
        row_ = document[title][NAMED]
        add(f"{title}: harmful names caught", row_["harmful_caught"] / max(row_["harmful"], 1), caught, least=True)
        if title == LEFT_OUT:
            add(f"{title}: clean captures doubted", row_["clean_doubtful"] / row_["clean"], 0.02, least=False)
            add(f"{title}: clean captures refused", row_["clean_refused"] / row_["clean"], 0.0, least=False)
        else:
            add(f"{title}: coverage of the accepted", row_["coverage"], 0.92, least=True)
            add(f"{title}: the same of the worst camera", row_["worst_coverage"], 0.80, least=True)
    lines = [
        [bar["bar"], f"{bar['value']:.3f}", f"{'≥' if bar['at_least'] else '≤'} {bar['limit']:g}",
         "met" if bar["met"] else "MISSED"]
        for bar in made
    ]  # fmt: skip
    console().print(table("Bars", ["bar", "value", "limit", "verdict"], lines))
    return made


def populations(phones: Path | None, foreign: Path | None) -> dict[str, tuple[list[Device], str]]:
    """Devices, and which of their bases stands in for the shipped one."""
    found: dict[str, tuple[list[Device], str]] = {}
    if phones is not None:
        devices = phones_of(read_curves(phones))
        found[LEFT_OUT] = (devices, OTHERS)
        found["phones, basis of the other maker"] = (devices, OTHER_MAKER)
    if foreign is not None:
        found[FOREIGN] = (foreign_cameras(foreign), CAMERAS)
    found["cameras, maker left out"] = (measured_cameras()[::6], CAMERAS)
    return found


def stands_in(device: Device, key: str) -> Basis:
    """The device's basis under the name of the shipped one that it stands in for."""
    return replace(device.bases[key], name=CAMERAS if key == CAMERAS else PHONES)


def show(document: dict[str, Any]) -> None:
    """Both tables."""
    head = [
        "population",
        "maker",
        "clean: doubtful, refused",
        "coverage",
        "worst",
        "RMSE",
        "harmful",
        "caught",
        "refused",
    ]
    lines = [
        [
            title,
            words,
            f"{one['clean_doubtful']}, {one['clean_refused']} of {one['clean']}",
            f"{one['coverage']:.3f}",
            f"{one['worst_coverage']:.3f}",
            f"{one['rmse']:.4f}",
            one["harmful"],
            f"{100 * one['harmful_caught'] / max(one['harmful'], 1):.1f} %",
            one["harmful_refused"],
        ]
        for title, found in document.items()
        for words, one in found.items()
        if words != BLACK_LEVEL
    ]
    out = console()
    out.print(table("A lamp named rightly, and wrongly", head, lines))
    lines = [
        [
            title,
            *(f"{one['caught']} of {one['captures']}, {one['rmse']:.4f}" for one in found[BLACK_LEVEL].values()),
        ]
        for title, found in document.items()
    ]
    head = ["population", *(f"{off:+.1%}" for off in BLACK)]
    out.print(table("The black level off, no dark frame: caught, RMSE", head, lines))


def main(arguments: Sequence[str] | None = None) -> int:
    parser = command_parser(__spec__, __doc__)
    take_tables(parser, "phones", "foreign")
    options = parser.parse_args(arguments)
    try:
        groups = populations(options.phones, options.foreign)
    except CalibrationError as error:
        print(f"{error.code}: {error}", file=sys.stderr)
        return error.exit_status
    document: dict[str, Any] = {}
    levels: dict[str, dict[float, list[Outcome]]] = {}
    with progress() as bar:
        task = bar.add_task("captures", total=2 * sum(len(devices) for devices, _ in groups.values()))
        for title, (devices, key) in groups.items():
            rows: dict[str, list[Told]] = {NAMED: [], "no maker": []}
            levels[title] = {off: [] for off in BLACK}
            for number, device in enumerate(devices):
                basis = stands_in(device, key)
                for words in rows:
                    maker = maker_of(device.name) if words == NAMED else ""
                    rows[words] += of_device(device, basis, maker, 3000 + number)
                    bar.advance(task)
                for off, outcome in black_levels(device, basis, 3000 + number):
                    levels[title][off].append(outcome)
            document[title] = {words: row(each) for words, each in rows.items()}
            document[title][BLACK_LEVEL] = {
                f"{off:g}": {
                    "captures": len(found),
                    "caught": sum(one.caught for one in found),
                    "codes": sorted({code for one in found for code in one.codes}),
                    "rmse": _mean([one.rmse for one in found]),
                }
                for off, found in levels[title].items()
            }
    show(document)
    found = bars(document)
    document["bars"] = found
    print(save("wrong-lamps", document | {"versions": versions("scipy", "colour-science")}))
    return 0 if all(bar["met"] for bar in found) else 1


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
