"""What do curves cost where nobody names the light? `python -m benchmarks.claims.any_light --phones phones.csv`

Each capture is solved and judged as `camssf calibrate` does it: with the lamp named (`named`), with `--lamp auto`
(`auto`), and with `--lamp auto` where the file has two colour matrices, as a maker might have made them (`matrices`:
fitted by least squares to Munsell colours under A and D65, then each multiplied by I + 3 % noise, so that their
whites are off). One shot with white and dark frame, Ohta's chart given as BabelColor's, noise hypot(0.1 %, 0.0002);
then two shots and three, none of them named.

The ordinary lights: daylight of 4,800 to 10,000 K, bulbs of 2,500 to 3,000 K, LED-B1 to B5, BH1 and V1, FL2, FL7 and
FL11 (a CIE lamp is taken out of the table of its kind first), and lights that no kind was made from: sky of 12,000
and 20,000 K, daylight under a tree, and lamps that others measured (colour-science's SDS_LIGHT_SOURCES). Then lights
that are of no kind: two lamps at once, half of the luminance from each, and the white of measured displays
(colour-science's MSDS_DISPLAY_PRIMARIES).

Phones are solved with a basis of the other phones, and with one of the other makers' phones; cameras with their maker
left out, every sixth of the 52; another laboratory's cameras with both bases as shipped, each with the file's maker
named, and without. `--phones` (CAMSSF_PHONES) and `--foreign` (CAMSSF_FOREIGN) name the tables that may not be passed
on, as in benchmarks.claims.phones; without them cameras alone are judged. RMSE of peak-normalised curves and coverage
of the 95 % bands, 400 to 700 nm, of all captures, refused ones too. Exit status 1 where a bar is missed.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.claims.accuracy import LOW, SEEN
from benchmarks.claims.phones import OTHER_MAKER, OTHERS, Device
from benchmarks.claims.wrong_lamps import populations, stands_in
from benchmarks.problems import MATRIX_ERROR, in_roles, makers_matrices
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
from camssf.calibration import solve
from camssf.errors import CalibrationError
from camssf.fit.capture_fit import prepare_fit
from camssf.fit.solutions import recover_fit
from camssf.grid import WAVELENGTHS, Floats
from camssf.options import Options
from camssf.photo.capture import Capture, MeasuredShot, Photo
from camssf.photo.find.pose import Pose
from camssf.photo.patches import FrameMeans, PatchMeans
from camssf.photo.read.colour_matrix import ColourMatrix
from camssf.recovery.basis import Basis, read_basis
from camssf.recovery.sensitivity import Ssf
from camssf.recovery.unnamed_light import temperature
from camssf.spectra import Lamp, Light, Unnamed, read_chart, read_lamp
from camssf.spectra.bundled import observer
from camssf.spectra.families import FAMILIES, LampKind, principal_modes
from camssf.spectra.layouts import LAYOUTS
from camssf.spectra.lights import kind_of, unnamed_light
from camssf.spectra.sampled import colour_science
from camssf_lab.learning.training import maker_of

LAMPS = {
    "daylight": ("D:4800", "D:5500", "D:6500", "D:7500", "D:10000"),
    "bulb": ("2500K", "2700K", "3000K"),
    "white-led": ("LED-B1", "LED-B2", "LED-B3", "LED-B4", "LED-B5", "LED-BH1", "LED-V1"),
    "fluorescent": ("FL2", "FL7", "FL11"),
}
OWN = {
    "daylight": ("D:12000", "D:20000", "under a tree"),
    "bulb": ("60 A/W (Soft White)",),
    "white-led": ("Phosphor LED YAG", "PHOS-4", "Luxeon WW 2880"),
    "fluorescent": ("F32T8/TL841 (Triphosphor)", "F34/CW/RS/EW (Cool White FL)"),
}
"""Lights that no kind was made from."""
KIND_OF = {lamp: kind for kind, lamps in LAMPS.items() for lamp in lamps}
EVERY = KIND_OF | {lamp: kind for kind, lamps in OWN.items() for lamp in lamps}
"""The kind of each light, ordinary ones and own."""
MIXTURES = (
    "D:6500 with 2700K", "D:5500 with LED-B3", "D:12000 with LED-B1", "under a tree with 60 A/W (Soft White)",
    "D:6500 with F32T8/TL841 (Triphosphor)", "2700K with LED-B4", "D:7500 with Luxeon WW 2880", "D:5500 with FL11",
)  # fmt: skip
DISPLAYS = ("Apple Studio Display", "Typical CRT Brainard 1997")
PAIRS = (
    ("D:5500", "2700K"), ("D:6500", "LED-B3"), ("2700K", "LED-B4"), ("D:5500", "FL2"),
    ("D:12000", "Phosphor LED YAG"), ("under a tree", "60 A/W (Soft White)"),
)  # fmt: skip
TRIPLES = (("D:5500", "2700K", "LED-B3"), ("D:12000", "PHOS-4", "FL2"))
NAMED, AUTO, MATRICES = "named", "auto", "matrices"
SOURCES, PRIMARIES = colour_science().SDS_LIGHT_SOURCES, colour_science().MSDS_DISPLAY_PRIMARIES
BLACK, SPAN = 512.0, 15000.0
HARM = 0.06
"""RMSE above which an accepted answer of no phone is a failure."""
FAR = 0.04
"""RMSE of a phone's curves that are hardly better than no photo."""
SURE = 0.9
BINS = (0.05, 0.3, 0.7, 0.95)
"""Of the probability of a kind."""


@dataclass(frozen=True)
class Taken:
    """One capture, solved and judged.

    Attributes:
        device, lamps: whose, and the true lights.
        status: of the verdict. codes: of its reasons.
        rmse, covered: of the curves. blue: covered, of the blue curve alone.
        no_photo: RMSE of the mean phone of the basis, without any photo.
        phone: probability of the basis phones.
        length, lamp_residual: of its `family_test`; None if the lamp was not named.
        kinds: of the first shot's light, by probability; empty where it was named.
        lamp_covered: share of the lamp's band that holds the true one. kelvin: (true, found, one standard deviation).
        band_ratio: of the answer.
    """

    device: str
    lamps: tuple[str, ...]
    status: str
    codes: tuple[str, ...]
    rmse: float
    covered: float
    blue: float
    no_photo: float
    phone: float
    length: float
    lamp_residual: float | None
    kinds: dict[str, float]
    lamp_covered: float | None
    kelvin: tuple[float, float, float] | None
    band_ratio: float | None


def power(lamp: str) -> Floats:
    """(681,) of mean 1."""
    if lamp == "under a tree":  # leaves let green and the near infrared through
        found = read_lamp("D:6000").values * (
            1.0 + 0.35 * np.exp(-0.5 * ((WAVELENGTHS - 550.0) / 35.0) ** 2) + 0.3 * (WAVELENGTHS > 690.0)
        )
    elif " with " in lamp:
        both = np.stack([power(each) for each in lamp.split(" with ")])
        found = (1.0 / (both @ observer("1931")[:, 1])) @ both
    elif lamp in DISPLAYS:
        primaries = PRIMARIES[lamp]
        own = np.stack([np.interp(WAVELENGTHS, primaries.wavelengths, each) for each in primaries.values.T])
        found = np.linalg.solve((own @ observer("1931")).T, read_lamp("D65").values @ observer("1931")) @ own
    elif lamp in SOURCES:
        found = np.interp(WAVELENGTHS, SOURCES[lamp].wavelengths, SOURCES[lamp].values)
    else:
        found = read_lamp(lamp).values
    return np.asarray(found / found.mean())


def unnamed(lamp: str) -> Unnamed:
    """Unnamed light, and of which no table holds this lamp."""
    light, lamps = unnamed_light(), []
    for possible in light.lamps:
        family = FAMILIES[kind_of(possible.name) or ""]
        if isinstance(family, LampKind) and lamp in family.members:
            rest = [read_lamp(member).values for member in family.members if member != lamp]
            mean, modes = principal_modes(rest, family.components)
            possible = replace(possible, values=mean / mean.mean(), modes=modes)
        lamps.append(possible)
    return replace(light, lamps=tuple(lamps))


def frame(signal: Floats, error: Floats) -> FrameMeans:
    """Means of a frame, DN, as `measure_patches` gives them; nothing else is wrong with it."""
    mean, still = BLACK + SPAN * signal, np.zeros_like(signal)
    return FrameMeans(mean, SPAN * error, np.full(mean.shape, 36), still, still, still, mean[:, [1, 1]])


def pose() -> Pose:
    """The chart seen straight."""
    layout, i = LAYOUTS["classic24"], np.arange(24)
    corner = np.stack([i % layout.columns, i // layout.columns], axis=1) * 100.0
    patches = corner[:, None] + np.array([[0, 0], [80, 0], [80, 80], [0, 80]], float)
    return Pose("classic24", patches[[0, 5, 23, 18], [0, 1, 2, 3]], patches, 0, "detected", 0.97, ())


def capture(
    device: Device,
    lamps: Mapping[str, Floats],
    given: Sequence[Light],
    maker: str,
    seed: int,
    chart: Floats | None = None,
    table: str = TABLE,
    matrices: tuple[ColourMatrix, ...] = (),
) -> Capture:
    """A chart under lamps, power (681,) by name, with the named table; by default Ohta's reflectances (24, 681)."""
    chart, shots = read_chart("classic24:ohta").values if chart is None else chart, []
    model = device.name[len(maker) :].strip() if maker else ""
    for number, (lit, light) in enumerate(zip(lamps.values(), given, strict=True)):
        level = lit @ device.curves
        y = ((lit * chart) @ device.curves) / level
        level = level / level.max()
        error = np.hypot(LOW[0] * y, LOW[1])
        noise = error * np.random.default_rng([seed, number]).normal(size=y.shape)
        photo = Photo(f"{number}.dng", 600, 400, 1, None, None, False, maker, model, f"{number:064d}", matrices)
        even = level * np.ones_like(y)
        white, dark = frame(even, 1e-5 * even), frame(np.zeros_like(y), np.zeros_like(y))
        means = PatchMeans(frame(level * (y + noise), level * error), white, dark, np.full(3, BLACK), 16383.0)
        shots.append(MeasuredShot(light, *in_roles(photo), pose(), means, None))
    return Capture(tuple(shots), read_chart(table), None)


def judged(given: Capture, device: Device, lamps: Mapping[str, Floats]) -> Taken:
    """The product's verdict under lamps, power (681,) by name; curves of a refused one are judged all the same."""
    options = Options(engine="reference")
    try:
        done = solve(given, options=options)
        status, codes, ssf = done.verdict.status, tuple(reason.code for reason in done.verdict.reasons), done.ssf
    except CalibrationError as error:
        fit = prepare_fit(given, options)
        status, codes = "refused", tuple(reason.code for reason in error.reasons) or (error.code,)
        ssf = recover_fit(fit, fit.signals.used, None)
    curves, std = ssf.peak()
    assert std is not None  # both bases have bands
    assert ssf.family_test is not None
    off = (curves - device.curves / device.curves.max(axis=0))[SEEN]
    return Taken(
        device.name, tuple(lamps), status, codes, float(np.sqrt(np.mean(off**2, axis=0)).mean()),
        float((np.abs(off) <= 1.96 * std[SEEN]).mean()), float((np.abs(off) <= 1.96 * std[SEEN])[:, 2].mean()),
        no_photo(device),
        sum(weight.probability for weight in ssf.choice if weight.basis == "phones"),
        ssf.family_test.length, ssf.family_test.lamp_residual, *light(ssf, next(iter(lamps.values()))),
        ssf.band_ratio,
    )  # fmt: skip


def no_photo(device: Device) -> float:
    """RMSE of the mean of the basis phones, as it stands in for this device."""
    mean = read_basis("phones").mean.T
    off = (mean / mean.max(axis=0) - device.curves / device.curves.max(axis=0))[SEEN]
    return float(np.sqrt(np.mean(off**2, axis=0)).mean())


def light(ssf: Ssf, true: Floats) -> tuple[dict[str, float], float | None, tuple[float, float, float] | None]:
    """The first shot's light beside the true one."""
    found = ssf.lights[0] if ssf.lights else None
    if found is None:
        return {}, None, None
    held = np.abs(found.power - true)[SEEN] <= 1.96 * found.std[SEEN]
    return found.kinds, float(held.mean()), (float(temperature(true)), found.kelvin, found.kelvin_std)


def of_population(
    devices: Sequence[Device], key: str, pairs: bool, off: float, tell: Callable[[], None]
) -> dict[str, list[Taken]]:
    """By what was given, of all devices and lamps; colour matrices have the relative error `off`."""
    rows: dict[str, list[Taken]] = {}
    every: list[tuple[str, ...]] = [(lamp,) for lamp in (*EVERY, *(MIXTURES + DISPLAYS if pairs else ()))]
    every += PAIRS + TRIPLES if pairs else ()
    for number, device in enumerate(devices):
        basis: Basis = stands_in(device, key)
        with standing_in(basis):
            matrices = makers_matrices(device.curves, number, off)
            for lamps in every:
                maker, seed = maker_of(device.name), 100 * number + len(lamps)
                powers = {lamp: power(lamp) for lamp in lamps}
                known: list[Lamp] = [replace(read_lamp("E"), name=lamp, values=lit) for lamp, lit in powers.items()]
                nobody = [unnamed(lamp) for lamp in lamps]
                ways = {NAMED: (known, maker, ()), AUTO: (nobody, maker, ()), MATRICES: (nobody, maker, matrices)}
                if not pairs:
                    ways |= {f"{AUTO}, no maker": (nobody, "", ())}
                for word, (lights, who, stated) in ways.items():
                    title = word + {1: "", 2: ", two", 3: ", three"}[len(lamps)]
                    title += ", mixtures" if lamps[0] in MIXTURES else ", displays" if lamps[0] in DISPLAYS else ""
                    given = capture(device, powers, lights, who, seed, matrices=stated)
                    rows.setdefault(title, []).append(judged(given, device, powers))
                tell()
    return rows


def _captures(pairs: bool) -> int:
    return len(EVERY) + (len(MIXTURES + DISPLAYS + PAIRS + TRIPLES) if pairs else 0)


def row(taken: Sequence[Taken]) -> dict[str, Any]:
    """Means and counts."""
    rmse, covered = np.array([one.rmse for one in taken]), np.array([one.covered for one in taken])
    by_device = [np.mean([one.covered for one in taken if one.device == name]) for name in {t.device for t in taken}]
    sure = [one for one in taken if one.kinds and max(one.kinds.values()) > SURE]
    kelvin = np.array([one.kelvin for one in taken if one.kelvin is not None]).reshape(-1, 3)
    accepted = [one for one in taken if one.status == "accepted"]
    return {
        "captures": len(taken),
        "rmse": float(rmse.mean()),
        "no_photo": float(np.mean([one.no_photo for one in taken])),
        "better": float(np.mean([one.rmse < one.no_photo for one in taken])),
        "far": float(np.mean(rmse > FAR)),
        "accepted_far": float(np.mean([one.rmse > FAR for one in accepted])) if accepted else None,
        "worst": float(rmse.max()),
        "coverage": float(covered.mean()),
        "worst_coverage": float(min(by_device)),
        "status": {word: sum(one.status == word for one in taken) for word in ("accepted", "doubtful", "refused")},
        "accepted_rmse": float(np.mean([one.rmse for one in accepted])) if accepted else None,
        "accepted_wrong": [f"{one.device}, {' + '.join(one.lamps)}" for one in accepted if one.rmse > HARM],
        "codes": sorted({code for one in taken for code in one.codes}),
        "phone": [float(part) for part in np.quantile([one.phone for one in taken], (0.0, 0.1, 0.5, 0.9, 1.0))],
        "right": float(np.mean([_right(one) for one in taken if one.kinds] or [0.0])),
        "sure": len(sure),
        "sure_right": float(np.mean([_right(one) for one in sure])) if sure else None,
        "reliability": _reliability(taken),
        "band_ratio": [
            [float(one.band_ratio), float(one.rmse), one.status] for one in taken if one.band_ratio is not None
        ],
        "lamp_coverage": _mean([one.lamp_covered for one in taken]),
        "kelvin_off": _mean(list(np.abs(kelvin[:, 1] - kelvin[:, 0]))),
        "kelvin_covered": _mean(list(np.abs(kelvin[:, 1] - kelvin[:, 0]) <= 1.96 * kelvin[:, 2])),
        "lamps": {
            " + ".join(lamps): {
                "rmse": float(np.mean([one.rmse for one in taken if one.lamps == lamps])),
                "kinds": {
                    kind: float(np.mean([one.kinds[kind] for one in taken if one.lamps == lamps]))
                    for kind in (taken[0].kinds or ())
                },
            }
            for lamps in dict.fromkeys(one.lamps for one in taken)
        },
    }


def _reliability(taken: Sequence[Taken]) -> list[tuple[float, float, int]]:
    """Probability of a kind, its share that is right, and their number, in bins of the probability."""
    pairs = np.array([
        (share, kind == EVERY.get(one.lamps[0])) for one in taken for kind, share in one.kinds.items()
    ]).reshape(-1, 2)  # fmt: skip
    bins = np.digitize(pairs[:, 0], BINS)
    own = [pairs[bins == i] for i in range(len(BINS) + 1)]
    return [(float(each[:, 0].mean()), float(each[:, 1].mean()), len(each)) for each in own if len(each)]


def _right(one: Taken) -> bool:
    return max(one.kinds, key=lambda kind: one.kinds[kind]) == EVERY.get(one.lamps[0])


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def bars(document: dict[str, dict[str, dict[str, Any]]]) -> list[tuple[str, float, float, float]]:
    """Name, value, least and most that is wanted: issue 16, even light."""
    found: list[tuple[str, float, float, float]] = []
    for title, most, worst in (("phones, basis of the others", 0.030, 0.055), (OTHER, 0.038, 0.065)):
        if title not in document:
            continue
        auto, known = document[title][AUTO], document[title][NAMED]
        found.append((f"{title}: RMSE", auto["rmse"], 0.0, most))
        found.append((f"{title}: worst capture", auto["worst"], 0.0, worst))
        found.append((f"{title}: accepted above {FAR:g}", auto["accepted_far"] or 0.0, 0.0, 0.06))
        if title != OTHER:
            found.append((f"{title}: RMSE over the lamp known", auto["rmse"] / known["rmse"], 0.0, 1.2))
            found.append((f"{title}: coverage", auto["coverage"], 0.94, 0.99))
            found.append((f"{title}: coverage of the worst phone", auto["worst_coverage"], 0.90, 1.0))
            found.append((f"{title}: a kind given 90 % is right", auto["sure_right"], 0.85, 0.95))
    for title, rows in document.items():
        if "camera" in title:
            wrong = sum(len(rows[word]["accepted_wrong"]) for word in (AUTO, f"{AUTO}, no maker"))
            found.append((f"{title}: accepted beyond {HARM:g}", float(wrong), 0.0, 0.0))
    return found


OTHER = "phones, basis of the other maker"


def show(document: dict[str, dict[str, dict[str, Any]]]) -> None:
    """The table."""
    head = [
        "population", "given", "RMSE", "no photo", "better", "above 0.04", "the same, accepted", "worst", "coverage",
        "worst", "accepted, doubtful, refused",
        "wrong and accepted", "kind right", "> 90 %: right", "P(phones) 0 10 50 90 100 %", "lamp, CCT held",
    ]  # fmt: skip
    lines = [
        [
            title, word, f"{one['rmse']:.4f}", f"{one['no_photo']:.4f}", f"{one['better']:.2f}", f"{one['far']:.2f}",
            "" if one["accepted_far"] is None else f"{one['accepted_far']:.2f}", f"{one['worst']:.4f}",
            f"{one['coverage']:.3f}",
            f"{one['worst_coverage']:.3f}", ", ".join(str(count) for count in one["status"].values()),
            len(one["accepted_wrong"]),
            "" if one["lamp_coverage"] is None else f"{one['right']:.2f}",
            "" if one["sure_right"] is None else f"{one['sure_right']:.3f} of {one['sure']}",
            " ".join(f"{part:.2f}" for part in one["phone"]),
            "" if one["lamp_coverage"] is None else f"{one['lamp_coverage']:.3f} {one['kelvin_covered']:.3f}",
        ]
        for title, rows in document.items()
        for word, one in rows.items()
    ]  # fmt: skip
    console().print(table("The light named, and not named", head, lines))


def main(arguments: list[str] | None = None) -> int:
    parser = command_parser(__spec__, __doc__)
    take_tables(parser, "phones", "foreign")
    parser.add_argument("--only", default="", help="populations whose name begins so")
    parser.add_argument(
        "--matrices-off", type=float, default=MATRIX_ERROR, help="relative error of the colour matrices"
    )
    options = parser.parse_args(arguments)
    document: dict[str, dict[str, dict[str, Any]]] = {}
    groups = populations(options.phones, options.foreign)
    with progress() as bar:
        for title, (devices, key) in groups.items():
            if not title.startswith(options.only):
                continue
            pairs = key in (OTHERS, OTHER_MAKER)
            task = bar.add_task(title, total=len(devices) * _captures(pairs))
            rows = of_population(devices, key, pairs, options.matrices_off, lambda task=task: bar.advance(task))  # type: ignore[misc]
            document[title] = {word: row(taken) for word, taken in rows.items()}
    show(document)
    missed = count_missed(bars(document))
    print(f"written: {save('any_light', document | {'versions': versions('scipy')})}")
    return int(missed > 0)


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
