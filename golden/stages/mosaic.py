"""The stage `mosaic`: small DNG files by formula, and what a reader must find in them.

Files and expected values are stored: they came from what was written, never from a reader. A new case may leave out
`outputs`: what the reader finds is stored then; what it does not read is added by hand.
"""

from __future__ import annotations

from typing import Any

from golden.contract import Call, Stage, handwritten, limit, words
from golden.forms import Json, digest
from golden.products import read_photo


def run(call: Call) -> dict[str, Any]:
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


_METADATA = words("as_shot_white_xy noise_profile masked_areas bad_pixels")
"""Fields of a file that Python does not read."""
_ROUNDED = words("black color_matrix1 color_matrix2 as_shot_neutral as_shot_white_xy")
"""Fields that are quotients, and so rounded."""


def limits(made: Json, scene: Json) -> list[Json]:
    """Against what was written; fields that Python does not read require `metadata`, and come last."""
    there = sorted(name for name, value in made["outputs"].items() if value is not None)
    return [
        limit(name, "outputs", *(("norm", 1e-15) if name in _ROUNDED else ("exact", 0.0)), *required)
        for names, required in ((set(there) - _METADATA, []), (_METADATA & set(there), ["metadata"]))
        for name in sorted(names)
    ]


STAGE = Stage(
    name="mosaic",
    requires="mosaic",
    cases=lambda: handwritten("mosaic", outputs=True),
    run=run,
    inputs=words("dng"),
    limits=limits,
    outputs=_METADATA
    | words(
        "sha256 width height samples_sha256 cfa black white make model orientation exposure iso color_matrix1 "
        "color_matrix2 as_shot_neutral matrices gain_maps"
    ),
    arrays=frozenset(),
)
