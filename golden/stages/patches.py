"""The stage `patches`: the statistics of patches in one photo or three."""

from __future__ import annotations

from typing import Any

import numpy as np

from camssf.photo.patches import FrameMeans, measure_patches
from golden.contract import Call, Stage, stored, words
from golden.forms import Json
from golden.products import pose_by_hand, read_photo


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
    run=run,
    inputs=words("photo white dark quads lens_shading"),
    arrays=words("quads"),
    limits=limits,
    outputs=words("black saturation noise_step noise_unlike noise_like")
    | {f"{frame}_{name}" for frame in ("chart", "white", "dark") for name in FrameMeans.__annotations__},
)
