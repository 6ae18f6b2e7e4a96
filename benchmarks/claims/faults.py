"""What does the verdict catch, and what does it miss? `python -m benchmarks.claims.faults [--quick] [--phones CSV]`

Every fault of `benchmarks.faults` in every severity, on captures of measured cameras under several lamps,
solved as the product does it, `auto`, with a basis `cameras` learned without the camera's maker (as
`benchmarks.claims.accuracy`), or, with the phones' table that may not be passed on, on phones with a basis `phones`
learned without the phone's maker. The files name no maker. Each capture has a real chart and
a real lamp: a quarter has the table's own reflectances, a quarter Ohta's, half a chart drawn from the tolerance
that the solver is told; the lamp is off by a smooth 2 %, and by 1 % brighter or darker when the white frame is
taken; the file's colour matrices are off by 3 %. Poses are the true corners, 1 % of a
pitch off, but for faults that concern the search: there it is the search's. Samples are measured in memory;
severity 2 of every fault also goes through real DNG files and the whole of `calibrate`, and the verdicts are
compared.

Cameras are split in halves by maker: thresholds were set on the first (`--half tune`), the table is of the second.

A capture is caught if it is refused or doubtful; else it is missed where the fault raised the RMSE of the curves (400
to 700 nm, peak-normalised, mean of R, G, B) by more than 0.03 against the same capture without the fault, and
harmless where not. "Harmful caught" is the share caught of those whose curves are known and harmful; captures that an
earlier stage refused, before there were curves, are not counted in it. Exit status 1 where a bar is missed.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.claims.accuracy import SEEN, left_out
from benchmarks.claims.phones import PHONES, taught
from benchmarks.faults import FAULTS, SEVERITIES, apply_fault
from benchmarks.problems import makers_matrices
from benchmarks.shared import TABLE, command_parser, console, one_thread, progress, save, standing_in, table, versions
from camssf.calibration import calibrate as from_files
from camssf.calibration import solve
from camssf.errors import CalibrationError
from camssf.fit.capture_fit import prepare_fit
from camssf.fit.solutions import recover_fit
from camssf.grid import STEP, Floats
from camssf.options import Options
from camssf.photo.capture import Capture, MeasuredShot, photo_of
from camssf.photo.find.pose import Pose, find_chart
from camssf.photo.find.search import agreement, plain_signals
from camssf.photo.patches import measure_patches
from camssf.photo.read.dng import Mosaic
from camssf.recovery.basis import Basis, interpolate
from camssf.recovery.covariance import (
    ABSOLUTE,
    CHART_CORRELATION,
    EDGE,
    LAMP_CORRELATION,
    RELATIVE,
    TABLE_CORRELATION,
    smooth_errors,
)
from camssf.spectra import CameraCurves, ChartTable, read_chart, read_lamp
from camssf.verdict.reasons import Verdict
from camssf_lab.learning.training import HANDFUL, maker_of, read_curves
from camssf_lab.simulation.camera import Sensor
from camssf_lab.simulation.frames import simulate
from camssf_lab.simulation.scene import Scene, true_pose
from camssf_lab.simulation.shot import take
from camssf_lab.simulation.shot_plan import ShotPlan

SIZE = (720, 540)
LAMPS = ("D55", "A", "LED-B3", "D65", "FL2", "3200K", "LED-B5", "D:5000")
SEARCHED = {"mirrored", "upside-down", "covered", "wrong-type", "defocus", "motion", "printed", "swapped", "cfa"}
"""Faults that the chart search must face itself."""
TUNE = ("canon", "fujifilm", "arri")
"""Makers of the first half."""
HARM = 0.03


@dataclass(frozen=True)
class Staged:
    """A capture before the fault, and who takes it."""

    setup: ShotPlan
    number: int
    maker: str


@dataclass(frozen=True)
class Outcome:
    """What became of one capture.

    Attributes:
        status: accepted, doubtful or refused.
        codes: of the reasons.
        rmse: of the curves, None where there were none.
        covered: share of wavelengths within the 95 % band, likewise.
        words: of the reasons.
        first: key of the first reason's message.
    """

    status: str
    codes: tuple[str, ...]
    rmse: float | None
    covered: float | None
    words: tuple[str, ...] = ()
    first: str = ""

    @property
    def caught(self) -> bool:
        """Whether the verdict warns at all."""
        return self.status != "accepted"


@dataclass
class Tally:
    """Outcomes of one fault and severity, with the RMSE of the same captures without the fault."""

    outcomes: list[Outcome] = field(default_factory=list)
    unspoilt: list[float] = field(default_factory=list)

    def harm(self) -> list[float | None]:
        """By how much the fault raised the RMSE, capture by capture."""
        return [
            None if outcome.rmse is None else outcome.rmse - clean
            for outcome, clean in zip(self.outcomes, self.unspoilt, strict=True)
        ]

    def row(self) -> dict[str, Any]:
        """The numbers of the table."""
        harm = self.harm()
        harmful = [o for o, h in zip(self.outcomes, harm, strict=True) if h is not None and h > HARM]
        accepted = [o for o in self.outcomes if not o.caught]
        rmse = [o.rmse for o in accepted if o.rmse is not None]
        codes = [code for o in self.outcomes for code in dict.fromkeys(o.codes)]
        return {
            "captures": len(self.outcomes),
            "refused": sum(o.status == "refused" for o in self.outcomes),
            "doubtful": sum(o.status == "doubtful" for o in self.outcomes),
            "accepted": len(accepted),
            "harmful": len(harmful),
            "harmful_caught": sum(o.caught for o in harmful),
            "missed": sum(not o.caught for o in harmful),
            "rmse_accepted": float(np.mean(rmse)) if rmse else None,
            "codes": sorted(set(codes), key=lambda code: (-codes.count(code), code)),
        }


def phones_left_out(path: Path) -> tuple[dict[str, Floats], dict[str, Basis]]:
    """As `left_out`, of phones: by maker the basis learned from the others' phones."""
    nodes = read_curves(path)
    makers = {name: maker_of(name) for name in nodes}
    bases = {
        maker: taught(nodes, [name for name in nodes if makers[name] != maker], HANDFUL, PHONES)
        for maker in sorted(set(makers.values()))
    }
    return {name: interpolate(curves) for name, curves in nodes.items()}, bases


# captures


def stage(number: int, name: str, camera: Floats, lamp: str) -> Staged:
    """A good capture: all that may differ between good captures is drawn from its number."""
    rng = np.random.default_rng([77, number])
    light = read_lamp(lamp)
    smooth = interpolate(smooth_errors(LAMP_CORRELATION))
    ripple = np.exp(0.02 * (smooth @ rng.normal(size=smooth.shape[1])))
    scene = Scene(
        size=SIZE,
        fill=0.55,
        rotation=float(rng.uniform(-6, 6)),
        tilt=float(rng.uniform(-8, 8)),
        vignetting=float(rng.uniform(0, 0.4)),
    )
    sensor = Sensor(exposure=float(rng.uniform(0.6, 0.85)), full_well=float(rng.choice([5000.0, 20000.0])))
    curves = camera * np.array([rng.uniform(0.4, 0.9), 1.0, rng.uniform(0.5, 0.9)])
    body = CameraCurves(name, curves, "measured")
    plan = ShotPlan(
        body, replace(light, values=light.values * ripple), real_chart(number, rng), scene, sensor, lamp, TABLE,
        white_level=float(np.exp(0.01 * rng.normal())),
    )  # fmt: skip
    return Staged(plan, number, maker_of(name))


def real_chart(number: int, rng: np.random.Generator) -> ChartTable:
    """The chart in the photo: the table's own, Ohta's, or two drawn from the tolerance."""
    table = read_chart("classic24")
    if number % 4 == 0:
        return table
    if number % 4 == 1:
        return replace(read_chart("classic24:ohta"), name="classic24")
    long, short = (interpolate(smooth_errors(length)) for length in (CHART_CORRELATION, TABLE_CORRELATION))
    u, v, w = (rng.normal(size=(24, curves.shape[1])) @ curves.T for curves in (long, short, short))
    edge = EDGE * np.gradient(table.values, STEP, axis=1)
    off = table.tolerance[:, None] * (RELATIVE * table.values * u + ABSOLUTE * v + edge * w)
    return table.with_values(np.clip(table.values + off, 0.004, 1.1))


def mosaic(plan: ShotPlan, frames: dict[str, Any], role: str, frame: str, number: int) -> Mosaic:
    """A frame as `read_dng` would give it."""
    tags = plan.file_tags(frame)
    camera = plan.camera.values * np.array(plan.sensor.gains)
    return Mosaic(
        path=role, samples=frames[frame], cfa=tags.cfa, black=np.full((2, 2), tags.black),
        white=float(tags.white_level), make="", model=plan.camera.name, exposure=tags.exposure, iso=tags.iso,
        orientation=1, gain_maps=(), color_matrix1=None, color_matrix2=None, as_shot_neutral=None,
        sha256=sha256(frames[frame].tobytes()).hexdigest(),
        colour_matrices=makers_matrices(camera, number),
    )  # fmt: skip


def shoot(staged: Staged, plan: ShotPlan, *, search: bool) -> MeasuredShot:
    """Take it and measure it; refusals of the stages leave as errors."""
    taken = take(plan, (staged.number,))
    frames = {"chart": taken.chart, "white": taken.white, "dark": taken.dark}
    photos = {
        role: None if frame is None else mosaic(plan, frames, role, frame, staged.number)
        for role, frame in plan.handed_in.items()
    }
    chart, stated = photos["chart"], read_chart(plan.stated_chart)
    assert chart is not None
    if search:
        pose = find_chart(chart, stated)
    else:
        true = true_pose(plan.scene)
        pitch = np.ptp(true.corners[:, 0]) / 6
        off = np.random.default_rng([5, staged.number]).normal(0, 0.01 * pitch, 2)
        pose = Pose(true.layout, true.corners + off, true.patches + off, 0, "detected", 1.0, ())
    means = measure_patches(chart, pose, white=photos["white"], dark=photos["dark"])
    if not search:
        score = agreement(np.maximum(means.chart.mean - means.black, 0.0), plain_signals(stated))
        pose = replace(pose, score=max(score, 0.0))
    facts = {role: None if photo is None else photo_of(photo) for role, photo in photos.items()}
    assert facts["chart"] is not None
    lamp = read_lamp(plan.stated_lamp)
    return MeasuredShot(lamp, facts["chart"], facts["white"], facts["dark"], pose, means, None)


def solved(shots: Sequence[MeasuredShot], basis: Basis, camera: Floats) -> Outcome:
    """Status, codes, RMSE and coverage; the curves of a refused verdict are judged all the same."""
    capture, options = Capture(tuple(shots), read_chart(TABLE), None), Options(engine="reference")
    with standing_in(basis):
        try:
            done = solve(capture, options=options)
            verdict, ssf = done.verdict, done.ssf
        except CalibrationError as error:
            if not error.reasons:
                return Outcome("refused", (error.code,), None, None, (error.message,), error.key)
            verdict = Verdict("refused", error.reasons)
            fit = prepare_fit(capture, options)
            ssf = recover_fit(fit, fit.signals.used, None)
    curves, std = ssf.peak()
    off = curves - camera / camera.max(axis=0)
    assert std is not None
    return Outcome(
        verdict.status,
        tuple(reason.code for reason in verdict.reasons),
        float(np.sqrt(np.mean(off[SEEN] ** 2, axis=0)).mean()),
        float((np.abs(off) <= 1.96 * std)[SEEN].mean()),
        tuple(reason.message for reason in verdict.reasons),
        next((reason.key for reason in verdict.reasons), ""),
    )


def tried(shoot_it: Callable[[], Sequence[MeasuredShot]], basis: Basis, camera: Floats) -> Outcome:
    """An outcome whatever stage refuses."""
    try:
        shots = shoot_it()
    except CalibrationError as error:
        return Outcome("refused", (error.code,), None, None, (error.message,), error.key)
    return solved(shots, basis, camera)


# sections


def clean_and_faulty(
    cameras: dict[str, Floats],
    bases: dict[str, Basis],
    half: str,
    captures: int,
    clean: int,
    advance: Callable[[], None],
) -> tuple[list[tuple[Staged, Outcome]], dict[str, list[Tally]]]:
    """The good captures, and every fault in every severity on some of them."""
    names = [name for name in cameras if (maker_of(name) in TUNE) == (half == "tune")]
    good = []
    for number in range(clean):
        name = names[number % len(names)]
        staged = stage(number, name, cameras[name], LAMPS[(number // len(names) * 3 + number) % len(LAMPS)])
        shot = partial_shot(staged, staged.setup, search=False)
        good.append((staged, tried(shot, bases[staged.maker], staged.setup.camera.values)))
        advance()
    tallies: dict[str, list[Tally]] = {}
    for f, name in enumerate(FAULTS):
        tallies[name] = []
        for severity in SEVERITIES:
            tally = Tally()
            for j in range(captures):
                staged, known = good[(37 * f + 13 * severity + 29 * j) % clean]
                setup = apply_fault(name, severity)(staged.setup)
                shot = partial_shot(staged, setup, search=name in SEARCHED)
                tally.outcomes.append(tried(shot, bases[staged.maker], staged.setup.camera.values))
                assert known.rmse is not None
                tally.unspoilt.append(known.rmse)
                advance()
            tallies[name].append(tally)
    return good, tallies


def partial_shot(staged: Staged, plan: ShotPlan, *, search: bool) -> Callable[[], Sequence[MeasuredShot]]:
    return lambda: [shoot(staged, plan, search=search)]


OF_LAMPS = ("wrong-lamp", "two-lamps", "wall")
"""Faults that the file's colour matrix betrays."""


SAID = {
    "patch": ("chart_unfit.patch", "chart_unfit.dirt"),
    "offset": (
        "glare.gloss", "glare.veil", "glare.darkest_patch", "frames_differ.bright_dark", "frames_differ.black",
    ),
    "white or ceiling": ("frames_differ.white", "overexposed.patches"),
    "uneven": ("uneven_light.light", "uneven_light.lights"),
    "tone": ("not_sensor_raw.tone",),
    "processed": tuple(f"not_sensor_raw.{how}" for how in ("mixed", "demosaiced", "smoothed", "smooth")),
    "light": ("lamp_unfit.rival", "lamp_unfit.tint"),
    "table": ("chart_unfit.table", "chart_unfit.faded"),
    "camera": ("camera_unusual.stranger", "camera_unusual.improbable_curves", "camera_unusual.lamp_residual"),
}  # fmt: skip
"""Groups of causes by the keys of their messages."""


def confusion(tallies: dict[str, list[Tally]]) -> dict[str, Any]:
    """Of what was caught at severities 2 and 3 and has curves: the group of the fault, and of the first reason."""
    group_of = {key: group for group, keys in SAID.items() for key in keys}
    counts: dict[str, dict[str, int]] = {group: {} for group in SAID}
    shares, blamed, others = [], 0, 0
    for name, each in tallies.items():
        right = FAULTS[name].groups
        firsts = [o.first for tally in each[1:] for o in tally.outcomes if o.caught and o.rmse is not None]
        said = [group_of.get(key, "none of them") for key in firsts]
        if not right or not said:
            continue
        for group in said:
            counts[right[0]][group] = counts[right[0]].get(group, 0) + 1
        shares.append(float(np.mean([group in right for group in said])))
        if "light" not in right:
            blamed, others = blamed + said.count("light"), others + len(said)
    return {"counts": counts, "right": float(np.mean(shares)), "light_blamed": blamed, "not_light": others}


def without_matrix(
    good: Sequence[tuple[Staged, Outcome]], bases: dict[str, Basis], captures: int, advance: Callable[[], None]
) -> dict[str, Any]:
    """Wrong lamps in photos whose file has no colour matrix: the other rules must do."""
    found: dict[str, Any] = {}
    for f, name in enumerate(OF_LAMPS):
        for severity in (2, 3):
            tally = Tally()
            for j in range(captures):
                staged, known = good[(41 * f + 17 * severity + 23 * j) % len(good)]
                setup = apply_fault(name, severity)(staged.setup)

                def shots(staged: Staged = staged, plan: ShotPlan = setup) -> list[MeasuredShot]:
                    shot = shoot(staged, plan, search=False)
                    return [replace(shot, photo=replace(shot.photo, colour_matrices=()))]

                tally.outcomes.append(tried(shots, bases[staged.maker], staged.setup.camera.values))
                assert known.rmse is not None
                tally.unspoilt.append(known.rmse)
                advance()
            found[f"{name} {severity}"] = tally.row()
    return found


PAIR = ("D55", "A")
OF_TWO = ("wrong-lamp", "two-lamps", "white-lamp", "white-level", "glare", "shadow", "dark-leak")
"""Faults of one of two shots."""


def two_shots(
    cameras: dict[str, Floats], bases: dict[str, Basis], names: Sequence[str], advance: Callable[[], None]
) -> dict[str, Any]:
    """Daylight and bulb; one of the two spoilt, severity 3: is it caught, and is the right shot alone named?

    The light does not drift between chart and white frame, but in `drifting`: it bends the curves of two shots.
    """
    good, drifting, spoilt = [], [], {name: [] for name in OF_TWO}  # type: Any
    for number, name in enumerate(names):
        first, second = (stage(1000 + 2 * number + s, name, cameras[name], lamp) for s, lamp in enumerate(PAIR))
        second = replace(second, setup=replace(second.setup, table=first.setup.table))  # one chart
        camera, basis = cameras[name], bases[first.maker]
        second = replace(second, setup=replace(second.setup, camera=first.setup.camera))
        pair = [first, second]
        drifting.append(solved([shoot(each, each.setup, search=False) for each in pair], basis, camera))
        pair = [replace(each, setup=replace(each.setup, white_level=1.0)) for each in pair]
        shots = [shoot(each, each.setup, search=False) for each in pair]
        known = solved(shots, basis, camera)
        good.append(known)
        advance()
        for fault in OF_TWO:
            which = (number + OF_TWO.index(fault)) % 2
            setup = apply_fault(fault, 3)(pair[which].setup)
            bad = tried_pair(pair, which, setup, shots, basis, camera)
            words = " ".join(bad.words)
            assert known.rmse is not None
            harm = None if bad.rmse is None else bad.rmse - known.rmse
            spoilt[fault].append((harm, bad.caught, f"hot {which + 1}" in words, f"hot {2 - which}" in words))
            advance()
    return {
        "clean": len(good),
        "clean_caught": sum(o.caught for o in good),
        "rmse": float(np.mean([o.rmse for o in good])),
        "coverage": float(np.mean([o.covered for o in good if not o.caught])),
        "drifting_caught": sum(o.caught for o in drifting),
        "drifting_rmse": float(np.mean([o.rmse for o in drifting if o.rmse is not None])),
        "faults": {
            fault: {
                "captures": len(rows),
                "harmful": sum(h is not None and h > HARM for h, *_ in rows),
                "harmful_caught": sum(h is not None and h > HARM and c for h, c, *_ in rows),
                "caught": sum(c for _, c, *_ in rows),
                "named": sum(right and not wrong for _, _, right, wrong in rows),
            }
            for fault, rows in spoilt.items()
        },
    }


def tried_pair(
    pair: Sequence[Staged], which: int, plan: ShotPlan, shots: Sequence[MeasuredShot], basis: Basis, camera: Floats
) -> Outcome:
    """The pair with one shot taken again, spoilt."""

    def again() -> list[MeasuredShot]:
        return [shoot(pair[j], plan, search=False) if j == which else shots[j] for j in range(2)]

    return tried(again, basis, camera)


def field_mode(
    cameras: dict[str, Floats], bases: dict[str, Basis], names: Sequence[str], advance: Callable[[], None]
) -> dict[str, Any]:
    """No white, no dark frame, the lamp by its kind alone: what is accepted, and do its bands hold?"""
    found: dict[str, list[Outcome]] = {"known lamp, all frames": [], "in the field": []}
    for number, name in enumerate(names):
        bulb = number % 3 == 2
        kelvin = np.random.default_rng([11, number]).normal(2700 if bulb else 5800, 250 if bulb else 900)
        lamp = f"{max(kelvin, 1500):.0f}K" if bulb else f"D:{min(max(kelvin, 4100), 9000):.0f}"
        staged = stage(2000 + number, name, cameras[name], lamp)
        setup = staged.setup
        setup = replace(setup, scene=replace(setup.scene, vignetting=0.4 * setup.scene.vignetting))
        for words, each in (
            ("known lamp, all frames", setup),
            ("in the field", replace(setup, stated_lamp="bulb" if bulb else "daylight",
                                     handed_in={"chart": "chart", "white": None, "dark": None})),
        ):  # fmt: skip
            shot = partial_shot(staged, each, search=False)
            found[words].append(tried(shot, bases[staged.maker], cameras[name]))
            advance()
    return {
        words: {
            "captures": len(rows),
            "accepted": sum(not o.caught for o in rows),
            "refused": sum(o.status == "refused" for o in rows),
            "rmse": float(np.mean([o.rmse for o in rows if not o.caught])),
            "coverage": float(np.mean([o.covered for o in rows if not o.caught])),
        }
        for words, rows in found.items()
    }


def through_files(
    good: Sequence[tuple[Staged, Outcome]], bases: dict[str, Basis], advance: Callable[[], None]
) -> dict[str, Any]:
    """Severity 2 of every fault, and a good capture, through real DNG files and the whole of `calibrate`."""
    same, statuses = 0, {}
    for f, name in enumerate(("clean", *FAULTS)):
        staged = good[(17 * f) % len(good)][0]
        basis, setup = bases[staged.maker], staged.setup
        change = None if name == "clean" else apply_fault(name, 2)
        spoilt = setup if change is None else change(setup)
        memory = tried(partial_shot(staged, spoilt, search=True), basis, setup.camera.values)
        with tempfile.TemporaryDirectory() as folder:
            done = simulate(
                setup.camera, replace(setup.lamp, name=setup.stated_lamp), folder, chart=setup.table,
                scene=setup.scene, sensor=setup.sensor, seed=staged.number, change=change,
            )  # fmt: skip
            shot = done.shots[0]
            try:
                with standing_in(basis):
                    result = from_files(shot.shot, options=Options(engine="reference"))
                status = result.verdict.status
            except CalibrationError:
                status = "refused"
        same += status == memory.status
        statuses[name] = [memory.status, status]
        advance()
    return {"captures": len(statuses), "same": same, "differ": {n: s for n, s in statuses.items() if s[0] != s[1]}}


def bars(found: dict[str, Any]) -> list[dict[str, Any]]:
    """The issue's bars, with their values."""
    rows = found["faults"]
    made = []

    def add(name: str, value: float, limit: float, *, least: bool) -> None:
        made.append({"bar": name, "value": value, "limit": limit, "at_least": least,
                     "met": bool(value >= limit if least else value <= limit)})  # fmt: skip

    causes = found["causes"]
    add("the right cause comes first, mean of the faults", causes["right"], 0.75, least=True)
    add("light blamed for another fault", causes["light_blamed"] / max(causes["not_light"], 1), 0.05, least=False)
    for severity, limit in ((2, 0.90), (3, 0.99)):
        harmful = sum(row[severity - 1]["harmful"] for row in rows.values())
        caught = sum(row[severity - 1]["harmful_caught"] for row in rows.values())
        add(f"severity {severity}: harmful caught", caught / max(harmful, 1), limit, least=True)
    clean = found["clean"]
    add("clean captures refused", clean["refused"] / clean["captures"], 0.01, least=False)
    add("clean captures doubtful or refused", 1 - clean["accepted"] / clean["captures"], 0.05, least=False)
    add("coverage of the bands on all that was accepted", found["coverage"], 0.90, least=True)
    add("coverage in the field", found["field"]["in the field"]["coverage"], 0.90, least=True)
    return made


def main(arguments: Sequence[str] | None = None) -> int:
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("--quick", action="store_true", help="two captures a fault instead of eight")
    parser.add_argument("--half", choices=("tune", "report"), default="report", help="which makers' cameras")
    parser.add_argument("--phones", type=Path, help="measured phones, CSV: these instead of the cameras")
    options = parser.parse_args(arguments)
    captures, clean, pairs = (2, 26, 4) if options.quick else (8, 208, 13)
    cameras, bases = phones_left_out(options.phones) if options.phones else left_out()
    half = "report" if options.phones else options.half
    names = [name for name in cameras if (maker_of(name) in TUNE) == (half == "tune")]
    out = console()
    total = (
        clean
        + captures * (3 * len(FAULTS) + 2 * len(OF_LAMPS))
        + pairs * (1 + len(OF_TWO))
        + 2 * len(names)
        + 1
        + len(FAULTS)
    )
    with progress() as bar:
        task = bar.add_task("captures", total=total)

        def advance() -> None:
            bar.advance(task)

        good, tallies = clean_and_faulty(cameras, bases, half, captures, clean, advance)
        pair = two_shots(cameras, bases, names[:: max(1, len(names) // pairs)][:pairs], advance)
        outdoors = field_mode(cameras, bases, names, advance)
        files = through_files(good, bases, advance)
        bare = without_matrix(good, bases, captures, advance)
    outcomes = [o for _, o in good]
    accepted = [o.covered for o in outcomes if not o.caught]
    accepted += [o.covered for each in tallies.values() for t in each for o in t.outcomes if not o.caught]
    found: dict[str, Any] = {
        "half": half,
        "cameras": len(names),
        "captures_a_fault_and_severity": captures,
        "clean": {
            "captures": len(outcomes),
            "accepted": sum(not o.caught for o in outcomes),
            "doubtful": sum(o.status == "doubtful" for o in outcomes),
            "refused": sum(o.status == "refused" for o in outcomes),
            "rmse": float(np.mean([o.rmse for o in outcomes if o.rmse is not None])),
            "reasons": [o.words[0] for o in outcomes if o.caught],
        },
        "coverage": float(np.mean([c for c in accepted if c is not None])),
        "faults": {name: [tally.row() for tally in each] for name, each in tallies.items()},
        "causes": confusion(tallies),
        "without_matrix": bare,
        "two_shots": pair,
        "field": outdoors,
        "files": files,
    }
    found["bars"] = bars(found)
    show(found, out)
    name = "faults" if half == "report" and not options.quick else f"faults-{half}"
    name = "faults-phones" if options.phones else name
    out.print(save(name, found | {"versions": versions("scipy", "colour-science")}))
    return 0 if all(each["met"] for each in found["bars"]) else 1


def show(found: dict[str, Any], out: Any) -> None:
    """The tables."""
    rows = []
    for name, each in found["faults"].items():
        for severity, row in enumerate(each, 1):
            rmse = row["rmse_accepted"]
            rows.append([
                name if severity == 1 else "", FAULTS[name].degrees[severity - 1], row["refused"], row["doubtful"],
                row["accepted"] - row["missed"], row["missed"],
                f"{row['harmful_caught']} of {row['harmful']}", "" if rmse is None else f"{rmse:.3f}",
                ", ".join(row["codes"][:3]),
            ])  # fmt: skip
    head = [
        "fault",
        "severity",
        "refused",
        "doubtful",
        "harmless",
        "missed",
        "harmful caught",
        "RMSE accepted",
        "codes",
    ]
    out.print(table(f"Faults, {found['cameras']} cameras", head, rows))
    clean = found["clean"]
    out.print(
        f"clean: {clean['captures']} captures, {clean['accepted']} accepted, {clean['doubtful']} doubtful, "
        f"{clean['refused']} refused, RMSE {clean['rmse']:.3f}; bands of all accepted cover {found['coverage']:.1%}"
    )
    for words in clean["reasons"]:
        out.print(f"  {words}")
    pair = found["two_shots"]
    out.print(
        table(
            f"One of two shots spoilt, severity 3; of {pair['clean']} clean pairs {pair['clean_caught']} doubted, "
            f"RMSE {pair['rmse']:.3f}; with 1 % drift {pair['drifting_caught']}, {pair['drifting_rmse']:.3f}",
            ["fault", "captures", "caught", "harmful caught", "right shot named"],
            [
                [name, row["captures"], row["caught"], f"{row['harmful_caught']} of {row['harmful']}", row["named"]]
                for name, row in pair["faults"].items()
            ],
        )
    )
    out.print(
        table(
            "In the field",
            ["capture", "captures", "accepted", "refused", "RMSE", "coverage"],
            [
                [
                    name,
                    row["captures"],
                    row["accepted"],
                    row["refused"],
                    f"{row['rmse']:.3f}",
                    f"{row['coverage']:.3f}",
                ]
                for name, row in found["field"].items()
            ],
        )
    )
    out.print(
        table(
            "Without a colour matrix in the file",
            ["fault, severity", "captures", "harmful caught"],
            [
                [name, row["captures"], f"{row['harmful_caught']} of {row['harmful']}"]
                for name, row in found["without_matrix"].items()
            ],
        )
    )
    files = found["files"]
    out.print(f"through DNG files: {files['same']} of {files['captures']} verdicts as in memory; {files['differ']}")
    out.print(
        table(
            "Bars",
            ["bar", "value", "limit", "verdict"],
            [
                [b["bar"], f"{b['value']:.4f}", f"{'≥' if b['at_least'] else '≤'} {b['limit']:.2f}",
                 "met" if b["met"] else "MISSED"]
                for b in found["bars"]
            ],
        )
    )  # fmt: skip


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
