"""Two cameras' pictures of 99 surfaces: `python -m tools.picture_story [-o docs/images]`

Two measured cameras, each recovered without its maker, photograph the surfaces of benchmarks.claims.pictures under a
bulb. Each tile is one surface, its left half by the first camera and its right half by the second: through the colour
matrix that LibRaw holds of each (Adobe's), and through the curves. Where the two agree the tile has no seam.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from benchmarks.claims.colour import cases
from benchmarks.claims.pictures import SEED, WAYS, show
from benchmarks.shared import command_parser, one_thread
from camssf.colorimetry import delta_e00
from camssf.grid import Floats
from tools.pictures import from_lab, save_png, subplots

NAMES = ("Canon EOS 5D", "Sony ILCE-7M3")
UNDER = "A"
COLUMNS, TILE = 11, 40
TITLES = {"camssf": "through the recovered curves", "matrix": "through the cameras' colour matrices"}
PLACE = Path(__file__).parents[1] / "docs" / "images"


def tiles(first: Floats, second: Floats) -> Floats:
    """The tiles in rows of COLUMNS, of two sRGB (99, 3)."""
    halves = np.stack([first, second], axis=1).repeat(TILE // 2, axis=1)  # (99, TILE, 3)
    rows = halves.reshape(-1, COLUMNS, 1, TILE, 3).repeat(TILE, axis=2)
    return np.asarray(rows.transpose(0, 2, 1, 3, 4).reshape(-1, COLUMNS * TILE, 3))


def main(arguments: list[str] | None = None) -> int:
    """The command."""
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("-o", "--out", type=Path, default=PLACE)
    folder = parser.parse_args(arguments).out
    by_name = {case.name: case for case in cases(52, None)}
    shown = [show(by_name[name], UNDER, np.random.default_rng([SEED, i])) for i, name in enumerate(NAMES)]
    figure, panels = subplots(1, 2, (9.0, 4.4))
    for panel, way in zip(panels, reversed(WAYS), strict=True):
        first, second = (getattr(one, way).mean(axis=1) for one in shown)
        panel.imshow(tiles(from_lab(first), from_lab(second)))
        panel.set_title(f"{TITLES[way]}: ΔE00 {np.median(delta_e00(first, second)):.1f}", fontsize=10)
        panel.set_axis_off()
    save_png(figure, folder / "picture-story.png", 250, dpi=110)
    return 0


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
