"""The command that writes simulated photos."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from camssf.cli.options import Chart, OutFolder
from camssf.cli.reading import parse_size
from camssf.cli.terminal import emit, progress_bar, say

if TYPE_CHECKING:
    from camssf_lab.simulation.frames import Simulation

DEMO_PHONE = "Demo phone"
"""The first of `camssf.spectra.cameras.DEMO_PHONES`, repeated here so that the help does not load it."""


def simulate(
    out: OutFolder,
    camera: Annotated[
        str, typer.Option(metavar="NAME|CSV", help="Whose curves (see `camssf cameras`).")
    ] = DEMO_PHONE,
    lamp: Annotated[
        list[str] | None,
        typer.Option(
            metavar="SPEC",
            show_default=False,
            help="Lamp of a photo: a CIE name, 2856K, D:5500, equal-energy or a file. Repeat it for more photos.",
        ),
    ] = None,
    chart: Chart = "classic24",
    size: Annotated[str, typer.Option(metavar="WxH", help="Size of the picture, px.")] = "4000x3000",
    seed: Annotated[int, typer.Option(help="Seed of the noise.")] = 0,
    vignetting: Annotated[float, typer.Option(help="Light lost in the corners, as a share.")] = 0.0,
) -> None:
    """Write DNG files of a simulated camera.

    For each lamp a chart, a white and a dark frame; and truth.csv and corners.json.
    """
    with progress_bar() as progress:
        from camssf_lab.simulation.frames import simulate as photograph
        from camssf_lab.simulation.scene import Scene

        progress("simulating", 0.0)
        scene = photograph(
            camera,
            lamp or [],
            out,
            chart=chart,
            scene=Scene(size=parse_size(size), vignetting=vignetting),
            seed=seed,
        )
    shots = [
        {"lamp": s.lamp} | {role: getattr(s, role) and str(getattr(s, role)) for role in ("chart", "white", "dark")}
        for s in scene.shots
    ]
    emit(
        {
            "camera": scene.camera,
            "chart": scene.chart,
            "shots": shots,
            "truth": str(scene.truth),
            "corners": str(scene.corners),
        }
    )
    say("", f"{scene.camera} in {out}: {', '.join(sorted(path.name for path in _files_of(scene)))}")


def _files_of(scene: Simulation) -> list[Path]:
    frames = [path for shot in scene.shots for path in (shot.chart, shot.white, shot.dark) if path is not None]
    return [*frames, scene.truth, scene.corners]
