"""The paper's figures from the bench's results: one PNG each."""

from __future__ import annotations

import io
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from camssf.grid import WAVELENGTHS

RGB = ("#c0392b", "#1e8449", "#2455a4")
PAPER, PRODUCT = "l1 on Gaussians (the paper)", "elastic net on cameras (camssf)"
PAPERS_OWN = {"QR": 0.3557, "pseudo-inverse": 0.1511, "l1": 0.0281}
"""Fig. 4 of the paper, mean RMSE."""


def draw(found: dict[str, Any], folder: Path) -> list[Path]:
    """All figures into `folder`; their paths."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt
    from PIL import Image

    folder.mkdir(parents=True, exist_ok=True)
    figures: dict[str, Callable[[Any, dict[str, Any]], Any]] = {
        "colours": colours,
        "curves": curves,
        "correlation": correlation,
        "methods": methods,
        "rivals": rivals,
        "lamps": lamps,
        "direct": direct,
        "phones": phones,
        "patches": patches,
    }
    made = []
    for name, make in figures.items():
        figure = make(plt, found)
        path = folder / f"paper-{name}.png"
        drawn = io.BytesIO()
        figure.savefig(drawn, format="png", dpi=90)
        plt.close(figure)
        temporary = folder / f".{path.name}.{os.getpid()}"
        Image.open(drawn).convert("RGB").quantize(160).save(temporary, format="png", optimize=True)
        os.replace(temporary, path)
        made.append(path)
    return made


def colours(plt: Any, found: dict[str, Any]) -> Any:
    """Fig. 3a."""
    figure, panels = plt.subplots(1, 2, figsize=(10, 3.8), sharey=True, layout="constrained")
    rows = found["colours"]
    for panel, noise in zip(panels, ("0.0", "0.005"), strict=True):
        for key, label, shade in (("paper", PAPER, "#7d3c98"), ("product", PRODUCT, "#117a65")):
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


def curves(plt: Any, found: dict[str, Any]) -> Any:
    """Fig. 3b to e."""
    one = found["curves_of_one"]
    figure, panels = plt.subplots(1, 4, figsize=(13, 3.2), sharey=True, layout="constrained")
    truth = np.array(one["truth"])
    truth = truth / truth.max(axis=0)
    for panel, (count, row) in zip(panels, one["panels"].items(), strict=True):
        for c, shade in enumerate(RGB):
            panel.plot(WAVELENGTHS, truth[:, c], color=shade, linewidth=1)
            panel.plot(WAVELENGTHS, np.array(row["paper"]["curves"])[:, c], "--", color=shade, linewidth=1)
            panel.plot(WAVELENGTHS, np.array(row["product"]["curves"])[:, c], ":", color=shade, linewidth=1.6)
        panel.set_title(f"{count} patches", fontsize=10)
        panel.set_xlabel("nm")
    for style, label in (("-", "measured"), ("--", "l1 on Gaussians"), (":", "camssf")):
        panels[0].plot([], [], style, color="black", label=label)
    panels[0].set_ylim(-0.1, 1.45)
    panels[0].legend(fontsize=7, loc="upper right", ncols=2)
    panels[0].set_ylabel(f"{one['camera']}, peak 1")
    return figure


def correlation(plt: Any, found: dict[str, Any]) -> Any:
    """Fig. 3f, and the coherence that the paper does not give."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.5, 3.8), layout="constrained")
    picture = left.imshow(
        np.abs(found["correlation"]["tables"]["BabelColor, 7 to 18"]["map"]), vmin=0, vmax=1, cmap="viridis"
    )
    left.set_xticks(range(12), range(7, 19), fontsize=7)
    left.set_yticks(range(12), range(7, 19), fontsize=7)
    left.set_xlabel("patch")
    left.set_title("|r| of the reflectances", fontsize=10)
    figure.colorbar(picture, ax=left, shrink=0.85)
    coherence = found["correlation"]["coherence_below_1"]
    right.loglog([int(n) for n in coherence], list(coherence.values()), "o-", color="#7d3c98")
    right.set_xticks([int(n) for n in coherence], list(coherence), minor=False)
    right.minorticks_off()
    right.set_xlabel("Gaussians in the dictionary")
    right.set_ylabel("1 - mutual coherence of F Ψ")
    right.grid(alpha=0.3)
    return figure


def methods(plt: Any, found: dict[str, Any]) -> Any:
    """Fig. 4."""
    rows = found["figure_4"]
    figure, panel = plt.subplots(figsize=(10, 4.6), layout="constrained")
    names = list(rows)
    at = np.arange(len(names))
    for i, (noise, shade) in enumerate((("0.0", "#aab7b8"), ("0.005", "#5d6d7e"), ("0.01", "#1b2631"))):
        label = "no noise" if noise == "0.0" else f"noise {float(noise):.1%}"
        panel.barh(at + 0.27 * (i - 1), [rows[name][noise] for name in names], height=0.25, color=shade, label=label)
    for word, value in PAPERS_OWN.items():
        panel.axvline(value, color="#c0392b", linewidth=0.9, linestyle="--")
        panel.text(value, -0.8, f" the paper's {word}", color="#c0392b", fontsize=7, ha="left", va="bottom")
    panel.set_yticks(at, names, fontsize=8)
    panel.set_ylim(len(names) - 0.4, -1.3)
    panel.set_xlabel("mean RMSE, 12 patches, D55")
    panel.legend(fontsize=8, loc="lower right")
    return figure


def rivals(plt: Any, found: dict[str, Any]) -> Any:
    """Table 1's families."""
    rows = found["rivals"]
    figure, panels = plt.subplots(1, 3, figsize=(13, 3.9), sharey=True, layout="constrained")
    names = list(rows)
    at = np.arange(len(names))
    for panel, noise in zip(panels, ("0.0", "0.005", "0.01"), strict=True):
        for i, (light, shade) in enumerate(
            (("equal-energy", "#b2babb"), ("D55", "#5499c7"), ("A", "#e59866"), ("LED-B3", "#7d3c98"))
        ):
            values = [rows[name][noise][light]["rmse"] for name in names]
            panel.barh(at + 0.2 * (i - 1.5), values, height=0.19, color=shade, label=light)
        panel.set_title("no noise" if noise == "0.0" else f"noise {float(noise):.1%}", fontsize=10)
        panel.set_xlabel("RMSE, 24 patches")
        panel.set_xlim(0, 0.2)
        panel.grid(alpha=0.3, axis="x")
    panels[0].set_yticks(at, names, fontsize=8)
    panels[0].invert_yaxis()
    panels[2].legend(fontsize=8, loc="lower right")
    return figure


def lamps(plt: Any, found: dict[str, Any]) -> Any:
    """The lamp ignored and known: what RMSE sees and RMSRE does not."""
    figure, panels = plt.subplots(1, 2, figsize=(10, 3.6), layout="constrained")
    rows = found["lamps"][PAPER]
    names = list(rows["known"])
    at = np.arange(len(names))
    for panel, key, word in ((panels[0], "rmse", "RMSE against the truth"), (panels[1], "rmsre_percent", "RMSRE, %")):
        for i, (case, shade) in enumerate((("known", "#117a65"), ("ignored", "#c0392b"))):
            values = [rows[case][name][key] for name in names]
            panel.bar(at + 0.4 * (i - 0.5), values, width=0.38, color=shade, label=f"lamp {case}")
        panel.set_xticks(at, names, fontsize=8)
        panel.set_ylabel(word)
        panel.grid(alpha=0.3, axis="y")
    panels[1].set_ylim(0, 7.0)
    panels[1].axhline(6.95, color="black", linewidth=0.8, linestyle="--", label="the paper's best phone")
    panels[0].legend(fontsize=8)
    panels[1].legend(fontsize=8, loc="center right")
    return figure


def direct(plt: Any, found: dict[str, Any]) -> Any:
    """Sec. 4: the lines of both frames, what the dispersions are off, and the curves; one camera."""
    one = found["direct_of_one"]
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.6), layout="constrained")
    for role, shade in (("rgb", "#117a65"), ("mono", "#5d6d7e")):
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
    right.plot([], [], color=RGB[1], label="measured directly")
    right.plot([], [], "--", color="black", label="true")
    right.set_xlabel("nm")
    right.legend(fontsize=8)
    right.set_title(one["name"], fontsize=9)
    return figure


def phones(plt: Any, found: dict[str, Any]) -> Any:
    """Fig. 5: the curves, in the lifelike world."""
    rows = found["phones"]
    figure, panels = plt.subplots(2, len(rows), figsize=(12, 5.6), sharex=True, sharey=True, layout="constrained")
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
                        band = 1.96 * np.array(answer["std"])[:, c]
                        panel.fill_between(
                            WAVELENGTHS, got[:, c] - band, got[:, c] + band, color=shade, alpha=0.15, linewidth=0
                        )
            panel.plot(WAVELENGTHS, truth, color="black", linewidth=0.8)
            panel.set_title(f"{name}, {world}", fontsize=9)
            panel.set_ylim(-0.1, 1.4)
    for style, shade, label in (
        ("-", "black", "measured"),
        ("-", RGB[0], "camssf, 95 % band"),
        ("--", RGB[0], "l1 on Gaussians"),
    ):
        panels[0, 0].plot([], [], style, color=shade, label=label)
    panels[0, 0].legend(fontsize=7, loc="upper right", ncols=2)
    for panel in panels[1]:
        panel.set_xlabel("nm")
    return figure


def patches(plt: Any, found: dict[str, Any]) -> Any:
    """Fig. 6: the 96 colours as photographed, and as the recovered curves say."""
    rows = found["phones"]
    figure, panels = plt.subplots(2, len(rows), figsize=(11, 5.2), layout="constrained")
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
