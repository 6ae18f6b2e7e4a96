"""The angle of skin by three cameras: `python -m tools.skin_angles [-o docs/images]`

Three measured cameras, each recovered with a basis that does not know its maker, from a simulated chart under D55
and A (`benchmarks colour`: another laboratory's table, low noise).

colour-skin.png: the individual typology angle of two real skins (CES15 and CES18 of CIE 224:2017, whose samples are
left out of the prior here), arctan((L* - 50) / b*), 10° observer and D65, by these cameras under five lamps: through
the 3 × 3 matrix of the D55 chart, and through the curves with its 95 % interval, lamp named. The line is the truth.
The table has the angle's mean error, that through the true curves as well, how often the interval holds the truth,
and by how much the angle differs between the cameras (largest less smallest, mean over the lamps).
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.captures import LOW
from benchmarks.claims.colour import LAMPS, SEED, SHOTS, Case, calibrate, through_chart, unseen
from benchmarks.claims.spectrum import prior_without
from benchmarks.devices import left_out
from benchmarks.shared import command_parser, console, lamp, one_thread, save, table, versions
from camssf.colorimetry import adapt, lab, signals_of, white_of
from camssf.grid import BAND, Floats
from camssf_colour import Camera, LitSurfaces, View, spectrum
from camssf_colour.standard import of_surfaces
from camssf_lab.learning.training import maker_of
from tools.pictures import legend, save_png, subplots

NAMES = ("Canon EOS 5D", "Nikon D5100", "Sony ILCE-7M3")
SKIN = View("1964", "D65")
SKINS = {"CES15": 14, "CES18": 17}
"""The skins among the 99 samples, of which TM-30 takes its index of skin."""
PLACE = Path(__file__).parents[1] / "docs" / "images"
SEEN_BY_MATRIX, SEEN_BY_CURVES = "#c0392b", "#2455a4"


def seen(surfaces: Floats, case: Case, power: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """White-balanced signals (n, 3) of surfaces (n, 681), with noise, and their standard error."""
    y = signals_of(surfaces, power, case.curves)
    error = np.hypot(LOW[0] * y, LOW[1])
    return y + error * rng.normal(size=y.shape), error


def by_matrix(y: Floats, case: Case, power: Floats, rng: np.random.Generator) -> Floats:
    """Lab (n, 3) adapted to D65 of signals (n, 3), by the matrix of the D55 chart."""
    white, aim = white_of(power, "1964"), white_of(lamp("D65"), "1964")
    xyz = (y @ through_chart(case, lamp("D55"), rng)) / white_of(lamp("D55")) * white
    return lab(adapt(xyz, white, aim), aim)


def skin(cases: list[Case], cameras: list[Camera], rng: np.random.Generator) -> dict[str, Floats]:
    """Angles (skins, lamps, cameras): true, by the matrix, through the exact and the recovered curves, half-width."""
    keys = ("true", "matrix", "exact", "curves", "half_width")
    angles = {key: np.empty((len(SKINS), len(LAMPS), len(NAMES))) for key in keys}
    skins, prior = unseen()[list(SKINS.values())], prior_without("cie")
    for j, name in enumerate(LAMPS):
        power = lamp(name)
        angles["true"][:, j] = ita(of_surfaces(skins, power, SKIN)[1])[:, None]
        for k, (case, camera) in enumerate(zip(cases, cameras, strict=True)):
            y, error = seen(skins, case, power, rng)
            exact = Camera(case.name, case.curves / case.curves.max(axis=0), np.zeros((0, *case.curves.shape)))
            known, ours = (
                spectrum(one, LitSurfaces(name, y, error), prior=prior, view=SKIN) for one in (exact, camera)
            )
            angles["exact"][:, j, k], angles["curves"][:, j, k] = ita(known.lab), ita(ours.lab)
            angles["half_width"][:, j, k] = half_width(ours.lab, ours.lab_covariance)
            angles["matrix"][:, j, k] = ita(by_matrix(y, case, power, rng))
    return angles


def ita(colours: Floats) -> Floats:
    """Individual typology angle (n,) of Lab (n, 3), degrees."""
    return np.degrees(np.arctan2(colours[:, 0] - 50.0, colours[:, 2]))


def half_width(colours: Floats, covariance: Floats) -> Floats:
    """The angle's 95 % half-width (n,), of Lab's covariance (n, 3, 3), degrees."""
    height, b = colours[:, 0] - 50.0, colours[:, 2]
    slope = np.stack([b, np.zeros_like(b), -height], axis=1) / (height**2 + b**2)[:, None]
    return np.asarray(BAND * np.degrees(np.sqrt(np.einsum("ni,nij,nj->n", slope, covariance, slope))))


def draw_skin(angles: dict[str, Floats]) -> Any:
    """Two skins, five lamps, three cameras."""
    figure, panels = subplots(1, len(SKINS), (9.6, 3.6))
    at = np.arange(len(LAMPS))[:, None] + 0.2 * np.arange(-1, 2)
    dots: dict[str, Any] = {"fmt": "o", "color": SEEN_BY_CURVES, "markersize": 3}
    cross: dict[str, Any] = {"marker": "x", "linestyle": "", "color": SEEN_BY_MATRIX, "markersize": 5}
    for i, (panel, word) in enumerate(zip(panels, SKINS, strict=True)):
        mine = {key: values[i] for key, values in angles.items()}
        panel.hlines(mine["true"][:, 0], at[:, 1] - 0.4, at[:, 1] + 0.4, color="black", linewidth=1)
        panel.plot(at.ravel() - 0.03, mine["matrix"].ravel(), **cross)
        panel.errorbar(at.ravel() + 0.03, mine["curves"].ravel(), mine["half_width"].ravel(), linewidth=1, **dots)
        panel.set_xticks(range(len(LAMPS)), LAMPS)
        panel.set_title(word, fontsize=10)
        panel.set_ylabel("ITA, degrees")
    panels[0].errorbar([], [], [], label="through the curves, 95 %", **dots)
    legend(panels[0], {"matrix of a D55 chart": cross, "true": {"color": "black"}}, loc="upper right")
    return figure


def main(arguments: list[str] | None = None) -> int:
    """The command."""
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("-o", "--out", type=Path, default=PLACE, help="folder of the pictures")
    folder = parser.parse_args(arguments).out
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(SEED)
    curves, bases = left_out()
    cases = [Case(name, curves[name], bases[maker_of(name)]) for name in NAMES]
    cameras = [calibrate(case, SHOTS["two"], rng, off=False) for case in cases]
    angles = skin(cases, cameras, rng)
    save_png(draw_skin(angles), folder / "colour-skin.png", 250)
    error = {way: np.abs(angles[way] - angles["true"]) for way in ("matrix", "exact", "curves")}
    means = {way: values.mean(axis=(1, 2)) for way, values in error.items()}
    means["half_width"] = angles["half_width"].mean(axis=(1, 2))
    means["held"] = (error["curves"] < angles["half_width"]).mean(axis=(1, 2))
    means |= {f"range_{way}": np.ptp(angles[way], axis=2).mean(axis=1) for way in ("matrix", "curves")}
    lines = [
        (word, *(f"{values[i]:.{2 if key == 'held' else 1}f}" for key, values in means.items()))
        for i, word in enumerate(SKINS)
    ]
    head = ("skin", "matrix", "true curves", "curves", "95 % half-width", "held", "range, matrix", "range, curves")
    console().print(table("mean error of the individual typology angle, degrees", head, lines))
    by_skin = {word: {key: float(values[i]) for key, values in means.items()} for i, word in enumerate(SKINS)}
    content = {"ita": by_skin, "versions": versions("colour-science", "matplotlib")}
    print(save("colour-skin", content))
    return 0


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
