"""The stage `patches`: the statistics of patches in one photo or three."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TypeAlias

import numpy as np

from camssf.photo.patches import FrameMeans, measure_patches
from golden.contract import Call, Stage, case, stored, words
from golden.forms import Json
from golden.products import pose_by_hand, read_photo
from golden.views import TILTED, rounded, turned

Row: TypeAlias = tuple[str, str, str, Json, str]
"""Name, comment, the photos of chart, white and dark frame, what else is unlike the base case, and the error code."""
VIEW = turned(24, 0)


def rows() -> list[Row]:
    """All cases."""
    quads, apply = np.round(VIEW.quads(), 4), {"lens_shading": "apply"}
    first, tilted = {"quads": rounded(quads[:1], 4)}, {"quads": rounded(TILTED.quads(), 4)}
    outside = quads.tolist()
    outside[23] = [[x + 40, y] for x, y in outside[23]]

    def box(left: float, top: float, right: float, bottom: float) -> Json:
        return {"quads": [[[left, top], [right, top], [right, bottom], [left, bottom]]]}

    lost, differ, wrong = "chart_not_found", "frames_differ", "invalid_argument"
    return [
        ("chart-alone", "24 patches of one photo.", "patches-chart", {}, ""),
        ("triple", "Chart, white and dark frame, light that falls off.",
         "patches-shaded patches-white patches-dark", {}, ""),
        ("dust", "Hot pixels in the chart photo, dust in the white frame: one mask for all frames.",
         "patches-hot patches-dust patches-dark", {}, ""),
        ("tails", "Noise with long tails: which samples go hangs on both middle values of the sorted ones.",
         "patches-tails", {}, ""),
        ("clipped", "The white patch at the ceiling in green.", "patches-clipped", {}, ""),
        ("tilted", "A turned and tilted chart, GBRG: quads with slanted edges.", "chart-tilted", tilted, ""),
        ("shading-stored", "A file with four gain maps, its samples as stored.", "patches-mapped", {}, ""),
        ("shading-applied", "The maps applied to what lies above black.", "patches-mapped", apply, ""),
        ("shading-triple", "The chart photo's maps applied to the white and dark frame too.",
         "patches-mapped patches-white patches-dark", apply, ""),
        ("iso-rounded", "The white frame at ISO 101: files round what was 100.",
         "patches-chart patches-white-rounded", first, ""),
        ("sixteen", "16 samples of each position are just enough.", "patches-chart", box(23.0, 23.0, 38.0, 38.0), ""),
        ("error-fifteen", "15 samples of each position are too few.",
         "patches-chart", box(21.0, 25.0, 40.0, 36.0), lost),
        ("error-outside", "A patch leaves the photo.", "patches-chart", {"quads": outside}, lost),
        ("error-iso", "The white frame at another ISO.", "patches-chart patches-white-iso", {}, differ),
        ("error-longer", "The white frame exposed 1.2 % longer.",
         "patches-chart patches-white-longer", first, differ),
        ("error-no-map", "Shading to be applied, and no map.", "patches-chart", apply, wrong),
    ]  # fmt: skip


def cases() -> Iterator[Json]:
    """All cases."""
    base = {"quads": rounded(VIEW.quads(), 4), "lens_shading": "as-stored"}
    for name, comment, names, change, code in rows():
        frames: Json = dict.fromkeys(("photo", "white", "dark"))
        frames |= zip(frames, (f"{photo}.dng" for photo in names.split()), strict=False)
        yield case(f"patches/{name}", comment, frames | base | change, expect=code or "success")


def run(call: Call) -> dict[str, Any]:
    """The outputs of a case."""
    given = call.given
    photos = {role: given[role] and read_photo(given[role]) for role in ("photo", "white", "dark")}
    frames = {"white": photos["white"], "dark": photos["dark"], "lens_shading": given["lens_shading"]}
    means = measure_patches(photos["photo"], pose_by_hand(given["quads"]), **frames)
    found: dict[str, Any] = {"black": means.black, "saturation": means.saturation}
    assert means.noise is not None
    found["noise_step"] = means.noise.step
    for name in ("unlike", "like"):
        estimate = getattr(means.noise, name)
        found[f"noise_{name}"] = None if estimate is None else np.array([estimate.value, estimate.error])
    for frame in ("chart", "white", "dark"):
        statistics = getattr(means, frame)
        for name in FrameMeans.__annotations__:
            found[f"{frame}_{name}"] = None if statistics is None else getattr(statistics, name)
    return found


def _statistic(name: str, inputs: Json) -> tuple[str, float]:
    """Metric and bound of a patch statistic; quotients of integer sums are exact, unless a gain was applied."""
    plain = inputs.get("lens_shading") == "as-stored"
    if name.endswith(("_standard_error", "_gradient")):
        return "norm", 1e-13
    if name in ("noise_unlike", "noise_like"):
        return "norm", 1e-12
    return ("norm", 1e-15) if name.endswith(("_mean", "_greens")) and not plain else ("exact", 0.0)


def limits(made: Json, scene: Json) -> list[Json]:
    """Against the stored outputs."""
    return stored(made, [(*_statistic(name, made["inputs"]), name) for name in sorted(made["outputs"])])


STAGE = Stage(
    name="patches",
    requires="patches",
    cases=cases,
    run=run,
    inputs=words("photo white dark quads lens_shading"),
    arrays=words("quads"),
    limits=limits,
    outputs=words("black saturation noise_step noise_unlike noise_like")
    | {f"{frame}_{name}" for frame in ("chart", "white", "dark") for name in FrameMeans.__annotations__},
)
