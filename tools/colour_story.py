"""One chart seen by three cameras, and the angle of skin: `python -m tools.colour_story [-o docs/images]`

Three measured cameras, each recovered with a basis that does not know its maker, from a simulated chart under D55
and A (benchmarks.claims.colour: another laboratory's table, low noise). Then each photographs the chart under a lamp
that it was not calibrated under (FL2).

colour-story.png: the chart as each camera's file has it (white-balanced signals shown as sRGB), through the 3 × 3
matrix of the D55 chart, and through the recovered curves; the small square is the true colour (Lab adapted to D65, in
sRGB). Above each: mean ΔE00 of the 24 against the truth; at the right the median ΔE00 between the cameras.

colour-skin.png: the individual typology angle of two real skins (CES15 and CES18 of CIE 224:2017, whose samples are
left out of the prior here), arctan((L* - 50) / b*), 10° observer and D65, by the same three cameras under five lamps:
through that matrix, and through the curves with its 95 % interval, lamp named. The line is the truth. The second
table has the angle's mean error, that through the true curves as well, how often the interval holds the truth, and
by how much the angle differs between the cameras (largest less smallest, mean over the lamps).
"""

from __future__ import annotations

import argparse
import io
import sys
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.captures import LOW
from benchmarks.claims.colour import LAMPS, SEED, SHOTS, Case, calibrate, through_chart, unseen
from benchmarks.claims.spectrum import prior_without
from benchmarks.devices import left_out
from benchmarks.shared import console, lamp, one_thread, save, table, versions
from camssf.colorimetry import adapt, delta_e00, signals_of, white_of
from camssf.files import write_file
from camssf.grid import Floats
from camssf.spectra import read_chart
from camssf_colour import Camera, LitSurfaces, View, lab, spectrum, standard_colour
from camssf_colour.standard import of_surfaces
from camssf_lab.learning.training import maker_of

NAMES = ("Canon EOS 5D", "Nikon D5100", "Sony ILCE-7M3")
UNDER = "FL2"
WAYS = ("as the file has it", "matrix of a D55 chart", "through the curves")
D65 = View(white="D65")
SKIN = View("1964", "D65")
SKINS = {"CES15": 14, "CES18": 17}
"""The skins among the 99 samples, of which TM-30 takes its index of skin."""
PLACE = Path(__file__).parents[1] / "docs" / "images"


def chart() -> Floats:
    """(24, 681) the chart that stands there."""
    return read_chart("classic24:ohta").values


def recovered(rng: np.random.Generator) -> tuple[list[Case], list[Camera]]:
    """The three, and what was recovered of them."""
    curves, bases = left_out()
    cases = [Case(name, curves[name], bases[maker_of(name)]) for name in NAMES]
    return cases, [calibrate(case, SHOTS["two"], rng, off=False) for case in cases]


def seen(table_: Floats, case: Case, power: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """White-balanced signals (n, 3) of surfaces (n, 681), with noise, and their standard error."""
    y = signals_of(table_, power, case.curves)
    error = np.hypot(LOW[0] * y, LOW[1])
    return y + error * rng.normal(size=y.shape), error


def story(cases: list[Case], cameras: list[Camera], rng: np.random.Generator) -> dict[str, list[Floats]]:
    """Lab (24, 3) adapted to D65, by way and camera."""
    power, aim = lamp(UNDER), white_of(lamp("D65"))
    found: dict[str, list[Floats]] = {way: [] for way in WAYS}
    for case, camera in zip(cases, cameras, strict=True):
        y, error = seen(chart(), case, power, rng)
        found[WAYS[0]].append(lab(from_srgb(np.clip(y, 0.0, 1.0)), aim))
        xyz = (y @ through_chart(case, lamp("D55"), rng)) / white_of(lamp("D55"))
        found[WAYS[1]].append(lab(adapt(xyz * white_of(power), white_of(power), aim), aim))
        found[WAYS[2]].append(standard_colour(camera, UNDER, y, error, view=D65).lab)
    return found


def skin(cases: list[Case], cameras: list[Camera], rng: np.random.Generator) -> list[dict[str, Any]]:
    """The angle by skin, lamp and camera: true, by the matrix, through the curves and its 95 % half-width."""
    rows, aim = [], white_of(lamp("D65"), "1964")
    skins = unseen()[list(SKINS.values())]
    for name in LAMPS:
        power = lamp(name)
        truth = of_surfaces(skins, power, SKIN)[1]
        for case, camera in zip(cases, cameras, strict=True):
            y, error = seen(skins, case, power, rng)
            lit, prior = LitSurfaces(name, y, error), prior_without("cie")
            ours = spectrum(camera, lit, prior=prior, view=SKIN)
            exact = Camera(case.name, case.curves / case.curves.max(axis=0), np.zeros((0, *case.curves.shape)))
            known = spectrum(exact, lit, prior=prior, view=SKIN)
            white = white_of(power, "1964")
            xyz = (y @ through_chart(case, lamp("D55"), rng)) / white_of(lamp("D55")) * white
            matrix = lab(adapt(xyz, white, aim), aim)
            for patch, word in enumerate(SKINS):
                angle, half = ita(ours.lab[patch], ours.lab_covariance[patch])
                rows.append(
                    {
                        "skin": word,
                        "lamp": name,
                        "camera": case.name,
                        "true": ita(truth[patch], np.zeros((3, 3)))[0],
                        "matrix": ita(matrix[patch], np.zeros((3, 3)))[0],
                        "exact": ita(known.lab[patch], np.zeros((3, 3)))[0],
                        "curves": angle,
                        "half_width": half,
                    }
                )
    return rows


def ita(colour: Floats, covariance: Floats) -> tuple[float, float]:
    """Individual typology angle and its 95 % half-width, degrees."""
    height, b = colour[0] - 50.0, colour[2]
    slope = np.array([b, 0.0, -height]) / (height**2 + b**2)
    return float(np.degrees(np.arctan2(height, b))), float(1.96 * np.degrees(np.sqrt(slope @ covariance @ slope)))


TO_SRGB: Floats = np.array(
    [[3.2406255, -1.5372080, -0.4986286], [-0.9689307, 1.8757561, 0.0415175], [0.0557101, -0.2040211, 1.0569959]]
)
"""IEC 61966-2-1, XYZ with Y of white 1."""


def from_srgb(linear: Floats) -> Floats:
    """Linear sRGB (..., 3) to XYZ, D65's white as this package has it."""
    xyz = linear @ np.linalg.inv(TO_SRGB).T
    return np.asarray(xyz / (np.ones(3) @ np.linalg.inv(TO_SRGB).T) * white_of(lamp("D65")))


def display(colour: Floats) -> Floats:
    """Lab (..., 3) under D65 to sRGB, 0 to 1."""
    fy = (colour[..., 0] + 16.0) / 116.0
    f = np.stack([fy + colour[..., 1] / 500.0, fy, fy - colour[..., 2] / 200.0], axis=-1)
    xyz = np.where(f > 6 / 29, f**3, 3 * (6 / 29) ** 2 * (f - 4 / 29))  # over its white
    linear = np.clip((xyz * (np.ones(3) @ np.linalg.inv(TO_SRGB).T)) @ TO_SRGB.T, 0.0, 1.0)
    return np.asarray(np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055))


def between(labs: list[Floats]) -> float:
    """Median ΔE00 over pairs of cameras and patches."""
    return float(np.median([delta_e00(labs[i], labs[j]) for i in range(len(labs)) for j in range(i)]))


def draw_story(plt: Any, found: dict[str, list[Floats]], truth: Floats) -> Any:
    """Three ways by three cameras."""
    figure, panels = plt.subplots(len(WAYS), len(NAMES), figsize=(9.6, 7.2), layout="constrained")
    for row, way in zip(panels, WAYS, strict=True):
        for panel, name, colours in zip(row, NAMES, found[way], strict=True):
            for i, (ours, theirs) in enumerate(zip(display(colours), display(truth), strict=True)):
                x, y = i % 6, 3 - i // 6
                panel.add_patch(plt.Rectangle((x, y), 0.94, 0.94, color=tuple(ours)))
                panel.add_patch(plt.Rectangle((x + 0.32, y + 0.32), 0.3, 0.3, color=tuple(theirs)))
            panel.set(xlim=(0, 5.94), ylim=(0, 3.94), aspect="equal", xticks=[], yticks=[])
            panel.set_title(f"{name}: {delta_e00(truth, colours).mean():.1f}", fontsize=9)
        row[0].set_ylabel(way, fontsize=9)
        row[-1].yaxis.set_label_position("right")
        row[-1].set_ylabel(f"between them: {between(found[way]):.1f}", fontsize=9)
    return figure


def draw_skin(plt: Any, rows: list[dict[str, Any]]) -> Any:
    """Two skins, five lamps, three cameras."""
    figure, panels = plt.subplots(1, len(SKINS), figsize=(9.6, 3.6), layout="constrained")
    for panel, word in zip(panels, SKINS, strict=True):
        mine = [row for row in rows if row["skin"] == word]
        for k, name in enumerate(LAMPS):
            under = [row for row in mine if row["lamp"] == name]
            panel.plot([k - 0.4, k + 0.4], [under[0]["true"]] * 2, color="black", linewidth=1)
            at = k + 0.2 * np.arange(-1, 2)
            panel.plot(at - 0.03, [row["matrix"] for row in under], "x", color="#c0392b", markersize=5)
            panel.errorbar(
                at + 0.03, [row["curves"] for row in under], [row["half_width"] for row in under], fmt="o",
                color="#2455a4", markersize=3, linewidth=1,
            )  # fmt: skip
        panel.set_xticks(range(len(LAMPS)), LAMPS)
        panel.set_title(word, fontsize=10)
        panel.set_ylabel("ITA, degrees")
    panels[0].plot([], [], "x", color="#c0392b", label="matrix of a D55 chart")
    panels[0].errorbar([], [], [], fmt="o", color="#2455a4", markersize=3, label="through the curves, 95 %")
    panels[0].plot([], [], color="black", label="true")
    panels[0].legend(fontsize=8)
    return figure


def paint(folder: Path, found: dict[str, list[Floats]], truth: Floats, rows: list[dict[str, Any]]) -> list[Path]:
    """Both pictures."""
    from camssf.libraries import prepare_matplotlib

    prepare_matplotlib()
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt
    from PIL import Image

    folder.mkdir(parents=True, exist_ok=True)
    made = []
    for name, figure in (("story", draw_story(plt, found, truth)), ("skin", draw_skin(plt, rows))):
        drawn, small = io.BytesIO(), io.BytesIO()
        figure.savefig(drawn, format="png", dpi=90)
        plt.close(figure)
        Image.open(drawn).convert("RGB").quantize(250).save(small, format="png", optimize=True)
        write_file(folder / f"colour-{name}.png", small.getvalue())
        made.append(folder / f"colour-{name}.png")
    return made


def main(arguments: list[str] | None = None) -> int:
    """The command."""
    parser = argparse.ArgumentParser(prog="python -m tools.colour_story", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("-o", "--out", type=Path, default=PLACE, help="folder of the pictures")
    options = parser.parse_args(arguments)
    rng = np.random.default_rng(SEED)
    cases, cameras = recovered(rng)
    truth = of_surfaces(chart(), lamp(UNDER), D65)[1]
    found = story(cases, cameras, rng)
    rows = skin(cases, cameras, rng)
    made = paint(options.out, found, truth, rows)
    chart_rows: dict[str, dict[str, Any]] = {
        way: {
            "cameras": [float(delta_e00(truth, colours).mean()) for colours in labs],
            "between": between(labs),
        }
        for way, labs in found.items()
    }
    angles = {
        word: {
            way: float(np.mean([abs(row[way] - row["true"]) for row in rows if row["skin"] == word]))
            for way in ("matrix", "exact", "curves")
        }
        | {
            f"range_{way}": float(
                np.mean(
                    [
                        np.ptp([row[way] for row in rows if (row["skin"], row["lamp"]) == (word, name)])
                        for name in LAMPS
                    ]
                )
            )
            for way in ("matrix", "curves")
        }
        | {"half_width": float(np.mean([row["half_width"] for row in rows if row["skin"] == word]))}
        | {
            "held": float(
                np.mean([abs(row["curves"] - row["true"]) < row["half_width"] for row in rows if row["skin"] == word])
            )
        }
        for word in SKINS
    }
    lines = [
        (way, *(f"{value:.2f}" for value in row["cameras"]), f"{row['between']:.2f}")
        for way, row in chart_rows.items()
    ]
    console().print(table(f"mean ΔE00 of the chart under {UNDER}", ("way", *NAMES, "between them"), lines))
    lines = [
        (
            word,
            f"{row['matrix']:.1f}",
            f"{row['exact']:.1f}",
            f"{row['curves']:.1f}",
            f"{row['half_width']:.1f}",
            f"{row['held']:.2f}",
            f"{row['range_matrix']:.1f}",
            f"{row['range_curves']:.1f}",
        )
        for word, row in angles.items()
    ]
    head = ("skin", "matrix", "true curves", "curves", "95 % half-width", "held", "range, matrix", "range, curves")
    console().print(table("mean error of the individual typology angle, degrees", head, lines))
    content = {"chart": chart_rows, "ita": angles, "versions": versions("colour-science", "matplotlib")}
    print(save("colour-story", content))
    for path in made:
        print(path)
    return 0


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
