"""Is a phone better served by a basis of phones? `python -m benchmarks.claims.phones --phones phones.csv [--draws 8]`

The measured curves of the phones may not be passed on (NOTICE), so whoever has the table names it, here or in
CAMSSF_PHONES; columns camera, wavelength_nm, R, G, B. `--foreign`, or CAMSSF_FOREIGN, names cameras of another
laboratory; nothing is ever fitted to them. Without a table the command says what is missing and ends with status 2.

Each phone is solved on the same draws with `cameras` as shipped, with a basis learned from the other phones, and with
one learned from the other makers' phones alone; joint reference, elastic net. "auto" lets the evidence choose between
such a basis and `cameras`, no maker named; "apart" is `cameras` with each channel solved for itself, as before
channels knew of each other. Settings are those of `accuracy`; "low" noise is hypot(0.1 %, 0.0002), "off" lamps are
off by a drawn temperature and a smooth 2 %, both declared. RMSE on peak-normalised curves, 400 to 700 nm; coverage of
the 95 % bands, overall and of the phone that fares worst in that setting.

The choice: by how many nats the evidence of `phones` (the phone itself left out) is above that of `cameras` (the
camera's maker left out; as shipped for phones and the other laboratory's). 20 : 1 is 3 nats.

The lamp: told A ± 250 K where it is exactly A, how far off is the temperature that the answer takes it for?
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import Progress

from benchmarks.claims.accuracy import (
    LOW,
    SEED,
    SEEN,
    SETTINGS,
    Found,
    Setting,
    answer_of,
    apart,
    declared,
    left_out,
    photograph,
    power,
)
from benchmarks.claims.accuracy import judge as against
from benchmarks.shared import (
    chart,
    command_parser,
    console,
    one_thread,
    parse_for_phones,
    progress,
    save,
    standing_in,
    table,
    versions,
)
from camssf.errors import CalibrationError
from camssf.grid import Floats
from camssf.recovery.basis import Basis, interpolate, read_basis
from camssf.recovery.hypotheses import LampGuess, Space
from camssf.recovery.observation import Observation
from camssf.recovery.sensitivity import SolverSettings, Ssf, solve_on_basis
from camssf.spectra import read_chart
from camssf_lab.learning.basis import learn
from camssf_lab.learning.training import HANDFUL, Enlargement, maker_of, read_curves
from golden.linear_model import linear_model

_ACCURACY = {setting.name: setting for setting in SETTINGS}
JUDGED = (
    _ACCURACY["exact, D55, 24"],
    Setting("exact, D55, 24, low", ("D55",), noise=LOW),
    *(setting for setting in SETTINGS if setting.ohta),
)
EVERY = (*SETTINGS[:2], JUDGED[1], *SETTINGS[2:])
"""All settings."""
CAMERAS, OTHERS, OTHER_MAKER, PHONES = "cameras", "other phones", "other maker's phones", "phones"
APART = "cameras, apart"
DOUBT = 250.0
"""Standard deviation of lamp A's temperature as it is told, K."""
CLEAR = float(np.log(20.0))
"""Nats of odds of 20 : 1."""


@dataclass(frozen=True)
class Device:
    """One measured phone or camera and the bases that it is solved with.

    Attributes:
        name: maker first.
        curves: (681, 3).
        bases: by what they were learned from.
    """

    name: str
    curves: Floats
    bases: Mapping[str, Basis]


@dataclass(frozen=True)
class Runs:
    """Of one setting and basis, by draw and device.

    Attributes:
        rmse: (draws, devices) mean of R, G, B.
        coverage: (draws, devices) share of wavelengths, 400 to 700 nm, within the bands.
        log_evidence: (draws, devices).
    """

    rmse: Floats
    coverage: Floats
    log_evidence: Floats

    def row(self, names: Sequence[str]) -> dict[str, Any]:
        """Means over draws: of all devices, of the worst, and each device's."""
        rmse, coverage = self.rmse.mean(axis=0), self.coverage.mean(axis=0)
        return {
            "rmse": float(rmse.mean()),
            "worst_rmse": float(rmse.max()),
            "coverage": float(coverage.mean()),
            "worst_coverage": float(coverage.min()),
            "devices": {
                name: {"rmse": float(wrong), "coverage": float(held)}
                for name, wrong, held in zip(names, rmse, coverage, strict=True)
            },
        }


def taught(nodes: Mapping[str, Floats], names: Sequence[str], size: Enlargement, label: str) -> Basis:
    """The basis of these devices, curves (69, 3) by name."""
    stack = np.stack([nodes[name] for name in names])
    mean, atoms = learn(stack, makers=[maker_of(name) for name in names], size=size)
    return Basis(label, interpolate(mean[..., None])[..., 0], interpolate(atoms), True, ", ".join(names))


def phones_left_out(nodes: Mapping[str, Floats], size: Enlargement = HANDFUL) -> list[Device]:
    """Each phone with `cameras`, the basis of all others, and that of all other makers'."""
    found = []
    for name, curves in nodes.items():
        others = [other for other in nodes if other != name]
        strangers = [other for other in nodes if maker_of(other) != maker_of(name)]
        bases = {
            CAMERAS: read_basis("cameras"),
            OTHERS: taught(nodes, others, size, OTHERS),
            OTHER_MAKER: taught(nodes, strangers, size, OTHER_MAKER),
        }
        found.append(Device(name, interpolate(curves), bases))
    return found


def each_left_out(table_: Path | str | None) -> tuple[dict[str, Floats], dict[str, Basis]]:
    """By name curves (681, 3), and the basis of the other phones; without a table, of cameras of other makers."""
    if table_ is not None:
        phones = phones_left_out(read_curves(Path(table_)))
        return {one.name: one.curves for one in phones}, {one.name: one.bases[OTHERS] for one in phones}
    curves, bases = left_out()
    return curves, {name: bases[maker_of(name)] for name in curves}


def measured_cameras() -> list[Device]:
    """The 52 cameras with `cameras`, their maker left out, and `phones`."""
    curves, bases = each_left_out(None)
    phones = read_basis("phones")
    return [Device(name, curve, {CAMERAS: bases[name], PHONES: phones}) for name, curve in curves.items()]


def foreign_cameras(path: Path) -> list[Device]:
    """Another laboratory's cameras with both bases as shipped."""
    bases = {CAMERAS: read_basis("cameras"), PHONES: read_basis("phones")}
    return [Device(name, interpolate(curves), bases) for name, curves in read_curves(path).items()]


def auto(basis: str) -> str:
    """The label of the choice between that basis and `cameras`."""
    return f"auto: {basis}"


def renamed(ssf: Ssf, basis: str) -> Ssf:
    """The answer with another name of its basis."""
    return replace(ssf, basis=basis)


def nats(ssf: Ssf) -> float:
    """The answer's evidence."""
    assert ssf.log_evidence is not None
    return ssf.log_evidence


def answers(device: Device, observation: Observation) -> dict[str, tuple[Found, float]]:
    """Curves and bands, and the nats of evidence, on each basis of the device, by choice, and channel by channel."""
    solved = {
        name: renamed(solve_on_basis(observation, basis, settings=SolverSettings(engine="reference")), name)
        for name, basis in device.bases.items()
    }
    found = {name: (each.peak(), nats(each)) for name, each in solved.items()}
    if CAMERAS not in device.bases:  # where enlargements are compared nothing is chosen
        return found
    for name in device.bases:
        if name != CAMERAS:
            found[auto(name)] = automatic(observation, device, name).peak(), float("nan")
    book = device.bases[CAMERAS]
    found[APART] = answer_of(apart(linear_model(observation, book)), observation, book), float("nan")
    return found


def automatic(observation: Observation, device: Device, name: str) -> Ssf:
    """The product's choice between that basis, as `phones`, and `cameras`, without a maker's name."""
    bases = (replace(device.bases[name], name="phones"), replace(device.bases[CAMERAS], name="cameras"))
    guess, settings = LampGuess((), observation, 0.0), SolverSettings(engine="reference")
    with standing_in(*bases):
        return Space((guess,), tuple((basis.name, 1.0, 0.0) for basis in bases), None, settings).recover()


def doubted_lamp(devices: Sequence[Device], draws: int, bar: Progress) -> dict[str, dict[str, Any]]:
    """Lamp A told as A ± 250 K, and as A; by basis. Ohta's chart, low noise.

    Returns:
        `kelvin`: by device how far from A the lamp is then taken to be, K, mean over draws: the change that the
        answer makes to the lamp, against that of a hot body, by least squares over ln L. `doubted` and `exact`: RMSE
        and coverage under either word.
    """
    setting = Setting("", ("A",), noise=LOW, ohta=True)
    seen, rng = read_chart("classic24:ohta").values, np.random.default_rng(SEED)
    step = (np.log(power("A", 2856.0 + DOUBT)) - np.log(power("A", 2856.0 - DOUBT))) / 2.0
    bend = step - step.mean()
    off: dict[str, dict[str, list[float]]] = {name: {} for name in devices[0].bases}
    scores: dict[str, dict[str, list[tuple[float, float]]]] = {name: {"doubted": [], "exact": []} for name in off}
    task = bar.add_task("A ± 250 K", total=draws * len(devices))
    for _ in range(draws):
        for device in devices:
            y, error = photograph(setting, device.curves, seen, rng)
            exact = declared(setting, y, error)
            observations = {"doubted": replace(exact, lamp_modes=step[None, None]), "exact": exact}
            for name, basis in device.bases.items():
                found = {
                    word: solve_on_basis(each, basis, settings=SolverSettings(engine="reference"))
                    for word, each in observations.items()
                }
                for word, each in found.items():
                    rmse, covered = against(each.peak(), device.curves)
                    assert covered is not None  # a learned basis has bands
                    scores[name][word].append((float(rmse.mean()), float(covered[:, SEEN].mean())))
                change = np.log(found["doubted"].lamp[0] / exact.lamp[0])
                kelvin = DOUBT * float((change - change.mean()) @ bend / (bend @ bend))
                off[name].setdefault(device.name, []).append(kelvin)
            bar.advance(task)
    return {
        name: {"kelvin": {device: float(np.mean(each)) for device, each in by.items()}}
        | {
            word: dict(zip(("rmse", "coverage"), map(float, np.mean(rows, axis=0)), strict=True))
            for word, rows in scores[name].items()
        }
        for name, by in off.items()
    }


def _doubted(title: str, found: Mapping[str, Mapping[str, Any]]) -> Any:
    lines = []
    for basis, row in found.items():
        off = np.array(list(row["kelvin"].values()))
        words = (f"{row[word]['rmse']:.4f} {row[word]['coverage']:.3f}" for word in ("exact", "doubted"))
        lines.append([basis, f"{off.min():+.0f} to {off.max():+.0f}", f"{np.abs(off).mean():.0f}", *words])
    head = ["basis", "estimated less true, K", "mean size", "told A: RMSE, coverage", "told A ± 250 K"]
    return table(f"{title}: lamp A, told A ± 250 K", head, lines)


def measure(
    devices: Sequence[Device], settings: Sequence[Setting], draws: int, bar: Progress | None = None, label: str = ""
) -> dict[str, dict[str, Runs]]:
    """By setting and basis; every basis sees the same draws."""
    ohta = read_chart("classic24:ohta").values
    task = None if bar is None else bar.add_task(label, total=len(settings) * draws * len(devices))
    found = {}
    for setting in settings:
        rng = np.random.default_rng(SEED)
        seen = (ohta if setting.ohta else chart())[slice(*setting.patches)]
        kept: dict[str, list[tuple[float, float, float]]] = {}
        for _ in range(draws):
            for device in devices:
                y, error = photograph(setting, device.curves, seen, rng)
                for name, (found_, nats) in answers(device, declared(setting, y, error)).items():
                    rmse, covered = against(found_, device.curves)
                    assert covered is not None  # a learned basis has bands
                    kept.setdefault(name, []).append((rmse.mean(), covered[:, SEEN].mean(), nats))
                if bar is not None and task is not None:
                    bar.advance(task)
        found[setting.name] = {
            name: Runs(*np.moveaxis(np.array(rows).reshape(draws, len(devices), 3), 2, 0))
            for name, rows in kept.items()
        }
    return found


def odds(runs: Mapping[str, Mapping[str, Runs]], phones: str) -> dict[str, Floats]:
    """By setting, (draws, devices) nats by which the evidence is for the phones' basis."""
    return {setting: bases[phones].log_evidence - bases[CAMERAS].log_evidence for setting, bases in runs.items()}


def choice(nats: Mapping[str, Floats], names: Sequence[str]) -> dict[str, dict[str, float]]:
    """By device, over all settings and draws: least, median, largest odds in nats, and how often each side wins.

    `all` counts every device alike.
    """
    together = np.concatenate(list(nats.values()))
    columns = {**dict(zip(names, together.T, strict=True)), "all": together.ravel()}
    return {
        name: {
            "least": float(own.min()),
            "median": float(np.median(own)),
            "largest": float(own.max()),
            "phones": float((own > 0).mean()),
            "phones_clear": float((own > CLEAR).mean()),
            "cameras_clear": float((own < -CLEAR).mean()),
        }
        for name, own in columns.items()
    }


def _held(row: Mapping[str, Any]) -> str:
    return f"{row['rmse']:.4f} {row['coverage']:.3f} {row['worst_coverage']:.3f}"


def _accuracy(title: str, rows: Mapping[str, Mapping[str, Mapping[str, Any]]], beside: str) -> Any:
    """RMSE, coverage and worst coverage by basis, and the ratio of RMSE to that of `cameras`."""
    bases = list(next(iter(rows.values())))
    choices = [basis for basis in bases if basis.startswith(auto(""))]
    lines = [
        [
            name,
            *(_held(row[basis]) for basis in bases),
            *(f"{row[basis]['rmse'] / row[APART]['rmse']:.2f}" for basis in choices),
        ]
        for name, row in rows.items()
    ]
    head = ["setting", *bases, *(f"{basis} / {APART}" for basis in choices)]
    return table(f"{title}: RMSE, coverage, worst {beside}", head, lines)


def _choice(title: str, rows: Mapping[str, Mapping[str, float]]) -> Any:
    lines = [
        [
            name,
            *(f"{row[key]:+.1f}" for key in ("least", "median", "largest")),
            *(f"{100 * row[key]:.0f} %" for key in ("phones", "phones_clear", "cameras_clear")),
        ]
        for name, row in rows.items()
    ]
    return table(
        f"{title}: nats for `phones` over settings and draws",
        ["device", "least", "median", "largest", "phones wins", "clearly (20 : 1)", "cameras clearly"],
        lines,
    )


def judge(nodes: Mapping[str, Floats], foreign: Path | None, draws: int) -> dict[str, Any]:
    """The tables, printed; as a document."""
    out, document = console(), {}
    groups = {"phones, left out": (phones_left_out(nodes), OTHERS, draws)}
    groups["cameras, maker left out"] = (measured_cameras(), PHONES, max(1, draws // 4))
    if foreign is not None:
        groups["another laboratory's cameras"] = (foreign_cameras(foreign), PHONES, draws)
    for title, (devices, phones, count) in groups.items():
        names = [device.name for device in devices]
        with progress() as bar:
            runs = measure(devices, EVERY, count, bar, title)
            lamp = doubted_lamp(devices, count, bar)
        rows = {setting: {key: run.row(names) for key, run in bases.items()} for setting, bases in runs.items()}
        choices = {phones: choice(odds(runs, phones), names)}
        if phones == OTHERS:
            choices[OTHER_MAKER] = choice(odds(runs, OTHER_MAKER), names)
        out.print(_accuracy(f"{title} ({len(names)}, {count} draws)", rows, "device"))
        for basis, found in choices.items():
            out.print(_choice(f"{title}, `phones` = {basis}", found))
        out.print(_doubted(title, lamp))
        document[title] = {"draws": count, "settings": rows, "choice": choices, "lamp A ± 250 K": lamp}
    if foreign is None:
        out.print("No cameras of another laboratory: name a table by --foreign or CAMSSF_FOREIGN to judge them, too.")
    return document


def main(arguments: Sequence[str] | None = None) -> int:
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("--draws", type=int, default=8, help="of noise and lamps, for each device and setting")
    options = parse_for_phones(parser, arguments, "foreign")
    if options is None:
        return 2
    try:
        document = judge(read_curves(options.phones), options.foreign, options.draws)
    except CalibrationError as error:
        print(f"{error.code}: {error}", file=sys.stderr)
        return error.exit_status
    print(save("phones", document | {"versions": versions("scipy", "colour-science")}))
    return 0


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
