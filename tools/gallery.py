"""The picture of docs/notebook.md, from a simulated photo: `python -m tools.gallery`."""

from __future__ import annotations

import tempfile
from pathlib import Path

from camssf import Options, calibrate
from camssf.result import Kind
from camssf_lab.simulation.frames import simulate
from camssf_lab.simulation.scene import Scene
from tools.pictures import save_png, subplots

PLACE = Path(__file__).parents[1] / "docs" / "images" / "gallery.png"
CAMERA = "Nikon 5100 (NPL)"


def main() -> None:
    """Draw what the page's code draws."""
    with tempfile.TemporaryDirectory() as folder:
        scene = Scene(size=(1200, 900), vignetting=0.3, tilt=8.0)
        photo = simulate(CAMERA, ["D55"], folder, scene=scene).shots[0].shot
        result = calibrate(photo, options=Options(basis="cameras"), truth=CAMERA)
    figure, panels = subplots(2, 2, (11.0, 8.4))
    kinds: tuple[Kind, ...] = ("curves", "residuals", "patches", "budget")
    for panel, kind in zip(panels.flat, kinds, strict=True):
        result.plot(kind, ax=panel)
    save_png(figure, PLACE, 250, dpi=110)


if __name__ == "__main__":
    main()
