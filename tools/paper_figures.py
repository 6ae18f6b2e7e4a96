"""The figures of docs/paper.md from the last run of `python -m benchmarks paper`: `python -m tools.paper_figures`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.shared import RESULTS
from camssf.grid import BAND, WAVELENGTHS
from tools.pictures import RGB, legend, save_png, subplots

IMAGES = Path(__file__).parents[1] / "docs" / "images"
PAPER, PRODUCT = "l1 on Gaussians (the paper)", "elastic net on cameras (camssf)"
PAPER_SHADE, PRODUCT_SHADE = "#7d3c98", "#117a65"


def colours(found: dict[str, Any]) -> Any:
    """Fig. 3a."""
    figure, panels = subplots(1, 2, (10, 3.8), sharey=True)
    rows = found["colours"]
    for panel, noise in zip(panels, ("0.0", "0.005"), strict=True):
        for key, label, shade in (("paper", PAPER, PAPER_SHADE), ("product", PRODUCT, PRODUCT_SHADE)):
            row = rows[key][noise]
            panel.plot(rows["counts"], row["mean"], "o-", color=shade, markersize=3, label=label)
            panel.fill_between(rows["counts"], row["low"], row["high"], color=shade, alpha=0.15, linewidth=0)
        panel.set_title("no noise" if noise == "0.0" else f"noise {float(noise):.1%}")
        panel.set_xlabel("chromatic patches")
        panel.set_xticks(rows["counts"][::3])
        panel.grid(alpha=0.3)
    panels[0].axhline(0.0281, color="black", linewidth=0.8, linestyle="--", label="the paper, its camera, 12 patches")
    panels[0].set_ylabel("RMSE, mean and 80 % of the runs")
    panels[0].set_ylim(0, 0.4)
    panels[0].legend(fontsize=8)
    return figure


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
                        band = BAND * np.array(answer["std"])[:, c]
                        panel.fill_between(
                            WAVELENGTHS, got[:, c] - band, got[:, c] + band, color=shade, alpha=0.15, linewidth=0
                        )
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
    """Draw them."""
    found = json.loads((RESULTS / "paper.json").read_text("utf-8"))
    for make in (colours, phones):
        save_png(make(found), IMAGES / f"paper-{make.__name__}.png")


if __name__ == "__main__":
    main()
