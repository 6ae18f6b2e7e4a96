"""The golden DNG files: judged by LibRaw, by tifffile and by libjpeg-turbo."""

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


@pytest.mark.full
@pytest.mark.parametrize("name", [name for name in CASES if name not in {*BY_LIBRAW, "rows-padded"}])
def test_tifffile_finds_the_same_samples(name: str) -> None:
    """What LibRaw does not decode: tifffile with imagecodecs does, but for padded rows."""
    pytest.importorskip("imagecodecs", reason="imagecodecs is not installed (extra: dev)")
    content = (ROOT / "dng" / f"{name}.dng").read_bytes()
    with tifffile.TiffFile(io.BytesIO(content)) as file:
        page = raw_page(file)
        if page.compression == 7:  # tifffile takes two components for two samples a pixel
            import imagecodecs

            pieces = [content[at : at + n] for at, n in zip(page.dataoffsets, page.databytecounts, strict=True)]
            found = np.concatenate([imagecodecs.jpeg_decode(piece).ravel() for piece in pieces])
        else:
            found = page.asarray().ravel()
    assert digest(found) == CASES[name]["outputs"]["samples_sha256"]
