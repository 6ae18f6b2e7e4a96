"""Is the right one of the chart's public tables chosen? `python -m benchmarks.claims.chart_tables [--phones CSV]`

The chart in the photo is BabelColor's, one drawn from the tolerance of that table, Ohta's, or one as far from Ohta's
as half of such a draw; each is solved by `classic24`, which leaves the table open, and by `classic24:babelcolor`. One
photo with white and dark frame under five lamps, named and not, noise hypot(0.1 %, 0.0002). Cameras (every eighth of
the 52, maker left out; the lamp always named), and with `--phones` (or CAMSSF_PHONES) measured phones, each with
bases of the others. RMSE of peak-normalised curves, 400 to 700 nm, and coverage of the 95 % bands. Exit status 1
where another table than the right one is chosen in more than 1 of 100 captures.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from benchmarks.claims.accuracy import SEEN
from benchmarks.claims.any_light import capture, power, unnamed
from benchmarks.claims.faults import real_chart
from benchmarks.claims.phones import CAMERAS, OTHERS, Device, measured_cameras, phones_left_out
from benchmarks.claims.strangers import LAMPS, ryyb
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
from camssf.fit.capture_fit import prepare_fit
from camssf.fit.solutions import likeliest_table, recover_fit
from camssf.grid import Floats
from camssf.options import Options
from camssf.photo.capture import Capture
from camssf.recovery.basis import Basis
from camssf.recovery.sensitivity import Ssf
from camssf.spectra import read_chart, read_lamp
from camssf_lab.learning.training import maker_of, read_curves

OHTA = read_chart("classic24:ohta")
OPTIONS = Options(engine="reference")


def charts(number: int) -> dict[str, tuple[Floats, bool]]:
    """Reflectances of the chart in the photo, and whether Ohta's table is the right one."""
    average = read_chart(TABLE).values
    drawn = real_chart(2, np.random.default_rng(number)).values
    return {
        "BabelColor's": (average, False),
        "drawn about BabelColor's": (drawn, False),
        "Ohta's": (OHTA.values, True),
        "drawn about Ohta's": (OHTA.values + (drawn - average) / 2.0, True),
    }


def solved(photo: Capture) -> tuple[Ssf, Capture]:
    """The answer, and the capture with the table of the chart that the signals speak for."""
    fit = prepare_fit(photo, OPTIONS)
    ssf = recover_fit(fit, fit.signals.used, None)
    return ssf, replace(photo, chart=likeliest_table(fit, ssf))


def error(ssf: Ssf, device: Device) -> tuple[float, float]:
    """RMSE of the curves, and coverage of their bands."""
    curves, std = ssf.peak()
    assert std is not None  # every family has bands
    off = (curves - device.curves / device.curves.max(axis=0))[SEEN]
    return float(np.sqrt(np.mean(off**2, axis=0)).mean()), float((np.abs(off) <= 1.96 * std[SEEN]).mean())


def main(arguments: Sequence[str] | None = None) -> int:
    parser = command_parser(__spec__, __doc__)
    take_tables(parser, "phones")
    options = parser.parse_args(arguments)
    devices: list[tuple[Device, tuple[Basis, ...], bool]] = [
        (camera, (replace(camera.bases[CAMERAS], name="cameras"),), False) for camera in measured_cameras()[::8]
    ]
    nodes = read_curves(options.phones) if options.phones else {}
    for each in phones_left_out(nodes) if nodes else ():
        others = {name: curves for name, curves in nodes.items() if name != each.name}
        devices.append((each, (replace(each.bases[OTHERS], name="phones"), ryyb(others)), True))
    found: dict[tuple[str, str], list[tuple[float, ...]]] = {}
    with progress() as bar:
        for number, (device, known, phone) in enumerate(bar.track(devices, description="tables")):
            with standing_in(*known):
                for at, lamp in enumerate(LAMPS):
                    seed = 100 * number + at
                    for light, word in (
                        (read_lamp(lamp), "named"),
                        *(((unnamed(lamp), "not named"),) if phone else ()),
                    ):
                        for name, (chart, ohta) in charts(seed).items():
                            given = device, {lamp: power(lamp)}, [light], maker_of(device.name), seed, chart
                            plain, chosen = solved(capture(*given, "classic24"))
                            right = (chosen.chart.table == OHTA.table) == ohta
                            best = plain if chosen.chart.table != OHTA.table else solved(chosen)[0]
                            row = right, *error(plain, device), *error(best, device)
                            found.setdefault((name, word), []).append(tuple(float(value) for value in row))
    means = {key: np.mean(rows, axis=0) for key, rows in found.items()}
    lines = [
        (*key, len(found[key]), f"{right:.3f}", f"{fixed:.4f}", f"{held:.3f}", f"{open_:.4f}", f"{held_:.3f}")
        for key, (right, fixed, held, open_, held_) in means.items()
    ]
    head = ("chart in the photo", "lamp", "captures", "right table", "BabelColor's: RMSE", "coverage")
    console().print(table("The chart's table", (*head, "left open: RMSE", "coverage"), lines))
    missed = count_missed(
        [(f"{name}, {word}: right table", mean[0], 0.99, 1.0) for (name, word), mean in means.items()]
    )
    document = {" ".join(key): list(map(float, mean)) for key, mean in means.items()}
    print(f"written: {save('chart_tables', document | {'versions': versions('scipy')})}")
    return int(missed > 0)


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
