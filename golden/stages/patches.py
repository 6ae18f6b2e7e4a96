"""The stage `patches`: the statistics of patches in one photo or three."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from camssf.photo.find.pose import Pose
from camssf.photo.patches import FrameMeans, measure_patches
from golden.contract import Call, Keys, Stage, always, stored, words
from golden.dngs import Tags, gain_map, opcode_list
from golden.drawing import BLACK, TILTED, WHITE, Samples, draw, file, photo_case, rounded, turned
from golden.forms import Json
from golden.products import read_photo

_STATISTICS = words("mean standard_error count clipped dead gradient greens")


def _shaded(samples: Samples, by: int) -> Samples:
    """The samples in light that falls off from left to right, by x / `by`."""
    x = np.arange(samples.shape[1], dtype=np.int64)
    above = samples.astype(np.int64) - BLACK
    return (BLACK + above * (4096 - 4096 * x // by) // 4096).astype(np.uint16)


def cases() -> Iterator[Json]:
    """All cases."""
    view = turned(24, 0)
    width, height = view.size
    quads = rounded(view.quads(), 4)
    y, x = np.mgrid[0:height, 0:width].astype(np.int64)
    photo = draw(view, unrest=23)
    flat = (9000 + (41 * x + 17 * y + x * y) % 31 - 15).astype(np.uint16)
    dark = (BLACK + (13 * x + 7 * y + x * y) % 5 - 2).astype(np.uint16)

    def patches(
        name: str,
        comment: str,
        frames: dict[str, tuple[str, bytes]],
        *,
        places: Any = None,
        shading: str = "as-stored",
        expect: str = "success",
    ) -> Json:
        inputs: Json = {role: frames[role][0] if role in frames else None for role in ("photo", "white", "dark")}
        inputs |= {"quads": quads if places is None else places, "lens_shading": shading}
        return photo_case(f"patches/{name}", comment, inputs, dict(frames.values()), expect)

    one = {"photo": ("patches-chart.dng", file(photo))}
    white = {"white": ("patches-white.dng", file(_shaded(flat, 700)))}
    black = {"dark": ("patches-dark.dng", file(dark))}
    yield patches("chart-alone", "24 patches of one photo.", one)
    shaded = {"photo": ("patches-shaded.dng", file(_shaded(photo, 700)))}
    yield patches("triple", "Chart, white and dark frame, light that falls off.", shaded | white | black)
    yield patches("no-dark", "Chart and white frame.", shaded | white)
    dusty, dusty_flat = photo.copy(), _shaded(flat, 700)
    dusty[(7 * x + 3 * y) % 61 == 0] = 16383
    dusty_flat[(5 * x + 11 * y) % 73 == 0] = 300
    yield patches(
        "dust", "Hot pixels in the chart photo, dust in the white frame: one mask for all frames.",
        {"photo": ("patches-hot.dng", file(dusty)), "white": ("patches-dust.dng", file(dusty_flat))} | black,
    )  # fmt: skip
    lot = (29 * x + 37 * y + x * y) % 97
    tails = (photo + np.where(lot < 80, lot % 8, 2 * (lot - 80))).astype(np.uint16)
    yield patches(
        "tails", "Noise with long tails: which samples go hangs on both middle values of the sorted ones.",
        {"photo": ("patches-tails.dng", file(tails))},
    )  # fmt: skip
    bright = np.minimum(BLACK + (photo.astype(np.int64) - BLACK) * 3 // 2, WHITE + (x + y) % 3).astype(np.uint16)
    yield patches(
        "clipped", "The white patch at the ceiling in green.", {"photo": ("patches-clipped.dng", file(bright))}
    )
    cfa = bytes((1, 2, 0, 1))
    yield patches(
        "tilted", "A turned and tilted chart, GBRG: quads with slanted edges.",
        {"photo": ("chart-tilted.dng", file(draw(TILTED, cfa), cfa=cfa))}, places=rounded(TILTED.quads(), 4),
    )  # fmt: skip
    maps = [
        gain_map(
            [[1.0 + (3 * i + 2 * j + k) / 32 for j in range(5)] for i in range(4)],
            (row, column, height, width), (2, 2), (1 / 3, 1 / 4),
        )
        for k, (row, column) in enumerate(np.ndindex(2, 2))
    ]  # fmt: skip
    tags: Tags = {51009: opcode_list(*maps)}
    mapped = {"photo": ("patches-mapped.dng", file(_shaded(photo, 700), tags=tags))}
    yield patches("shading-stored", "A file with four gain maps, its samples as stored.", mapped)
    yield patches("shading-applied", "The maps applied to what lies above black.", mapped, shading="apply")
    yield patches(
        "shading-triple", "The chart photo's maps applied to the white and dark frame too.", mapped | white | black,
        shading="apply",
    )  # fmt: skip
    yield patches(
        "iso-rounded", "The white frame at ISO 101: files round what was 100.",
        one | {"white": ("patches-white-rounded.dng", file(_shaded(flat, 700), iso=101))}, places=quads[:1],
    )  # fmt: skip
    sixteen = [[[23.0, 23.0], [38.0, 23.0], [38.0, 38.0], [23.0, 38.0]]]
    yield patches("sixteen", "16 samples of each position are just enough.", one, places=sixteen)
    fifteen = [[[21.0, 25.0], [40.0, 25.0], [40.0, 36.0], [21.0, 36.0]]]
    longer = {"white": ("patches-white-longer.dng", file(_shaded(flat, 700), exposure=(253, 15000)))}
    outside = [*quads[:23], [[v[0] + 40, v[1]] for v in quads[23]]]
    small = rounded(np.array(quads) * 0.5 + view.quads().mean(axis=1, keepdims=True) * 0.5, 4)
    louder = {"white": ("patches-white-iso.dng", file(_shaded(flat, 700), iso=200))}
    for name, comment, code, frames, places, shading in (
        ("outside", "A patch leaves the photo.", "chart_not_found", one, outside, "as-stored"),
        ("small", "Patches of half the edge hold too few samples.", "chart_not_found", one, small, "as-stored"),
        ("iso", "The white frame at another ISO.", "frames_differ", one | louder, None, "as-stored"),
        ("longer", "The white frame exposed 1.2 % longer.", "frames_differ", one | longer, quads[:1], "as-stored"),
        ("fifteen", "15 samples of each position are too few.", "chart_not_found", one, fifteen, "as-stored"),
        ("no-map", "Shading to be applied, and no map.", "invalid_argument", one, None, "apply"),
        ("word", "Another word for the shading.", "invalid_argument", one, None, "maybe"),
    ):
        yield patches(f"error-{name}", comment, frames, places=places, shading=shading, expect=code)


def run(call: Call) -> dict[str, Any]:
    """The outputs of a case."""
    given = call.given
    photos = {role: given[role] and read_photo(given[role]) for role in ("photo", "white", "dark")}
    pose = Pose(
        layout="classic24", corners=np.zeros((4, 2)), patches=given["quads"], quarter_turns=0, method="by hand",
        score=1.0, notes=(),
    )  # fmt: skip
    means = measure_patches(
        photos["photo"], pose, white=photos["white"], dark=photos["dark"], lens_shading=given["lens_shading"]
    )
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
    return stored(made, [(name, *_statistic(name, made["inputs"])) for name in sorted(made["outputs"])])


STAGE = Stage(
    name="patches",
    keys=Keys(
        words("photo white dark quads lens_shading"),
        words("black saturation noise_step noise_unlike noise_like")
        | {f"{frame}_{name}" for frame in ("chart", "white", "dark") for name in _STATISTICS},
        arrays=words("quads"),
    ),
    requires=always("patches"),
    cases=cases,
    run=run,
    limits=limits,
)
