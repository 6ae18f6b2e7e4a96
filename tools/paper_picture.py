"""The picture of docs/paper.md from the last run of `python -m benchmarks paper`: `python -m tools.paper_picture`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.shared import RESULTS
from camssf.grid import WAVELENGTHS
from tools.pictures import RGB, draw_band, legend, save_png, subplots

PLACE = Path(__file__).parents[1] / "docs" / "images" / "paper-phones.png"


def phones(found: dict[str, Any]) -> Any:
    """Fig. 5: the curves, in the lifelike world."""
    rows = found["phones"]
    figure, panels = subplots(2, len(rows), (12, 5.6), sharex=True, sharey=True)
    for column, (name, row) in enumerate(rows.items()):
        truth = np.array(row["truth"])
        for line, world in enumerate(row["worlds"]):
            panel = panels[line, column]
            for method, style in (("gaussian", "--"), ("cameras", "-")):
                answer = row["worlds"][world][method]
                if "curves" not in answer:
                    continue
                got = np.array(answer["curves"])
                for c, shade in enumerate(RGB):
                    panel.plot(WAVELENGTHS, got[:, c], style, color=shade, linewidth=1)
                    if answer["std"] is not None:
                        draw_band(panel, got[:, c], np.array(answer["std"])[:, c], shade)
            panel.plot(WAVELENGTHS, truth, color="black", linewidth=0.8)
            panel.set_title(f"{name}, {world}", fontsize=9)
            panel.set_ylim(-0.1, 1.4)
    looks = {
        "measured": {"color": "black"},
        "camssf, 95 % band": {"color": RGB[0]},
        "l1 on Gaussians": {"linestyle": "--", "color": RGB[0]},
    }
    legend(panels[0, 0], looks, fontsize=7, loc="upper right", ncols=2)
    for panel in panels[1]:
        panel.set_xlabel("nm")
    return figure


def main() -> None:
    """Draw it."""
    save_png(phones(json.loads((RESULTS / "paper.json").read_text("utf-8"))), PLACE)


if __name__ == "__main__":
    main()
