"""The stage `finder`: small pictures with one, two or no charts, and what is found in them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from camssf.photo.find.candidates import find_candidates
from camssf.photo.find.picture import SearchImage, codes_of_bytes, codes_of_light, codes_of_mosaic, rgb_of_yuv
from camssf.photo.find.search import own_kind, plain_signals
from camssf.photo.read.dng import Mosaic
from golden.contract import Call, Stage, words
from golden.products import read_card, read_photo

BLACK = 256
"""Black level of the photos, DN."""


def run(call: Call) -> dict[str, Any]:
    """The stage `finder`: charts found in one of the forms of a photo; the points of all charts concatenated."""
    given = call.given
    photo = read_photo(given["dng"])
    kinds = None
    if "layout" in given:
        table = read_card(given)
        kinds = (own_kind(table.layout, plain_signals(table)),)
    result = find_candidates(_searched(photo, given["form"]), kinds)
    seen = result.candidates
    return {
        "findings": list(result.findings),
        "kinds": [each.kind for each in seen],
        "mirrored": [each.mirrored for each in seen],
        "seen": [each.blobs for each in seen],
        "corners": np.array([each.corners for each in seen]).reshape(-1, 2),
        "patches": np.concatenate([np.zeros((0, 2)), *(each.patches for each in seen)]),
        "confidence": np.array([each.confidence for each in seen]),
    }


def planes(photo: Mosaic) -> NDArray[np.int64]:
    """(h, w, 3) DN above black (256), at least 0: red, the first green and blue of every cell."""
    first = [photo.cfa.index(letter) for letter in "RGB"]
    height, width = (side // 2 for side in photo.samples.shape)
    cells = [photo.samples[k // 2 :: 2, k % 2 :: 2][:height, :width].astype(np.int64) for k in first]
    return np.maximum(np.stack(cells, axis=2) - BLACK, 0)


def _searched(photo: Mosaic, form: str) -> SearchImage:
    if form == "mosaic":
        return codes_of_mosaic(photo)
    light = planes(photo)
    if form == "light":
        return codes_of_light(light.astype(np.float32))
    picture = (2 * np.floor(np.sqrt(light))).astype(np.uint8)
    if form == "yuv":
        y, blue, red = (picture[:, :, channel].astype(np.int64) for channel in (1, 2, 0))
        u, v = (np.clip(128 + (each - y) // 2, 0, 255)[::2, ::2].astype(np.uint8) for each in (blue, red))
        picture = rgb_of_yuv(picture[:, :, 1], u, v)
    return codes_of_bytes(picture[:, :, 1] if form == "luma" else picture)


STAGE = Stage(
    name="finder",
    run=run,
    inputs=words("dng form"),
    optional=words("layout csv"),
    arrays=frozenset(),
    limits=(
        ("exact", 0.0, "findings kinds mirrored seen"),
        ("norm", 1e-13, "corners patches"),
        ("norm", 3e-9, "confidence"),
    ),
)
