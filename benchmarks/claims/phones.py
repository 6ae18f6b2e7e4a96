"""Is a phone better served by a basis of phones?

The measured phones may not be passed on (NOTICE), so whoever has the table names it; columns camera, wavelength_nm,
R, G, B. Nothing is ever fitted to the cameras of another laboratory.

Each phone is solved on the same draws with `cameras` as shipped, with a basis learned from the other phones, and with
one learned from the other makers' phones alone; joint reference, elastic net. "auto" lets the evidence choose between
such a basis and `cameras`, no maker named; "apart" is `cameras`, each channel solved for itself. "No photo" is the
mean of the basis. Settings are those of `accuracy`; "low" noise is hypot(0.1 %, 0.0002), "off" lamps are off by a
drawn temperature and a smooth 2 %, both declared. RMSE on peak-normalised curves, 400 to 700 nm; coverage of the 95 %
bands, overall and of the device that fares worst in that setting.

The choice: by how many nats the evidence of `phones` (the phone itself left out) is above that of `cameras` (the
camera's maker left out; as shipped for phones and the other laboratory's). 20 : 1 is 3 nats.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.captures import LOW
from benchmarks.claim import Run
from benchmarks.claims.accuracy import SEED, SETTINGS, Found, Setting, answer_of, apart, declared, photograph
from benchmarks.devices import (
    CAMERAS,
    FOREIGN,
    LEFT_OUT,
    OTHER_MAKER,
    OTHERS,
    PHONES,
    Device,
    foreign_cameras,
    measured_cameras,
    no_photo,
    phones_left_out,
    scored,
)
from benchmarks.shared import chart, standing_in
from camssf.grid import Floats
from camssf.recovery.hypotheses import LampGuess, Space
from camssf.recovery.observation import Observation
from camssf.recovery.sensitivity import SolverSettings, Ssf, solve_on_basis
from camssf.spectra import read_chart
from camssf_lab.learning.training import read_curves
from golden.linear_model import linear_model

OPTIONS = {"draws": (8, "of noise and lamps, for each device and setting; a quarter of them for the 52 cameras")}
_ACCURACY = {setting.name: setting for setting in SETTINGS}
JUDGED = (
    _ACCURACY["exact, D55, 24"],
    Setting("exact, D55, 24, low", ("D55",), noise=LOW),
    *(setting for setting in SETTINGS if setting.ohta),
)
EVERY = (*SETTINGS[:2], JUDGED[1], *SETTINGS[2:])
"""All settings."""
APART = "cameras, apart"
CLEAR = float(np.log(20.0))
"""Nats of odds of 20 : 1."""
REFERENCE = SolverSettings(engine="reference")


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

    @property
    def worst_coverage(self) -> float:
        """Of the device that fares worst."""
        return float(self.coverage.mean(axis=0).min())

    @property
    def row(self) -> tuple[float, ...]:
        """RMSE, coverage, that of the worst device."""
        return float(self.rmse.mean()), float(self.coverage.mean()), self.worst_coverage


def auto(basis: str) -> str:
    """The label of the choice between that basis and `cameras`."""
    return f"auto: {basis}"


def answers(device: Device, observation: Observation) -> dict[str, tuple[Found, float]]:
    """Curves and bands, and the nats of evidence, on each basis of the device, by choice, and channel by channel."""
    found: dict[str, tuple[Found, float]] = {}
    for name, basis in device.bases.items():
        solved = solve_on_basis(observation, basis, settings=REFERENCE)
        assert solved.log_evidence is not None
        found[name] = solved.peak(), solved.log_evidence
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
    guess = LampGuess((), observation, 0.0)
    with standing_in(*bases):
        return Space((guess,), tuple((basis.name, 1.0, 0.0) for basis in bases), None, REFERENCE).recover()


def measure(devices: Sequence[Device], setting: Setting, draws: int) -> dict[str, Runs]:
    """By basis; every basis sees the same draws."""
    table = read_chart("classic24:ohta").values if setting.ohta else chart()
    rng = np.random.default_rng(SEED)
    kept: dict[str, list[tuple[float, float, float]]] = {}
    for _ in range(draws):
        for device in devices:
            y, error = photograph(setting, device.curves, table[slice(*setting.patches)], rng)
            for name, (found, nats) in answers(device, declared(setting, y, error)).items():
                kept.setdefault(name, []).append((*scored(found, device.curves), nats))
    return {
        name: Runs(*np.moveaxis(np.array(rows).reshape(draws, len(devices), 3), 2, 0)) for name, rows in kept.items()
    }


def odds(runs: Mapping[str, Mapping[str, Runs]], phones: str) -> dict[str, Floats]:
    """By setting, (draws, devices) nats by which the evidence is for the phones' basis."""
    return {setting: bases[phones].log_evidence - bases[CAMERAS].log_evidence for setting, bases in runs.items()}


def claim(run: Run) -> None:
    """Two tables a population."""
    groups = {
        "phones, left out": (phones_left_out(read_curves(run.named("phones"))), OTHERS, run.options.draws),
        LEFT_OUT: (measured_cameras(), PHONES, max(1, run.options.draws // 4)),
    }
    if run.options.foreign is not None:
        groups[FOREIGN] = foreign_cameras(run.options.foreign), PHONES, run.options.draws
    for title, (devices, phones, draws) in groups.items():
        runs = {setting.name: measure(devices, setting, draws) for setting in run.track(EVERY, title)}
        bases = list(next(iter(runs.values())))
        choices = [basis for basis in bases if basis.startswith(auto(""))]
        means = {basis: float(np.mean([no_photo(device.bases[basis], device.curves) for device in devices]))
                 for basis in devices[0].bases}  # fmt: skip
        lines = [
            (name, *(own[basis].row for basis in bases),
             *(own[basis].rmse.mean() / own[APART].rmse.mean() for basis in choices))
            for name, own in runs.items()
        ]  # fmt: skip
        mean = (f"{means[basis]:.4f}" if basis in means else None for basis in bases)
        lines.append(("no photo", *mean, *(None for _ in choices)))
        columns = {"setting": ""} | dict.fromkeys(bases, "{:.4f} {:.3f} {:.3f}")
        run.table(
            f"{title} ({len(devices)}, {draws} draws): RMSE, coverage, worst device",
            columns | {f"{basis} / {APART}": ".2f" for basis in choices},
            lines,
        )
        for basis in (phones, OTHER_MAKER) if phones == OTHERS else (phones,):
            own = np.concatenate(list(odds(runs, basis).values()))
            sides = {**dict(zip([device.name for device in devices], own.T, strict=True)), "all": own.ravel()}
            columns = {"device": ""} | dict.fromkeys(("least", "median", "largest"), "+.1f")
            columns |= dict.fromkeys(("phones wins", "clearly (20 : 1)", "cameras clearly"), ".0%")
            run.table(
                f"{title}: nats for `{basis}` over settings and draws",
                columns,
                [
                    (name, nats.min(), np.median(nats), nats.max(), np.mean(nats > 0), np.mean(nats > CLEAR),
                     np.mean(nats < -CLEAR))
                    for name, nats in sides.items()
                ],
            )  # fmt: skip
    if run.options.foreign is None:
        run.say("No cameras of another laboratory: name a table by --foreign or CAMSSF_FOREIGN to judge them, too.")
