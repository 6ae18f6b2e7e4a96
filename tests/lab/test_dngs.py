"""The writer of DNG files and its golden files: judged by LibRaw, by tifffile and by libjpeg-turbo."""

import hashlib
import io
from typing import Any

import numpy as np
import pytest
import rawpy
import tifffile

from golden.forms import ROOT
from golden.reading import read_case
from golden.running import LACKING

CASES: dict[str, dict[str, Any]] = {
    path.stem: case
    for path in sorted((ROOT / "cases" / "mosaic").glob("*.json"))
    if (case := read_case(path))["expect"] == "success"
}
WRONG = {
    "deflate-differences", "deflate-packed", "jpeg-point-transform", "jpeg-restart-predictor-6", "strips-backwards",
    "counts-large", "rows-padded",
}  # fmt: skip
"""Files that LibRaw decodes wrongly or not at all."""
BY_LIBRAW = [name for name, case in CASES.items() if not LACKING & set(case["requires"]) and name not in WRONG]


def digest(samples: np.ndarray) -> str:
    return hashlib.sha256(np.ascontiguousarray(samples, dtype="<u2").tobytes()).hexdigest()


def area(content: bytes) -> tuple[slice, slice]:
    """The active area, by tifffile."""
    with tifffile.TiffFile(io.BytesIO(content)) as file:
        tags = raw_page(file).tags
        top, left, bottom, right = tags[50829].value if 50829 in tags else (0, 0, None, None)
    return slice(top, bottom), slice(left, right)


def raw_page(file: tifffile.TiffFile) -> tifffile.TiffPage:
    def walk(pages: Any) -> Any:
        for page in pages:
            yield page
            yield from walk(page.pages or [])

    (found,) = [page for page in walk(file.pages) if page.photometric == 32803]
    return found


@pytest.mark.parametrize("name", BY_LIBRAW)
def test_libraw_finds_the_same_samples(name: str) -> None:
    content = (ROOT / "dng" / f"{name}.dng").read_bytes()
    with rawpy.imread(io.BytesIO(content)) as raw:
        found = digest(raw.raw_image[area(content)])
    assert found == CASES[name]["outputs"]["samples_sha256"]
