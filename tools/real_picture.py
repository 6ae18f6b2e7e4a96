"""The picture of docs/real.md, the D70's curves beside both passes: `python -m tools.real_picture`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from benchmarks.claims.real import CLAIM, MEASURED, PAPER, TOLERANCES, d70, solve
from camssf.grid import WAVELENGTHS
from tools.pictures import RGB, draw_band, legend, save_png, subplots

PLACE = Path(__file__).parents[1] / "docs" / "images" / "real-d70.png"


def main() -> None:
    """Draw it."""
    figure, panels = subplots(1, 2, (11, 4.2), sharey=True)
    at = d70().at
    nm = WAVELENGTHS[at]
    titles = {CLAIM: "camssf, no Nikon in its basis", PAPER: "l1 on Gaussians (the paper)"}
    for panel, (basis, title) in zip(panels, titles.items(), strict=True):
        curves, std = solve(basis, MEASURED, TOLERANCES[1])[1].peak()
        for c, shade in enumerate(RGB):
            panel.plot(WAVELENGTHS, curves[:, c], color=shade, linewidth=1.5)
            if std is not None:
                draw_band(panel, curves[:, c], std[:, c], shade)
            for truth, mark in zip(d70().truth.values(), ("o", "x"), strict=True):
                panel.plot(nm, truth[at, c], mark, color=shade, markersize=3.5, markeredgewidth=0.8, fillstyle="none")
        panel.set_title(title, fontsize=10)
        panel.set(xlabel="nm", xlim=(390, 710), ylim=(-0.12, 1.3))
        panel.grid(alpha=0.3)
    point: dict[str, Any] = {"color": "black", "markersize": 3.5, "fillstyle": "none", "linestyle": ""}
    looks = {
        "recovered from the chart": {"color": "black"},
        "monochromator 2011": point | {"marker": "o"},
        "monochromator 2010": point | {"marker": "x"},
    }
    panels[0].set_ylabel("Nikon D70, peak 1")
    legend(panels[0], looks, loc="upper right")
    save_png(figure, PLACE)


if __name__ == "__main__":
    main()
