"""Is the right one of the chart's public tables chosen?

The chart in the photo is BabelColor's, one drawn from the tolerance of that table, Ohta's, or one as far from Ohta's
as half of such a draw; each is solved by `classic24`, which leaves the table open, and by `classic24:babelcolor`. One
photo with white and dark frame under five lamps, named and not, noise hypot(0.1 %, 0.0002). Cameras (every eighth of
the 52, maker left out; the lamp always named), and measured phones, each with bases of the others. RMSE of
peak-normalised curves, 400 to 700 nm, and coverage of the 95 % bands. Bar: the right table in 99 of 100 captures.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.captures import OPTIONS as PRODUCT
from benchmarks.captures import capture, power, unnamed
from benchmarks.claim import Run
from benchmarks.claims.strangers import LAMPS, known_of
from benchmarks.devices import CAMERAS, OTHERS, Device, measured_cameras, phones_left_out, scored
from benchmarks.shared import TABLE, standing_in
from benchmarks.staged import real_chart
from camssf.fit.capture_fit import prepare_fit
from camssf.fit.solutions import likeliest_table, recover_fit
from camssf.grid import Floats
from camssf.photo.capture import Capture
from camssf.recovery.basis import Basis
from camssf.recovery.sensitivity import Ssf
from camssf.spectra import read_chart, read_lamp
from camssf_lab.learning.training import read_curves

OHTA = read_chart("classic24:ohta")


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
    fit = prepare_fit(photo, PRODUCT)
    ssf = recover_fit(fit, fit.signals.used, None)
    return ssf, replace(photo, chart=likeliest_table(fit, ssf))


def claim(run: Run) -> None:
    """A row a chart and way of telling the lamp."""
    devices: list[tuple[Device, tuple[Basis, ...], bool]] = [
        (camera, (camera.known_by(CAMERAS),), False) for camera in measured_cameras()[::8]
    ]
    nodes = read_curves(run.named("phones")) if run.options.phones else {}
    for phone in phones_left_out(nodes) if nodes else ():
        devices.append((phone, known_of(phone, OTHERS, nodes), True))
    kept: dict[tuple[str, str], list[tuple[float, ...]]] = {}
    for number, (device, known, is_phone) in enumerate(run.track(devices, "tables")):
        with standing_in(*known):
            for at, lamp in enumerate(LAMPS):
                seed = 100 * number + at
                lights = {"named": read_lamp(lamp)} | ({"not named": unnamed(lamp)} if is_phone else {})  # type: ignore[dict-item]
                for word, light in lights.items():
                    for name, (chart, ohta) in charts(seed).items():
                        told = device, {lamp: power(lamp)}, [light], device.maker, seed, chart
                        plain, chosen = solved(capture(*told, "classic24"))
                        right = (chosen.chart.table == OHTA.table) == ohta
                        best = plain if chosen.chart.table != OHTA.table else solved(chosen)[0]
                        row = float(right), *scored(plain.peak(), device.curves), *scored(best.peak(), device.curves)
                        kept.setdefault((name, word), []).append(row)
    columns = {"chart in the photo": "", "lamp": "", "captures": "d", "right table": ".3f"}
    columns |= {"BabelColor's: RMSE": ".4f", "its coverage": ".3f", "left open: RMSE": ".4f", "coverage": ".3f"}
    rows = [(*key, len(own), *np.mean(own, axis=0)) for key, own in kept.items()]
    run.table("The chart's table", columns, rows)
    for name, word, _, right, *_ in rows:
        run.bar(f"{name}, {word}: right table", right, least=0.99)
