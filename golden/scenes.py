"""Photos of a chart by a formula, which the stages from `signals` to `rivals` share.

A scene simulates photos of a chart by a formula: white frame 12,000 DN times the channel's gain times a fall-off over
the patches, dark frame about 64 DN, noise by a sine of the square of the sample's number (no random generator). The
DN are rounded to 1/1000 and stored; the rounded numbers are the inputs.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from camssf.grid import Floats
from camssf.spectra.charts import faded
from golden.forms import NIKON, Json, resolve

NOISES = {"none": (0.0, 0.0), "low": (0.001, 0.0002), "usual": (0.005, 0.001)}
"""σ = hypot(first · y, second)."""
GAINS = (0.55, 1.0, 0.7)
ALL = list(range(1, 25))
TWELVE = list(range(7, 19))
PLACE = (np.arange(24) % 6 - 2.5) / 2.5, (np.arange(24) // 6 - 1.5) / 2.5
"""x and y of the patches, from the chart's middle, in parts of half its width."""
FAMILY = [[[0.0, 0.15], [0.0], [0.0]], [[0.0, 0.5], [0.0, 0.0, 0.6], [0.0, -0.3, 0.0, 0.5]]]
"""Modes of two uncertain lamps, a daylight and a white LED, as polynomials."""
BOTH = ["D55", "A"]
CANON = {"camera": "Canon EOS 5D Mark II"}
PHONE = {
    "bells": [
        [[0.66, 623.6, 26.9], [0.639, 595.5, 11.9], [0.102, 524.3, 22.6]],
        [[0.915, 548.8, 38.8], [0.291, 514.9, 15.6], [0.265, 495.1, 11.1]],
        [[0.92, 474.9, 30.0], [0.319, 434.2, 16.3], [0.115, 541.1, 62.1]],
    ],
}  # fmt: skip
"""Near the mean of the phones."""
YELLOW_PHONE = {
    "bells": [
        PHONE["bells"][0],
        PHONE["bells"][1] + [[0.5 * height, centre, width] for height, centre, width in PHONE["bells"][0]],
        PHONE["bells"][2],
    ],
}
"""The same with yellow in green's place, G + 0.5 R."""


def moved(nm: float) -> Json:
    """PHONE with all its curves at wavelengths longer by `nm`: the more of it, the more probably no phone."""
    return {"bells": [[[height, centre + nm, width] for height, centre, width in bells] for bells in PHONE["bells"]]}


BETWEEN = {
    "bells": [
        [[0.636, 595.0, 12.8], [0.559, 624.3, 25.9], [0.103, 557.6, 77.1]],
        [[0.688, 553.9, 31.1], [0.518, 507.9, 22.9], [0.155, 529.3, 65.9]],
        [[0.915, 472.8, 29.0], [0.36, 435.5, 15.4], [0.101, 533.1, 56.1]],
    ],
}  # fmt: skip
"""Half-way from PHONE to the mean of the cameras."""
ODD = {"bells": [[[1.0, 632, 18]], [[1.0, 560, 22]], [[1.0, 440, 18]]]}
"""Narrow filters far from each other, unlike any camera."""
FLAT = {"constant": 1.0, "shape": [681]}


def photograph(
    camera: Json,
    lamps: Sequence[str],
    reflectance: Any,
    *,
    noise: str = "low",
    white: Any = FLAT,
    shade: float = 0.3,
    fading: float = 0.0,
) -> dict[str, Floats]:
    """Chart, white and dark frame (k, n, 3) in DN, and the standard error of the signals."""
    R, s = faded(resolve(reflectance), fading), resolve(camera)
    L, rho = resolve({"lamps": list(lamps)}), resolve(white)
    y = np.stack([((R * lamp) @ s) / ((rho * lamp) @ s) for lamp in L])
    k, n, _ = y.shape
    j, i, c = np.meshgrid(np.arange(k), np.arange(n), np.arange(3), indexing="ij")
    dark = 64.0 + 0.25 * ((5 * i + 3 * c + j) % 4)
    fall = 1.0 - shade * ((7 * i) % 24) / 24.0
    frame = np.round(dark + 12_000.0 * np.array(GAINS) * fall, 3)
    part, least = NOISES[noise]
    sigma = np.hypot(part * y, least)
    number = ((j * n + i) * 3 + c + 1).astype(float)
    e = sigma * np.sqrt(2.0) * np.sin(12.9898 * number**2)
    return {
        "chart": np.round(dark + (y + e) * (frame - dark), 3),
        "white": frame,
        "dark": dark,
        "standard_error": np.round(sigma, 6),
    }


SCENE: Json = {
    "camera": NIKON, "lamps": ["D55"], "patches": ALL, "taken": "babelcolor", "noise": "low", "fading": 0.0,
    "card": FLAT,
}  # fmt: skip
"""The base case of `scene`; taken, fading: table and fading of the chart that was photographed; card: the white's."""


def scene(change: Json) -> Json:
    """Inputs of the stage ssf or choice: a photo as SCENE says, and how the product solves it, but for the change."""
    told = SCENE | {key: change[key] for key in SCENE.keys() & change.keys()}
    known, lamps, white = {"chart": "babelcolor", "patches": told["patches"]}, told["lamps"], told["card"]
    taken = known | {"chart": told["taken"]}
    photo = photograph(told["camera"], lamps, taken, noise=told["noise"], white=white, fading=told["fading"])
    k, n, _ = photo["chart"].shape
    inputs: Json = {
        "basis": "cameras",
        **photo,
        "reflectance": known,
        "chart_tolerance": 0.03,
        "white_reflectance": white,
        "white_tolerance": 0.01,
        "lamp": {"lamps": lamps},
        "lamp_tolerance": 0.0,
        "lamp_modes": {"polynomials": change.get("modes", [[] for _ in lamps])},
        "l2": 1.0,
        "gamma": 0.05,
        "nonnegative": False,
    } | {key: value for key, value in change.items() if key not in SCENE and key != "modes"}
    for tolerance, shape in (("chart_tolerance", [n]), ("lamp_tolerance", [k])):
        if isinstance(inputs[tolerance], float):
            inputs[tolerance] = {"constant": inputs[tolerance], "shape": shape}
    return inputs


def gain_modes(own: float | None = None) -> list[list[float]]:
    """Linear and quadratic gain modes (5, 24), and one of the white patch of this size, 0 on the white patch."""
    x, y = PLACE
    ways = np.stack([0.2 * x, 0.2 * y, 0.3 * x**2, 0.3 * x * y, 0.3 * y**2])
    if own is not None:
        ways = np.concatenate([ways, own * (np.arange(24) == 18)[None]])
    modes: list[list[float]] = np.round(ways - ways[:, [18]], 9).tolist()
    return modes


def uneven_light(bend: float = 1.0) -> Floats:
    """Uneven light (24,) on the patches, a quadratic times a plane, 1 on the white patch."""
    x, y = PLACE
    light = (1.0 - bend * (0.12 * (x - 0.3) ** 2 + 0.12 * (y + 0.2) ** 2)) * (1.0 + 0.07 * bend * x)
    return np.asarray(np.round(light / light[18], 9))


def frames(
    camera: Json = NIKON,
    lamps: Sequence[str] = ("D55",),
    *,
    taken: str = "babelcolor",
    white: Any = FLAT,
    **more: Any,
) -> list[Json]:
    """Shots as measured: mean, standard error and clipped share of each frame; taken: the chart's table."""
    photo = photograph(camera, lamps, {"chart": taken, "patches": ALL}, white=white, **more)
    shots = []
    for j in range(len(lamps)):
        D = photo["dark"][j]
        shot: Json = {"black": [64.0, 64.0, 64.0], "saturation": 16_383.0}
        for name in ("chart", "white", "dark"):
            mean = photo[name][j]
            error = np.round(0.25 + 0.05 * np.sqrt(np.maximum(mean - D, 0.0)) / 2.0, 4)
            shot[name] = {"mean": mean, "standard_error": error, "clipped": {"constant": 0.0, "shape": [24, 3]}}
        shots.append(shot)
    return shots


def put(shot: Json, frame: str, key: str, where: Any, value: float) -> Json:
    """The shot with one statistic changed."""
    array = np.array(resolve(shot[frame][key]))
    array[where] = value
    return shot | {frame: shot[frame] | {key: array}}


def clip(shot: Json, frame: str, patches: slice, share: float = 0.5, channel: int = 1) -> Json:
    """The shot with a share of some patches' samples clipped."""
    return put(shot, frame, "clipped", (patches, channel), share)


def evenly(camera: Json = NIKON, lamps: Sequence[str] = ("D55",), **more: Any) -> list[Json]:
    """Shots in even light whose white is the chart's white patch."""
    return frames(camera, lamps, white=resolve({"chart": "babelcolor", "patches": [19]})[0], shade=0.0, **more)


def dimmed(shots: list[Json], light: Floats) -> list[Json]:
    """The same shots in uneven light, without white frames."""
    lit = []
    for shot in shots:
        dark = shot["dark"]["mean"]
        mean = np.round(dark + light[:, None] * (shot["chart"]["mean"] - dark), 3)
        lit.append(shot | {"white": None, "chart": shot["chart"] | {"mean": mean}})
    return lit
