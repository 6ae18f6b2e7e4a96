"""The paper's Sec. 4 and 5 through files: three simulated phones in real DNGs, and a spectrograph's frames."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.paper.spectrograph import MONO, Spectrograph, shoot
from camssf.calibration import calibrate
from camssf.errors import CalibrationError
from camssf.fit.scores import rmse, rmsre, validate
from camssf.grid import WAVELENGTHS, Floats
from camssf.options import Options
from camssf.photo.capture import measure
from camssf.photo.signals import normalise
from camssf.recovery.basis import Basis
from camssf.spectra import CameraCurves, ChartTable, read_chart, read_lamp
from camssf.spectra.layouts import LAYOUTS
from camssf_lab.direct.spectrograph import divide
from camssf_lab.simulation.camera import Sensor
from camssf_lab.simulation.frames import simulate
from camssf_lab.simulation.scene import Scene

PHONES = {
    "Arashi Vision Insta360 X5": "1/1.28 inch, an action camera's: a phone's main sensor",
    "Canon PowerShot S90": "1/1.7 inch, a pocket camera's",
    "Sony DSC-RX100M4": "1 inch, a pocket camera's: the largest that phones have",
}
"""The smallest sensors among the measured cameras. No phone is among them."""
WORLDS: dict[str, dict[str, str]] = {
    "exact": {"chart": "classic24", "lamp": "D55", "tolerance": "0%"},
    "lifelike": {"chart": "classic24:ohta", "lamp": "D:5250", "tolerance": "300K,2%"},
}
"""What lies before the phone; the solver is told classic24 (BabelColor's table) under D55 in both."""
SENSOR = Sensor(black=64.0, white_level=1023, full_well=6000.0, read_noise=3.0)
VIEW = Scene(size=(1800, 1350), vignetting=0.3, tilt=6.0, rotation=3.0, blur=0.8)
"""A phone's raw frame: 10 bits, small wells, a lens that loses a third in the corners, a hand that does not stand."""
INNER = tuple(14 * row + column for row in range(1, 9) for column in range(1, 13))
"""Positions of the 96 colours within an SG's 14 × 10; the rest is its neutral border."""


@cache
def large_chart(colours: bytes) -> ChartTable:
    """A chart of the SG's layout: 96 given colours (96, 681) inside, white, grey and black around."""
    values = np.empty((140, WAVELENGTHS.size))
    values[:] = np.resize([0.9, 0.2, 0.04], 140)[:, None]
    values[list(INNER)] = np.frombuffer(colours).reshape(96, -1)
    names = tuple(f"{chr(65 + i % 14)}{i // 14 + 1}" for i in range(140))
    source = "CIE 224:2017's colours in an SG's layout"
    return ChartTable("sg140", "SG-like", LAYOUTS["sg140"], names, WAVELENGTHS, values, np.full(140, 0.03), 0, source)


def phone(name: str, curves: Floats, basis: Basis, colours: Floats, seed: int) -> dict[str, Any]:
    """One phone in both worlds: calibrated from its chart photo, tested on its photo of 96 other colours.

    Args:
        name: of the camera.
        curves: (681, 3).
        basis: learned without its maker.
        colours: (96, 681).
        seed: of the noise.
    """
    camera = CameraCurves(name, curves, name)
    large = large_chart(np.ascontiguousarray(colours).tobytes())
    found: dict[str, Any] = {"sensor": PHONES[name], "truth": (curves / curves.max(axis=0)).tolist(), "worlds": {}}
    for number, (world, scene) in enumerate(WORLDS.items()):
        light = replace(read_lamp(scene["lamp"]), name="true lamp")
        table = read_chart("classic24")
        if world == "exact":
            table = replace(table, tolerance=np.zeros(24))
        with tempfile.TemporaryDirectory() as aside:
            small, wide = (
                simulate(
                    camera, light, Path(aside, folder), chart=seen, scene=replace(VIEW, fill=fill), sensor=SENSOR,
                    seed=seed + number + later,
                )
                for folder, seen, fill, later in (
                    ("chart", read_chart(scene["chart"]), VIEW.fill, 0), ("large", large, 0.8, 10)
                )
            )  # fmt: skip
            (shot,), (other,) = small.shots, wide.shots
            capture = measure(replace(other.shot, lamp="D55", corners=wide.pose.corners), chart=large)
            signals = normalise([each.means for each in capture.shots], large)
            stated = read_lamp("D55")
            unseen = np.zeros((1, 140), dtype=bool)
            unseen[0, list(INNER)] = True
            world_found: dict[str, Any] = {}
            for method in ("gaussian", "cameras"):
                try:
                    answer = calibrate(
                        replace(shot.shot, lamp="D55", lamp_tolerance=scene["tolerance"]), chart=table,
                        options=Options(
                            basis=basis if method == "cameras" else "gaussian",
                            engine="reference", fit=range(7, 19) if method == "gaussian" else None,
                        ), truth=camera,
                    )  # fmt: skip
                except CalibrationError as error:
                    world_found[method] = {"refused": error.code}
                    continue
                s = answer.ssf.values
                seen_by = answer.ssf.lamp[0]
                predicted = ((large.values * seen_by) @ s) / (seen_by @ s)
                scores = validate(signals, predicted[None], large, [stated], s, camera, unseen)
                floor = ((large.values * light.values) @ curves) / (light.values @ curves)
                noise = rmsre(signals.values, floor[None], unseen)
                world_found[method] = {
                    "rmse": rmse(s, curves).tolist(),
                    "rmsre_percent": scores.rmsre_percent.tolist(),
                    "truth_rmsre_percent": noise.tolist(),
                    "delta_e00": scores.delta_e00,
                    "verdict": answer.verdict.status,
                    "curves": answer.ssf.peak()[0].tolist(),
                    "std": None if answer.ssf.std is None else np.asarray(answer.ssf.peak()[1]).tolist(),
                }
            found["worlds"][world] = world_found
    return found


def spectrograph(name: str, curves: Floats, light: str, seed: int) -> dict[str, Any]:
    """One camera before the simulated spectrograph: RMSE, and the largest error of each frame's wavelengths, nm."""
    device, mono = Spectrograph(), Spectrograph(**MONO)
    with tempfile.TemporaryDirectory() as aside:
        paths = shoot(CameraCurves(name, curves, name), Path(aside), seed, light=light, device=device, mono=mono)
        try:
            answer = divide(
                paths["rgb.dng"], paths["mono.tif"], dark=paths["rgb-dark.dng"], mono_dark=paths["mono-dark.tif"],
                response=paths["mono-response.csv"],
            )  # fmt: skip
        except CalibrationError as error:
            return {"refused": error.code}
    found: dict[str, Any] = {"rmse": rmse(answer.values, curves).tolist()}
    for role, truth in (("rgb", device), ("mono", mono)):
        x = np.arange(truth.size[0], dtype=float)
        nm = truth.wavelength(x)
        seen = (nm >= 400) & (nm <= 700)
        dispersion = answer.dispersions[role]
        off = (dispersion.wavelength(x) - nm)[seen]
        found[role] = {
            "wavelength_error_nm": float(np.abs(off).max()),
            "residual_nm": dispersion.residual,
            "lines": len(dispersion.lines),
        }
    return found
