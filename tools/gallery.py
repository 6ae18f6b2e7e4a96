"""The pictures of docs/notebook.md, from simulated photos: `python -m tools.gallery`."""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from camssf import Options, Result, calibrate
from camssf.libraries import prepare_matplotlib
from camssf.recovery import predict_signals
from camssf.report.shots import shots_of
from camssf.spectra import read_camera, read_chart, read_lamp
from camssf_colour import standard_colour
from camssf_lab.simulation.frames import Simulation, simulate
from camssf_lab.simulation.scene import Scene

FOLDER = Path(__file__).parents[1] / "docs" / "images"
CAMERA = "Nikon 5100 (NPL)"
SIZE = (1200, 900)


def _solved(made: Simulation, count: int, **arguments: Any) -> Result:
    shots = made.shots[:count]
    return calibrate(
        [shot.shot for shot in shots],
        options=Options(basis="cameras"),
        **arguments,
    )


def draw(folder: Path) -> list[Path]:
    """Every picture, into a folder."""
    prepare_matplotlib()
    from matplotlib.figure import Figure

    with tempfile.TemporaryDirectory() as shots:
        made = simulate(CAMERA, ["D55", "A"], shots, scene=Scene(size=SIZE, vignetting=0.3, tilt=8.0))
        one, two = (_solved(made, count, truth=CAMERA) for count in (1, 2))
    written = []

    def page(name: str, columns: int, height: float = 3.8) -> tuple[Figure, Any]:
        figure = Figure(figsize=(5.2 * columns, height), dpi=110, layout="constrained")
        written.append(folder / f"gallery-{name}.png")
        return figure, figure.subplots(1, columns, squeeze=False)[0]

    def keep(figure: Figure) -> None:
        figure.savefig(written[-1], metadata={"Software": None})

    figure, (left, right) = page("curves", 2)
    one.plot(ax=left)
    two.plot(ax=right)
    keep(figure)
    figure, (left, right) = page("patches", 2)
    one.plot("residuals", ax=left)
    one.plot("patches", ax=right)
    keep(figure)
    figure, (left, right) = page("budget", 2, 3.2)
    one.plot("budget", ax=left)
    two.plot("budget", ax=right)
    keep(figure)
    figure, (left,) = page("colour", 1, 4.4)
    _colours(two, left)
    keep(figure)
    return written


def _colours(result: Result, ax: Any) -> None:
    """The chart's colours in Lab under a bulb: through the table, and through the curves with their errors."""
    lamp, chart, white = read_lamp("A"), read_chart("classic24"), np.ones(681)
    signals = predict_signals(read_camera(CAMERA).values, chart.values, lamp.values[None], white)[0]
    found = standard_colour(result, lamp, signals, 0.002)
    shown = shots_of(result)[0].patches
    assert shown is not None
    assert shown.measured_srgb is not None
    error = 1.96 * np.sqrt(np.diagonal(found.lab_covariance, axis1=1, axis2=2))
    hues = shown.measured_srgb
    for (_, a, b), (_, da, db), hue in zip(found.lab, error, hues, strict=True):
        ax.errorbar(a, b, xerr=da, yerr=db, fmt="o", color=hue, markeredgecolor="0.3", ecolor="0.5", capsize=2)
    ax.axhline(0, color="0.8", linewidth=0.8, zorder=0)
    ax.axvline(0, color="0.8", linewidth=0.8, zorder=0)
    ax.set_xlabel("a*")
    ax.set_ylabel("b*")
    ax.set_title("The chart under a bulb, 95 % errors")


def main(argv: Sequence[str] | None = None) -> int:
    """Write the pictures."""
    argparse.ArgumentParser(prog="python -m tools.gallery", description=__doc__).parse_args(argv)
    FOLDER.mkdir(exist_ok=True)
    for path in draw(FOLDER):
        print(path.name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
