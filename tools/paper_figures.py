"""The paper's figures from the bench's results: one PNG each. What a table of the page says has no figure."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from camssf.grid import BAND, WAVELENGTHS
from tools.pictures import RGB, legend, save_png, subplots

PAPER, PRODUCT = "l1 on Gaussians (the paper)", "elastic net on cameras (camssf)"
PAPER_SHADE, PRODUCT_SHADE = "#7d3c98", "#117a65"


def draw(found: dict[str, Any], folder: Path) -> None:
    """All figures into `folder`."""
    for make in (colours, curves, correlation, direct, phones, patches):
        save_png(make(found), folder / f"paper-{make.__name__}.png")


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


def curves(found: dict[str, Any]) -> Any:
    """Fig. 3b to e."""
    one = found["curves_of_one"]
    figure, panels = subplots(1, 4, (13, 3.2), sharey=True)
    truth = np.array(one["truth"])
    truth = truth / truth.max(axis=0)
    for panel, (count, row) in zip(panels, one["panels"].items(), strict=True):
        for c, shade in enumerate(RGB):
            panel.plot(WAVELENGTHS, truth[:, c], color=shade, linewidth=1)
            panel.plot(WAVELENGTHS, np.array(row["paper"]["curves"])[:, c], "--", color=shade, linewidth=1)
            panel.plot(WAVELENGTHS, np.array(row["product"]["curves"])[:, c], ":", color=shade, linewidth=1.6)
        panel.set_title(f"{count} patches", fontsize=10)
        panel.set_xlabel("nm")
    styles = {"measured": "-", "l1 on Gaussians": "--", "camssf": ":"}
    looks = {word: {"linestyle": style, "color": "black"} for word, style in styles.items()}
    panels[0].set_ylim(-0.1, 1.45)
    legend(panels[0], looks, fontsize=7, loc="upper right", ncols=2)
    panels[0].set_ylabel(f"{one['camera']}, peak 1")
    return figure


def correlation(found: dict[str, Any]) -> Any:
    """Fig. 3f, and the coherence that the paper does not give."""
    figure, (left, right) = subplots(1, 2, (9.5, 3.8))
    picture = left.imshow(
        np.abs(found["correlation"]["tables"]["BabelColor, 7 to 18"]["map"]), vmin=0, vmax=1, cmap="viridis"
    )
    left.set_xticks(range(12), range(7, 19), fontsize=7)
    left.set_yticks(range(12), range(7, 19), fontsize=7)
    left.set_xlabel("patch")
    left.set_title("|r| of the reflectances", fontsize=10)
    figure.colorbar(picture, ax=left, shrink=0.85)
    coherence = found["correlation"]["coherence_below_1"]
    right.loglog([int(n) for n in coherence], list(coherence.values()), "o-", color=PAPER_SHADE)
    right.set_xticks([int(n) for n in coherence], list(coherence), minor=False)
    right.minorticks_off()
    right.set_xlabel("Gaussians in the dictionary")
    right.set_ylabel("1 - mutual coherence of F Ψ")
    right.grid(alpha=0.3)
    return figure


def direct(found: dict[str, Any]) -> Any:
    """Sec. 4: the lines of both frames, what the dispersions are off, and the curves; one camera."""
    one = found["direct_of_one"]
    figure, (left, right) = subplots(1, 2, (10, 3.6))
    for role, shade in (("rgb", PRODUCT_SHADE), ("mono", "#5d6d7e")):
        row = one[role]
        left.plot(*np.array(row["curves"]), color=shade, label=f"{role} frame: fitted less true")
        lines = row["found"]
        left.plot([e["nm"] for e in lines], [e["residual"] for e in lines], "o", color=shade, markersize=4)
        for each in lines if role == "mono" else ():
            left.annotate(
                each["name"], (each["nm"], each["residual"]), fontsize=7, xytext=(3, 3), textcoords="offset points"
            )
    left.axhline(0, color="black", linewidth=0.6)
    left.set_ylim(-1, 1)
    left.set_xlabel("nm")
    left.set_ylabel("nm; dots: the lines' residuals")
    left.legend(fontsize=8)
    truth, got = np.array(one["truth"]), np.array(one["curves"])
    for c, shade in enumerate(RGB):
        right.plot(WAVELENGTHS, got[:, c], color=shade, linewidth=1)
    right.plot(WAVELENGTHS, truth, "--", color="black", linewidth=0.8)
    right.set_xlabel("nm")
    legend(right, {"measured directly": {"color": RGB[1]}, "true": {"linestyle": "--", "color": "black"}})
    right.set_title(one["name"], fontsize=9)
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


def patches(found: dict[str, Any]) -> Any:
    """Fig. 6: the 96 colours as photographed, and as the recovered curves say."""
    rows = found["phones"]
    figure, panels = subplots(2, len(rows), (11, 5.2))
    for column, (name, row) in enumerate(rows.items()):
        answer = row["worlds"]["lifelike"]["cameras"]
        letter = "abc"[column]
        for line, key, word in ((0, "measured_srgb", "photographed"), (1, "synthetic_srgb", "synthetic")):
            panel = panels[line, column]
            if key in answer:
                panel.imshow(np.array(answer[key]).reshape(8, 12, 3), interpolation="nearest")
            panel.set_xticks([])
            panel.set_yticks([])
            panel.set_title(f"({letter}-{line + 1}) {name}, {word}", fontsize=8)
    return figure
