"""The pictures of docs/notebook.md, from simulated photos: `python -m tools.gallery`."""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from camssf import Options, Result, calibrate
from camssf.grid import BAND
from camssf.recovery import predict_signals
from camssf.report.shots import shots_of
from camssf.spectra import read_camera, read_chart, read_lamp
from camssf_colour import standard_colour
from camssf_lab.simulation.frames import simulate
from camssf_lab.simulation.scene import Scene
from tools.pictures import save_png, subplots

FOLDER = Path(__file__).parents[1] / "docs" / "images"
CAMERA = "Nikon 5100 (NPL)"


def draw(folder: Path) -> None:
    """Every picture, into a folder."""
    with tempfile.TemporaryDirectory() as shots:
        scene = Scene(size=(1200, 900), vignetting=0.3, tilt=8.0)
        taken = [shot.shot for shot in simulate(CAMERA, ["D55", "A"], shots, scene=scene).shots]
        one, two = (calibrate(part, options=Options(basis="cameras"), truth=CAMERA) for part in (taken[:1], taken))
    pictures: dict[str, tuple[float, Callable[[Any, Any], object]]] = {
        "curves": (3.8, lambda left, right: (one.plot("curves", ax=left), two.plot("curves", ax=right))),
        "patches": (3.8, lambda left, right: (one.plot("residuals", ax=left), one.plot("patches", ax=right))),
        "budget": (3.2, lambda left, right: (one.plot("budget", ax=left), two.plot("budget", ax=right))),
    }
    for name, (height, plot) in pictures.items():
        figure, panels = subplots(1, 2, (10.4, height))
        plot(*panels)
        save_png(figure, folder / f"gallery-{name}.png", 250, dpi=110)
    figure, panel = subplots(1, 1, (5.2, 4.4))
    _colours(two, panel)
    save_png(figure, folder / "gallery-colour.png", 250, dpi=110)


def _colours(result: Result, ax: Any) -> None:
    """The chart's colours in Lab under a bulb: through the table, and through the curves with their errors."""
    lamp, chart, white = read_lamp("A"), read_chart("classic24"), np.ones(681)
    signals = predict_signals(read_camera(CAMERA).values, chart.values, lamp.values[None], white)[0]
    found = standard_colour(result, lamp, signals, 0.002)
    shown = shots_of(result)[0].patches
    assert shown is not None
    assert shown.measured_srgb is not None
    error = BAND * np.sqrt(np.diagonal(found.lab_covariance, axis1=1, axis2=2))
    for (_, a, b), (_, da, db), hue in zip(found.lab, error, shown.measured_srgb, strict=True):
        ax.errorbar(a, b, xerr=da, yerr=db, fmt="o", color=hue, markeredgecolor="0.3", ecolor="0.5", capsize=2)
    ax.axhline(0, color="0.8", linewidth=0.8, zorder=0)
    ax.axvline(0, color="0.8", linewidth=0.8, zorder=0)
    ax.set(xlabel="a*", ylabel="b*", title="The chart under a bulb, 95 % errors")


def main(argv: Sequence[str] | None = None) -> None:
    """Write the pictures."""
    parser = argparse.ArgumentParser(prog="python -m tools.gallery", description=__doc__)
    parser.add_argument("-o", "--out", type=Path, default=FOLDER)
    draw(parser.parse_args(argv).out)


if __name__ == "__main__":
    main()
