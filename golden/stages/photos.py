"""The stages `mosaic`, `pose` and `patches`: what a DNG file holds, where the chart lies in it, and its patches.

Their files are small and made by formula. Cases and photos are written by hand, and so is what `mosaic` must read: it
came from what was written, never from a reader. A new case of it may leave out `outputs`: what the reader finds is
stored then; what it does not read is added by hand.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from camssf.photo.find.pose import find_chart
from camssf.photo.patches import FrameMeans, measure_patches
from camssf.spectra import read_chart
from golden.contract import Call, Stage, limit, stored, words
from golden.forms import Json, digest
from golden.products import pose_by_hand, read_card, read_photo

_METADATA = words("as_shot_white_xy noise_profile masked_areas bad_pixels")
"""Fields of a file that Python does not read."""
_ROUNDED = words("black color_matrix1 color_matrix2 as_shot_neutral as_shot_white_xy")
"""Fields that are quotients, and so rounded."""


def read_mosaic(call: Call) -> dict[str, Any]:
    """The stage `mosaic`: what the reader finds; Python does not read the fields of `metadata`."""
    photo = read_photo(call.given["dng"])
    height, width = photo.samples.shape
    names = ("sha256", "cfa", "white", "make", "model", "exposure", "iso", "orientation")
    arrays = {name: getattr(photo, name) for name in ("color_matrix1", "color_matrix2", "as_shot_neutral", "black")}
    maps = [
        {name: getattr(gain, name) for name in ("plane", "planes", "row_pitch", "column_pitch")}
        | {name: list(getattr(gain, name)) for name in ("spacing", "origin")}
        | {"list": gain.stage, "area": [gain.top, gain.left, gain.bottom, gain.right], "gains": gain.gains.tolist()}
        for gain in photo.gain_maps
    ]
    return {
        **{name: getattr(photo, name) for name in names},
        **{name: None if value is None else value.ravel() for name, value in arrays.items()},
        "width": width,
        "height": height,
        "samples_sha256": digest(photo.samples.astype("<u2").tobytes()),
        "matrices": [matrix.light for matrix in photo.colour_matrices],
        "gain_maps": maps,
        **dict.fromkeys(("as_shot_white_xy", "noise_profile")),
        **{name: [] for name in ("masked_areas", "bad_pixels")},
    }


def mosaic_limits(made: Json, scene: Json) -> list[Json]:
    """Against what was written; fields that Python does not read require `metadata`."""
    return [
        limit(name, "outputs", *(("norm", 1e-15) if name in _ROUNDED else ("exact", 0.0)),
              *(["metadata"] if name in _METADATA else []))
        for name, value in sorted(made["outputs"].items())
        if value is not None
    ]  # fmt: skip


def place(call: Call) -> dict[str, Any]:
    """The stage `pose`: the corners by hand, and the chart's pose that follows from them."""
    given = call.given
    table = read_card(given) if "layout" in given else read_chart(given["table"])
    pose = find_chart(read_photo(given["dng"]), table, corners=given["corners"])
    measured = {name: getattr(pose, name) for name in ("corners", "quarter_turns", "score")}
    return measured | {"quads": pose.patches, "kept": bool(pose.notes)}


def measure(call: Call) -> dict[str, Any]:
    """The stage `patches`: the statistics of patches in one photo or three."""
    given = call.given
    photos = {role: given[role] and read_photo(given[role]) for role in ("photo", "white", "dark")}
    frames = {"white": photos["white"], "dark": photos["dark"], "lens_shading": given["lens_shading"]}
    means = measure_patches(photos["photo"], pose_by_hand(given["quads"]), **frames)
    assert means.noise is not None
    measured: dict[str, Any] = {
        "black": means.black, "saturation": means.saturation, "noise_step": means.noise.step,
    }  # fmt: skip
    for name in ("unlike", "like"):
        estimate = getattr(means.noise, name)
        measured[f"noise_{name}"] = None if estimate is None else np.array([estimate.value, estimate.error])
    for frame in ("chart", "white", "dark"):
        statistics = getattr(means, frame)
        for name in FrameMeans.__annotations__:
            measured[f"{frame}_{name}"] = None if statistics is None else getattr(statistics, name)
    return measured


def _statistic(name: str, inputs: Json) -> tuple[str, float]:
    """Metric and bound of a patch statistic; quotients of integer sums are exact, unless a gain was applied."""
    plain = inputs.get("lens_shading") == "as-stored"
    if name.endswith(("_standard_error", "_gradient")):
        return "norm", 1e-13
    if name in ("noise_unlike", "noise_like"):
        return "norm", 1e-12
    return ("norm", 1e-15) if name.endswith(("_mean", "_greens")) and not plain else ("exact", 0.0)


def patches_limits(made: Json, scene: Json) -> list[Json]:
    """Against the stored outputs."""
    return stored(made, [(*_statistic(name, made["inputs"]), name) for name in sorted(made["outputs"])])


STAGES = (
    Stage(
        name="mosaic",
        run=read_mosaic,
        inputs=words("dng"),
        limits=mosaic_limits,
        outputs=_METADATA
        | words(
            "sha256 width height samples_sha256 cfa black white make model orientation exposure iso color_matrix1 "
            "color_matrix2 as_shot_neutral matrices gain_maps"
        ),
        written=True,
        arrays=frozenset(),
    ),
    Stage(
        name="pose",
        run=place,
        inputs=words("dng table corners"),
        optional=words("layout csv"),
        arrays=words("corners"),
        limits=(("norm", 1e-9, "corners quads score"), ("exact", 0.0, "quarter_turns kept")),
    ),
    Stage(
        name="patches",
        run=measure,
        inputs=words("photo white dark quads lens_shading"),
        arrays=words("quads"),
        limits=patches_limits,
        outputs=words("black saturation noise_step noise_unlike noise_like")
        | {f"{frame}_{name}" for frame in ("chart", "white", "dark") for name in FrameMeans.__annotations__},
    ),
)
