"""The stage `mosaic`: small DNG files by formula, and what a reader must find in them.

Expected values come from what was written, never from a reader. Samples are a formula of their position.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from golden import contract, dngs
from golden.contract import Call, Stage, limit, words
from golden.dngs import (
    BYTE,
    DEFLATE,
    JPEG,
    LONG,
    RATIONAL,
    SHORT,
    SRATIONAL,
    Dng,
    Tags,
    gain_map,
    opcode,
    opcode_list,
)
from golden.forms import Json, digest
from golden.products import read_photo

HEIGHT, WIDTH = 40, 56
Samples = NDArray[np.uint16]
Row: TypeAlias = tuple[str, str, Dng, Json]
"""Name, comment, file, and the fields that are unlike those of a plain file."""


def chaos(bits: int, height: int = HEIGHT, width: int = WIDTH) -> Samples:
    """(7x² + 13y² + 5xy + 31x + 17y) mod 2^bits: values from the whole range in irregular order."""
    y, x = np.mgrid[0:height, 0:width].astype(np.int64)
    values: Samples = ((7 * x * x + 13 * y * y + 5 * x * y + 31 * x + 17 * y) % (1 << bits)).astype(np.uint16)
    return values


def slope(bits: int, height: int = HEIGHT, width: int = WIDTH) -> Samples:
    """A slope with a small pattern added, similar to a photo: small and large differences."""
    top = (1 << bits) - 1
    y, x = np.mgrid[0:height, 0:width].astype(np.int64)
    values = top // 8 + x * top // (2 * width) + y * top // (4 * height) + (29 * x + 37 * y) % 7
    samples: Samples = values.astype(np.uint16)
    return samples


def extremes() -> Samples:
    """Alternating 0 and 32768: differences of category 16."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH].astype(np.int64)
    samples: Samples = (32768 * ((x // 3 + y // 2) % 2)).astype(np.uint16)
    return samples


def plain(bits: int, width: int = WIDTH, **how: Any) -> Dng:
    """An uncompressed file of irregular samples."""
    return Dng(chaos(bits, width=width), bits=bits, **how)


def packed(bits: int, compression: int, **how: Any) -> Dng:
    """A compressed file of a slope."""
    return Dng(slope(bits), bits=bits, compression=compression, **how)


def jpeg(samples: Samples, bits: int, *, tile: Any = None, rows: int | None = None, **how: Any) -> Dng:
    """A file of lossless JPEGs."""
    return Dng(samples, bits=bits, compression=JPEG, jpeg=how, tile=tile, rows_per_strip=rows)


def _samples() -> list[Row]:
    """How samples are laid out and compressed."""
    wide = Dng(slope(12, width=WIDTH + 8), bits=12, rows_per_strip=16, tags={256: (LONG, [WIDTH])})
    warp, polynomial = opcode(1, bytes(8), required=True), opcode(8, bytes(8))
    skipped = {51009: opcode_list(polynomial), 51022: opcode_list(warp)}
    return [
        ("plain", "Uncompressed, 16 bit, little-endian, one strip.", plain(16), {}),
        ("strips-backwards", "The last strip comes first in the file.",
         plain(12, rows_per_strip=9, reverse_pieces=True), {}),
        ("tiles-wide", "12-bit tiles, wider than the picture.", plain(12, tile=(16, 64)), {}),
        *((f"bits-{bits}", f"{bits} bit, most significant bit first.", plain(bits), {}) for bits in (8, 10, 14)),
        ("bits-10-odd", "Rows of 55 samples of 10 bits: each begins on a byte.",
         plain(10, 55, order=">", rows_per_strip=8), {}),
        ("counts-short", "Byte counts too small.", plain(16, rows_per_strip=10, tags={279: (LONG, [100] * 4)}), {}),
        ("counts-large", "Byte counts beyond the file's end, deflate.",
         packed(16, DEFLATE, rows_per_strip=20, tags={279: (LONG, [10**6] * 2)}), {}),
        ("rows-padded", "Rows padded to a stride, which the byte counts tell.",
         wide, {"area": (0, 0, HEIGHT, WIDTH)}),
        ("opcodes-skipped", "A warp that is required moves no sample; a polynomial that is optional may be skipped.",
         plain(16, tags=skipped), {}),
        *((f"jpeg-predictor-{number}", f"Lossless JPEG, predictor {number}, two components.",
           jpeg(slope(14), 14, predictor=number), {}) for number in range(1, 8)),
        *((f"jpeg-components-{number}", f"{number} component(s), predictor 6.",
           jpeg(slope(12), 12, predictor=6, components=number), {}) for number in (1, 4)),
        ("jpeg-category-16", "Differences of 32768, which have no further bits.",
         jpeg(extremes(), 16, components=1), {}),
        ("jpeg-tiles", "Tiles of 16 × 24, 10 bit, as phones write them.", jpeg(slope(10), 10, tile=(16, 24)), {}),
        ("jpeg-restart-predictor-6", "Restart intervals with a predictor that looks up: T.81 begins anew.",
         jpeg(slope(12), 12, restart_rows=4, predictor=6), {}),
        ("jpeg-point-transform", "A point transform of 2: samples come back times 4.",
         jpeg(slope(12) & np.uint16(0xFFFC), 12, transform=2), {}),
        ("deflate-differences", "Deflate, tiles, horizontal differences (predictor 2), big-endian.",
         packed(16, DEFLATE, order=">", predictor=2, tile=(16, 32)), {}),
        ("deflate-packed", "Deflate of 12-bit packed rows.", packed(12, DEFLATE), {}),
    ]  # fmt: skip


def _levels() -> list[Row]:
    """Tables, black and white levels, areas and colour filters."""
    curve = np.minimum(np.arange(1024) ** 2 // 16, 65535).astype(np.uint16)
    pattern = {50713: (SHORT, [2, 2]), 50714: (RATIONAL, [6400, 100, 6425, 100, 6450, 100, 2577, 40])}
    down, across = [(3 * i) % 8 for i in range(HEIGHT)], [(5 * i) % 16 - 8 for i in range(WIDTH)]
    rows, columns = ([sum(deltas[i::2]) / (len(deltas) / 2) for i in (0, 1)] for deltas in (down, across))
    deltas: Tags = {
        50713: (SHORT, [1, 2]),
        50714: (SHORT, [200, 208]),
        50715: (SRATIONAL, [part for v in across for part in (v, 4)]),
        50716: (SRATIONAL, [part for v in down for part in (v, 2)]),
    }
    even, odd = (4, 6, 38, 54), (3, 5, 38, 52)
    corner = "The colour pattern begins at the active area's corner, wherever that lies."
    return [
        ("linearization", "A LinearizationTable of every value; black and white are on its scale.",
         plain(10, tags={50712: (SHORT, curve.tolist()), 50717: (LONG, [65000]), 50714: (SHORT, [100])}),
         {"table": curve, "white": 65000.0, "black": [100.0] * 4}),
        ("black-pattern", "A black level for each position, as fractions.",
         plain(12, tags=pattern), {"black": [64.0, 64.25, 64.5, 64.425]}),
        ("black-deltas", "A level for each column of the cell, deltas of rows and columns: the mean by position.",
         plain(14, order=">", tags=deltas),
         {"black": [(200 + 8 * j) + rows[i] / 2 + columns[j] / 4 for i in (0, 1) for j in (0, 1)]}),
        ("white-level", "A white level below the coding's end, and no black level.",
         plain(14, tags={50717: (SHORT, [15871])}), {"white": 15871.0}),
        ("active-area-even", corner, plain(12, cfa=bytes((1, 0, 2, 1)), tags={50829: (LONG, even)}), {"area": even}),
        ("active-area-odd", corner, plain(12, cfa=bytes((1, 2, 0, 1)), tags={50829: (LONG, odd)}), {"area": odd}),
        *((f"cfa-{letters.lower()}", f"Colour filters {letters}.",
           Dng(slope(12), cfa=bytes("RGB".index(letter) for letter in letters), bits=12), {})
          for letters in ("GRBG", "GBRG", "BGGR")),
    ]  # fmt: skip


def _directories() -> list[Row]:
    """Where the raw directory lies, and the fields other than samples and levels."""
    ninths = range(1, 10)
    first: Tags = {
        271: (dngs.ASCII, b"Acme \0"),
        272: (dngs.ASCII, b"Phone 7\0"),
        274: (SHORT, [6]),
        50721: (SRATIONAL, [part for value in ninths for part in (-value, 8)]),
        50722: (SRATIONAL, [part for value in ninths for part in (value, 100)]),
        50728: (RATIONAL, [1, 2, 1, 1, 5, 8]),
    }
    phone: Tags = {
        271: None, 272: None, 50729: (RATIONAL, [345703, 1000000, 358539, 1000000]),
        51041: (dngs.DOUBLE, [2e-4, 1e-6, 1.5e-4, 9e-7, 2.5e-4, 2e-6]), 33434: (RATIONAL, [0, 1000]),
    }  # fmt: skip
    unmasked, masked = (4, 8, 40, 56), [[0, 0, 40, 8], [0, 8, 4, 56]]
    nets = [[[1.0 + (i + j + k) / 16 for j in range(3)] for i in range(2)] for k in range(4)]
    corners = [(row, column, HEIGHT - 1, WIDTH - 1) for row in (0, 1) for column in (0, 1)]
    maps = [gain_map(net, corner, (2, 2), (1.0, 0.5)) for net, corner in zip(nets, corners, strict=True)]
    area, gains = (0, 0, HEIGHT, WIDTH), [[[1.5, 1.25, 2.0]]]
    points, places = [[3, 4], [30, 41]], [[8, 8, 10, 12]]
    flat = [2, 2, 1, *points[0], *points[1], *places[0]]
    opcodes: Tags = {
        51008: opcode_list(opcode(5, struct.pack(f">{len(flat)}I", *flat))),
        51009: opcode_list(*maps, dngs.BAD_PIXELS),
        51022: opcode_list(opcode(99, b"?"), gain_map(gains, area, plane=(0, 3))),
    }
    android = {"list": 2, "plane": 0, "planes": 1, "row_pitch": 2, "column_pitch": 2, "spacing": [1.0, 0.5],
               "origin": [0.0, 0.0]}  # fmt: skip
    return [
        ("nested", "In a SubIFD of a SubIFD, big-endian.", plain(16, order=">", place="nested"), {}),
        ("chain", "The second directory of the chain.", plain(12, place="chain"), {}),
        ("metadata", "Make, model, orientation, matrices, neutral, exposure and ISO from Exif.",
         plain(16, order=">", place="sub", first=first, exif={33434: (RATIONAL, [1, 50]), 34855: (SHORT, [400])}),
         {"make": "Acme", "model": "Phone 7", "orientation": 6, "exposure": 0.02, "iso": 400.0,
          "color_matrix1": [-value / 8 for value in ninths], "color_matrix2": [value / 100 for value in ninths],
          "as_shot_neutral": [0.5, 1.0, 0.625]}),
        ("metadata-phone", "AsShotWhiteXY instead of a neutral, a noise profile for each plane, two masked areas, "
         "no make or model.",
         plain(16, first=phone, tags={50829: (SHORT, unmasked), 50830: (SHORT, masked[0] + masked[1])}),
         {"make": "", "model": "Maker Model 1", "as_shot_white_xy": [0.345703, 0.358539],
          "noise_profile": [2e-4, 1e-6, 1.5e-4, 9e-7, 2.5e-4, 2e-6], "area": unmasked, "masked_areas": masked}),
        ("opcodes", "Four gain maps as Android writes them, one of three planes, bad pixels by place and by value, "
         "and an optional opcode that nobody knows.",
         plain(14, cfa=bytes((2, 1, 1, 0)), tags=opcodes),
         {"gain_maps": [
             *(android | {"area": list(corner), "gains": [[[gain] for gain in row] for row in net]}
               for net, corner in zip(nets, corners, strict=True)),
             {"list": 3, "area": list(area), "plane": 0, "planes": 3, "row_pitch": 1, "column_pitch": 1,
              "spacing": [1.0, 1.0], "origin": [0.0, 0.0], "gains": gains},
          ],
          "bad_pixels": [{"list": 1, "constant": None, "points": points, "areas": places},
                         {"list": 2, "constant": 0, "points": [], "areas": []}]}),
    ]  # fmt: skip


def _errors() -> list[tuple[str, str, str, Dng | bytes]]:
    """Name, error code, comment and file of what must be refused."""

    def tagged(tag: int, kind: int, *value: int) -> Dng:
        return plain(16, tags={tag: (kind, value)})

    def damaged(text: bytes, at: int, by: bytes) -> bytes:
        return text[:at] + by + text[at + len(by) :]

    whole, zeros = plain(16).encode(), bytes(8)
    lossy = packed(8, JPEG).encode().replace(b"\xff\xc3", b"\xff\xc0", 1)
    size = (LONG, [23000])
    claim = packed(12, JPEG, tags={256: size, 257: size, 278: size}).encode()
    claim = claim.replace(struct.pack(">HH", HEIGHT, WIDTH // 2), struct.pack(">HH", 23000, 11500), 1)
    tiled = packed(10, JPEG, tile=(16, 24))
    coded, last = tiled.encode(), 8 + sum(map(len, tiled.pieces()))
    kind, gains = opcode_list(gain_map([[1.0, 2.0]], (0, 0, HEIGHT, WIDTH)))
    unsupported, unreadable = "unsupported_raw", "unreadable_raw"
    return [
        ("linear-raw", "not_sensor_raw", "LinearRaw: demosaiced.", tagged(262, SHORT, 34892)),
        ("jpeg-xl", unsupported, "Compression 52546.", tagged(259, SHORT, 52546)),
        ("three-samples", unsupported, "Three samples a pixel.", tagged(277, SHORT, 3)),
        ("bigtiff", unsupported, "BigTIFF.", b"II+\0\x08\0\0\0" + bytes(60)),
        ("version-2", unsupported, "DNG version 2.", plain(16, first={50706: (BYTE, [2, 0, 0, 0])})),
        ("preview-alone", unsupported, "No full picture.", tagged(254, LONG, 1)),
        ("strip-missing", unreadable, "One strip where four are wanted.", tagged(278, LONG, 10)),
        ("area-outside", unreadable, "An active area larger than the picture.",
         tagged(50829, LONG, 0, 0, HEIGHT + 1, WIDTH)),
        ("black-infinite", unreadable, "A black level of 1/0.", tagged(50714, RATIONAL, 1, 0)),
        ("deflate-predictor", unsupported, "Deflate with predictor 2 on packed samples.",
         packed(12, DEFLATE, tags={317: (SHORT, [2])})),
        ("opcodes-cut", unreadable, "An opcode list that ends early.", plain(16, tags={51009: (kind, gains[:-2])})),
        ("float", unsupported, "Floating-point samples.", tagged(339, SHORT, 3)),
        ("bits-24", unsupported, "24 bits a sample.", tagged(258, SHORT, 24)),
        ("fill-order", unsupported, "FillOrder 2: bytes with the lowest bit first.",
         plain(12, tags={266: (SHORT, [2])})),
        ("no-dng", unsupported, "A raw TIFF without DNGVersion.", plain(16, first={50706: None})),
        ("x-trans", unsupported, "A 6 × 6 pattern of colours.",
         plain(16, tags={33421: (SHORT, [6, 6]), 33422: (BYTE, [0, 1, 1, 1, 2, 1] * 6)})),
        ("dct", unsupported, "Compression 7 that holds a JPEG with another frame header (SOF0).", lossy),
        ("truncated", unreadable, "The second half of the file is missing.", whole[: len(whole) // 2]),
        *((f"opcode-{name}", unsupported, f"Opcode {number}, which may not be skipped.",
           plain(16, tags={51009: opcode_list(opcode(number, zeros, required=True))}))
          for number, name in ((8, "polynomial"), (99, "unknown"))),
        ("circle", unreadable, "A directory that follows itself.", b"II*\0\x08\0\0\0\0\0\x08\0\0\0" + bytes(9)),
        ("empty", unreadable, "Nothing.", b""),
        ("jpeg-size", unreadable, "A JPEG of another size than its tile.",
         packed(12, JPEG, tags={257: (LONG, [36]), 278: (LONG, [36])})),
        ("jpeg-claim", unreadable, "A JPEG of 23,000 × 23,000 samples in a small file.", claim),
        ("jpeg-padding", unreadable, "Ones where a JPEG's coded samples were, in rows of a tile below the picture.",
         damaged(coded, last - 40, b"\xfe" * 8)),
        ("huffman-twice", unreadable, "A Huffman table that holds a category twice.",
         coded.replace(bytes(range(17)), bytes((*range(16), 0)))),
        ("deflate-damaged", unreadable, "A deflated strip with a wrong byte.",
         damaged(packed(16, DEFLATE, rows_per_strip=11).encode(), 99, b"\xff")),
        ("gain-map-points", unreadable, "A gain map of 2^62 points.",
         plain(16, tags={51009: (kind, damaged(gains, 52, struct.pack(">2I", 2**31, 2**31)))})),
    ]  # fmt: skip


def cases() -> Iterator[Json]:
    """All cases, a file each."""
    for name, comment, dng, says in [*_samples(), *_levels(), *_directories()]:
        outputs = _written(dng, **says)
        files = {f"dng/{name}.dng": dng.encode()}
        yield contract.case(f"mosaic/{name}", comment, {"dng": f"{name}.dng"}, files=files, outputs=outputs)
    for short, code, comment, content in _errors():
        name = f"error-{short}"
        files = {f"dng/{name}.dng": content if isinstance(content, bytes) else content.encode()}
        yield contract.case(f"mosaic/{name}", comment, {"dng": f"{name}.dng"}, files=files, expect=code)


def _written(dng: Dng, table: Samples | None = None, area: tuple[int, ...] | None = None, **says: Any) -> Json:
    """What a reader must find in a file; `says` overrides the fields of a plain file."""
    samples = dng.samples if table is None else table[np.minimum(dng.samples, len(table) - 1)]
    top, left, bottom, right = area or (0, 0, *samples.shape)
    return {
        "sha256": digest(dng.encode()),
        "width": right - left,
        "height": bottom - top,
        "samples_sha256": digest(samples[top:bottom, left:right].astype("<u2").tobytes()),
        "cfa": "".join("RGB"[code] for code in dng.cfa),
        "black": [0.0] * 4,
        "white": float(2**dng.bits - 1),
        "make": "Maker",
        "model": "Model 1",
        "orientation": 1,
        **dict.fromkeys(("exposure", "iso", "color_matrix1", "color_matrix2", "as_shot_neutral")),
        **dict.fromkeys(("as_shot_white_xy", "noise_profile")),
        **{name: [] for name in ("gain_maps", "masked_areas", "bad_pixels")},
    } | says


def run(call: Call) -> dict[str, Any]:
    """The stage `mosaic`: what the reader finds; Python does not read the fields of `metadata`."""
    photo = read_photo(call.given["dng"])
    height, width = photo.samples.shape
    names = ("sha256", "cfa", "white", "make", "model", "exposure", "iso", "orientation")
    arrays = {name: getattr(photo, name) for name in ("color_matrix1", "color_matrix2", "as_shot_neutral", "black")}
    maps = [
        {name: getattr(gain, name) for name in ("plane", "planes", "row_pitch", "column_pitch", "spacing", "origin")}
        | {"list": gain.stage, "area": [gain.top, gain.left, gain.bottom, gain.right], "gains": gain.gains.tolist()}
        for gain in photo.gain_maps
    ]
    return {
        **{name: getattr(photo, name) for name in names},
        **{name: None if value is None else value.ravel() for name, value in arrays.items()},
        "width": width,
        "height": height,
        "samples_sha256": digest(photo.samples.astype("<u2").tobytes()),
        "gain_maps": [one | {"spacing": list(one["spacing"]), "origin": list(one["origin"])} for one in maps],
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
    cases=cases,
    run=run,
    inputs=words("dng"),
    limits=limits,
    arrays=frozenset(),
)
