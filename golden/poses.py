"""The cases of the stages `pose` and `patches`: photos of a chart, drawn with integer arithmetic.

Each pixel is the mean of 4 × 4 points. A point's position in the chart's lattice (patch centres at integers) is a
quotient of two sums with integer coefficients, so every machine draws the same samples. Patches are uniform, gaps and
surround dark; a formula of the position replaces noise.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from camssf.grid import WAVELENGTHS, Floats
from golden.dngs import JPEG, LONG, RATIONAL, SHORT, Dng, Tags, gain_map, opcode_list
from golden.reading import Json, chart

BLACK, WHITE = 256, 15000
GAP, TABLE = 420, 1900
"""Levels between the patches, and around the chart, DN."""
SIDE = (44, 100)
"""Half a patch's edge as a fraction of the pitch: 44 / 100."""
Samples = NDArray[np.uint16]


@dataclass(frozen=True)
class View:
    """A chart's pose: maps px (x, y) to lattice (u, v) = (p + q · (x, y)) / (r + s · (x, y)), integer coefficients.

    Attributes:
        size: width, height, px.
        u, v: (p, q_x, q_y) of both numerators; x, y in eighths of a pixel.
        w: (r, s_x, s_y) of the denominator.
    """

    size: tuple[int, int]
    u: tuple[int, int, int]
    v: tuple[int, int, int]
    w: tuple[int, int, int]

    def corners(self) -> Floats:
        """(4, 2) px of the block's outer corners."""
        low, high = -0.44, np.array([5.44, 3.44])
        return self.places(np.array([[low, low], [high[0], low], high, [low, high[1]]]))

    def quads(self) -> Floats:
        """(24, 4, 2) px of the patches' corners."""
        at = np.array([[i % 6, i // 6] for i in range(24)], float)[:, None]
        return self.places(at + 0.44 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]))

    def places(self, lattice: Floats) -> Floats:
        """Pixel positions (..., 2) of lattice positions (..., 2): the inverse map."""
        (p, a, b), (q, c, d), (r, e, f) = self.u, self.v, self.w
        u, v = lattice[..., 0], lattice[..., 1]
        m, n = (a - e * u, b - f * u), (c - e * v, d - f * v)
        right = (r * u - p, r * v - q)
        determinant = m[0] * n[1] - m[1] * n[0]
        x = (right[0] * n[1] - right[1] * m[1]) / determinant
        y = (m[0] * right[1] - n[0] * right[0]) / determinant
        return np.stack([x, y], axis=-1) / 8


def turned(pitch: int, turns: int, margin: int = 30) -> View:
    """An upright chart, or one rotated clockwise by quarter turns; `pitch` px between patch centres."""
    wide, high = 5 * pitch + 2 * margin, 3 * pitch + 2 * margin
    size = (wide, high) if turns % 2 == 0 else (high, wide)
    unit, first = (8 * pitch, 0, 0), -8 * margin
    ways = (
        ((first, 1, 0), (first, 0, 1)),
        ((first, 0, 1), (8 * (size[0] - 1 - margin), -1, 0)),
        ((8 * (size[0] - 1 - margin), -1, 0), (8 * (size[1] - 1 - margin), 0, -1)),
        ((8 * (size[1] - 1 - margin), 0, -1), (first, 1, 0)),
    )
    return View(size, *ways[turns], unit)


# 1000 times cos and sin of 20°, a pitch of 24 px, and a tilt that makes the far side a tenth smaller
TILTED = View((224, 184), (-50 * 8 * 940, 940, 342), (-9 * 8 * 940, -342, 940), (24 * 8 * 1000, 11, 17))


@cache
def levels() -> NDArray[np.int64]:
    """(24, 3) DN of the patches: BabelColor's table through three Gaussian curves; multiples of 4 above black."""
    curves = np.exp(-4 * np.log(2) * ((WAVELENGTHS[:, None] - np.array([600.0, 540.0, 455.0])) / 90) ** 2)
    signals = chart("babelcolor") @ (curves / curves.sum(axis=0)) * np.array([0.6, 1.0, 0.75])
    whole: NDArray[np.int64] = BLACK + 4 * np.rint(3000 * signals).astype(np.int64)
    return whole


def draw(view: View, cfa: bytes = bytes((0, 1, 1, 2)), *, unrest: int = 7, mirrored: bool = False) -> Samples:
    """The photo's samples, without any change."""
    width, height = view.size
    colour = np.tile(np.array(list(cfa)).reshape(2, 2), (height // 2 + 1, width // 2 + 1))[:height, :width]
    total = np.zeros((height, width), np.int64)
    table = levels()
    y, x = np.mgrid[0:height, 0:width].astype(np.int64)
    for down in (-3, -1, 1, 3):
        for across in (-3, -1, 1, 3):
            X, Y = 8 * x + across, 8 * y + down
            W = view.w[0] + view.w[1] * X + view.w[2] * Y
            U, V = (s[0] + s[1] * X + s[2] * Y for s in (view.u, view.v))
            i, j = (2 * U + W) // (2 * W), (2 * V + W) // (2 * W)  # the nearest patch
            inside = (abs(U - i * W) * SIDE[1] <= SIDE[0] * W) & (abs(V - j * W) * SIDE[1] <= SIDE[0] * W)
            known = (i >= 0) & (i < 6) & (j >= 0) & (j < 4)
            board = (W * -62 <= 100 * U) & (100 * U <= W * 562) & (W * -62 <= 100 * V) & (100 * V <= W * 362)
            column = 5 - i if mirrored else i
            patch = np.where(known, 6 * np.clip(j, 0, 3) + np.clip(column, 0, 5), 0)
            total += np.where(inside & known, table[patch, colour], np.where(board, GAP, TABLE))
    noise = (29 * x + 37 * y + x * y) % unrest - unrest // 2 if unrest else 0
    return (total // 16 + noise).astype(np.uint16)


def file(
    samples: Samples,
    *,
    cfa: bytes = bytes((0, 1, 1, 2)),
    tags: Tags | None = None,
    iso: int = 100,
    exposure: Sequence[int] = (1, 60),
) -> bytes:
    """The bytes of a DNG: 14 bits, lossless JPEG, black 256, white 15000."""
    more: Tags = {50714: (SHORT, [BLACK]), 50717: (LONG, [WHITE])}
    exif: Tags = {33434: (RATIONAL, list(exposure)), 34855: (SHORT, [iso])}
    width = samples.shape[1]
    jpeg = {"components": 2 if width % 2 == 0 else 1}
    return Dng(samples, cfa=cfa, bits=14, compression=JPEG, jpeg=jpeg, tags=more | (tags or {}), exif=exif).encode()


def poses() -> Iterator[Json]:
    """All cases of both stages, with the fields of `golden.scenes.case`."""
    yield from _poses()
    yield from _patches()


def _rounded(points: Floats, places: int = 2) -> list[Any]:
    found: list[Any] = (np.round(points, places) + 0.0).tolist()
    return found


def _case(name: str, comment: str, inputs: Json, files: dict[str, bytes], expect: str) -> Json:
    return {
        "case": name,
        "comment": comment,
        "inputs": inputs,
        "expect": expect,
        "truth": None,
        "generic": True,
        "files": {f"dng/{name}": content for name, content in files.items()},
    }


def _poses() -> Iterator[Json]:
    half = 0.44  # half a patch, relative to the pitch

    def pose(
        name: str,
        comment: str,
        photo: str,
        content: bytes,
        corners: Any,
        *,
        table: str = "classic24",
        expect: str = "success",
    ) -> Json:
        inputs = {"dng": photo, "table": table, "corners": corners}
        return _case(f"pose/{name}", comment, inputs, {photo: content}, expect)

    upright = turned(24, 0)
    photo = file(draw(upright))
    for turns in range(4):
        view = turned(24, turns)
        content = photo if turns == 0 else file(draw(view))
        rough = view.corners() + np.array([[3, -2], [-4, 3], [2, 4], [-3, -3]])
        yield pose(
            f"turned-{turns}", f"The chart turned by {90 * turns}° clockwise; corners a few pixels off.",
            f"chart-turned-{turns}.dng", content, _rounded(np.roll(rough, turns, axis=0)),
        )  # fmt: skip
    for first in (1, 2, 3):
        yield pose(
            f"from-corner-{first + 1}", f"The corners begin with number {first + 1}: the colours say which is which.",
            "chart-turned-0.dng", photo, _rounded(np.roll(upright.corners() + 1.5, -first, axis=0)),
        )  # fmt: skip
    yield pose(
        "other-way-round", "The corners run against the clock.", "chart-turned-0.dng", photo,
        _rounded(upright.corners()[::-1] - 1.25),
    )  # fmt: skip
    for name, ways in (("together", [(1, 1)] * 4), ("apart", [(1, -1), (1, 1), (-1, 1), (-1, -1)])):
        off = half * 24 * np.array(ways) / np.sqrt(2)
        yield pose(
            f"half-a-patch-{name}", f"All corners off by half a patch, {name}.", "chart-turned-0.dng", photo,
            _rounded(upright.corners() + off),
        )  # fmt: skip
    tilted = file(draw(TILTED, bytes((1, 2, 0, 1))), cfa=bytes((1, 2, 0, 1)))
    yield pose(
        "tilted", "Turned by 20° and tilted, GBRG.", "chart-tilted.dng", tilted,
            _rounded(TILTED.corners() + np.array([3, -4])),
    )  # fmt: skip
    for factor, pitch in ((2, 90), (3, 128)):
        view = turned(pitch, 1, margin=pitch)
        yield pose(
            f"reduced-{factor}", f"A large photo: {factor} × {factor} CFA cells make a pixel of the search.",
            f"chart-large-{factor}.dng", file(draw(view, unrest=0)),
            _rounded(view.corners() + np.array([0.3 * pitch, 5.0])),
        )  # fmt: skip
    yield pose(
        "ohta", "Another table of the same chart.", "chart-turned-0.dng", photo, _rounded(upright.corners() + 2),
        table="classic24:ohta",
    )  # fmt: skip
    shrunk = upright.corners() + 0.7 * 24 * np.array([[1, 0], [-1, 0], [-1, 0], [1, 0]])
    yield pose(
        "kept", "No borders where the corners say: they are kept, since the colours agree.", "chart-turned-0.dng",
        photo, _rounded(shrunk),
    )  # fmt: skip
    nowhere = [[40, 40], [80, 40], [80, 66], [40, 66]]
    yield pose(
        "error-elsewhere", "Corners inside the chart: the colours do not agree.", "chart-turned-0.dng", photo,
        nowhere, expect="chart_not_found",
    )  # fmt: skip
    yield pose(
        "error-mirrored", "A mirrored chart.", "chart-mirrored.dng", file(draw(upright, mirrored=True)),
        _rounded(upright.corners()), expect="chart_not_found",
    )  # fmt: skip
    small = turned(8, 0, margin=8)
    yield pose(
        "error-small", "A photo of 56 × 40 px.", "chart-small.dng", file(draw(small)), _rounded(small.corners()),
        expect="chart_not_found",
    )  # fmt: skip
    wrong: dict[str, tuple[str, Sequence[Any]]] = {
        "outside": ("A corner outside the photo.", [[-5, 0], [100, 0], [100, 90], [0, 90]]),
        "crossed": ("Corners that cross.", [[10, 10], [100, 10], [10, 90], [100, 90]]),
        "three": ("Three corners.", [[10, 10], [100, 10], [100, 90]]),
        "nan": ("A corner that is no number.", [[10, 10], ["NaN", 10], [100, 90], [10, 90]]),
    }
    for name, (comment, corners) in wrong.items():
        yield pose(
            f"error-{name}", comment, "chart-turned-0.dng", photo, list(corners), expect="invalid_argument",
        )  # fmt: skip


def _shaded(samples: Samples, by: int) -> Samples:
    """The samples in light that falls off from left to right, by x / `by`."""
    x = np.arange(samples.shape[1], dtype=np.int64)
    above = samples.astype(np.int64) - BLACK
    return (BLACK + above * (4096 - 4096 * x // by) // 4096).astype(np.uint16)


def _patches() -> Iterator[Json]:
    view = turned(24, 0)
    width, height = view.size
    quads = _rounded(view.quads(), 4)
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
        return _case(f"patches/{name}", comment, inputs, dict(frames.values()), expect)

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
        {"photo": ("chart-tilted.dng", file(draw(TILTED, cfa), cfa=cfa))}, places=_rounded(TILTED.quads(), 4),
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
    small = _rounded(np.array(quads) * 0.5 + view.quads().mean(axis=1, keepdims=True) * 0.5, 4)
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
