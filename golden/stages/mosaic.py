"""The stage `mosaic`: small DNG files by formula, and what a reader must find in them.

Expected values come from what was written, never from a reader. Samples are a formula of their position; each case
lists the other fields of its file.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from golden import contract
from golden.contract import Call, Keys, Stage, always, limit, words
from golden.dngs import (
    ASCII,
    BAD_PIXELS,
    BYTE,
    DEFLATE,
    DOUBLE,
    JPEG,
    LONG,
    RATIONAL,
    SHORT,
    SRATIONAL,
    UNDEFINED,
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


def case(
    name: str,
    comment: str,
    dng: Dng | bytes,
    *,
    expect: str = "success",
    table: NDArray[np.uint16] | None = None,
    area: tuple[int, int, int, int] | None = None,
    **says: Any,
) -> Json:
    """A case of one file; `says` overrides expected fields other than the samples."""
    content = dng if isinstance(dng, bytes) else dng.encode()
    inputs, files = {"dng": f"{name}.dng"}, {f"dng/{name}.dng": content}
    if expect != "success":
        return contract.case(f"mosaic/{name}", comment, inputs, expect=expect, files=files)
    assert isinstance(dng, Dng)
    samples = dng.samples if table is None else table[np.minimum(dng.samples, len(table) - 1)]
    top, left, bottom, right = area or (0, 0, *samples.shape)
    active = np.ascontiguousarray(samples[top:bottom, left:right], dtype="<u2")
    outputs = {
        "sha256": hashlib.sha256(content).hexdigest(),
        "width": right - left,
        "height": bottom - top,
        "samples_sha256": hashlib.sha256(active.tobytes()).hexdigest(),
        "cfa": "".join("RGB"[code] for code in dng.cfa),
        "black": [0.0] * 4,
        "white": float(2**dng.bits - 1),
        "make": "Maker",
        "model": "Model 1",
        "exposure": None,
        "iso": None,
        "orientation": 1,
        "color_matrix1": None,
        "color_matrix2": None,
        "as_shot_neutral": None,
        "gain_maps": [],
        "as_shot_white_xy": None,
        "noise_profile": None,
        "masked_areas": [],
        "bad_pixels": [],
    } | says
    return contract.case(f"mosaic/{name}", comment, inputs, files=files, outputs=outputs)


def _plain() -> Iterator[Json]:
    yield case("plain", "Uncompressed, 16 bit, little-endian, one strip.", Dng(chaos(16)))
    yield case("big-endian", "The same, big-endian.", Dng(chaos(16), order=">"))
    yield case("strips", "Six strips, the last one short.", Dng(chaos(16), rows_per_strip=7))
    yield case(
        "strips-backwards", "The last strip comes first in the file.",
        Dng(chaos(12), bits=12, rows_per_strip=9, reverse_pieces=True),
    )  # fmt: skip
    yield case("tiles", "Tiles of 16 × 16, edge tiles padded.", Dng(chaos(16), tile=(16, 16)))
    yield case(
        "tiles-big-endian", "12-bit packed tiles, big-endian.", Dng(chaos(12), bits=12, order=">", tile=(16, 32)),
    )  # fmt: skip
    yield case("tiles-wide", "12-bit tiles, wider than the picture.", Dng(chaos(12), bits=12, tile=(16, 64)))
    for bits in (8, 10, 12, 14):
        yield case(f"bits-{bits}", f"{bits} bit, most significant bit first.", Dng(chaos(bits), bits=bits))
    yield case(
        "bits-10-odd", "Rows of 55 samples of 10 bits: each begins on a byte.",
        Dng(chaos(10, width=55), bits=10, order=">", rows_per_strip=8),
    )  # fmt: skip


def _layout() -> Iterator[Json]:
    """Cases of wrong byte counts and padded rows: every sample lies in the file."""
    for name, comment, dng in (
        ("counts-short", "Byte counts too small.", Dng(chaos(16), rows_per_strip=10, tags={279: (LONG, [100] * 4)})),
        (
            "counts-zero", "Byte counts of 0, lossless JPEG.",
            Dng(slope(10), bits=10, compression=JPEG, tile=(16, 24), tags={325: (LONG, [0] * 9)}),
        ),
        (
            "counts-large", "Byte counts beyond the file's end, deflate.",
            Dng(slope(16), compression=DEFLATE, rows_per_strip=20, tags={279: (LONG, [10**6] * 2)}),
        ),
    ):  # fmt: skip
        yield case(name, comment, dng)
    wide = slope(12, width=WIDTH + 8)
    padded = Dng(wide, bits=12, rows_per_strip=16, tags={256: (LONG, [WIDTH])})
    yield case(
        "rows-padded", "Rows padded to a stride, which the byte counts tell.", padded, area=(0, 0, HEIGHT, WIDTH)
    )
    required = opcode(1, bytes(8), required=True)
    yield case(
        "opcodes-skipped", "A warp that is required moves no sample; a polynomial that is optional may be skipped.",
        Dng(chaos(16), tags={51009: opcode_list(opcode(8, bytes(8))), 51022: opcode_list(required)}),
    )  # fmt: skip


def _jpeg() -> Iterator[Json]:
    def jpeg(name: str, comment: str, samples: Samples, bits: int, more: Json | None = None, **how: Any) -> Json:
        dng = Dng(samples, bits=bits, compression=JPEG, jpeg=how, **(more or {}))
        return case(f"jpeg-{name}", comment, dng)

    for predictor in range(1, 8):
        yield jpeg(
            f"predictor-{predictor}", f"Lossless JPEG, predictor {predictor}, two components.", slope(14), 14,
            predictor=predictor,
        )  # fmt: skip
    for components in (1, 4):
        yield jpeg(
            f"components-{components}", f"{components} component(s), predictor 6.", slope(12), 12, predictor=6,
            components=components,
        )  # fmt: skip
    yield jpeg("chaos-16", "16 bit without order: every category.", chaos(16), 16, predictor=7)
    yield jpeg("category-16", "Differences of 32768, which have no further bits.", extremes(), 16, components=1)
    yield jpeg("tiles", "Tiles of 16 × 24, 10 bit, as phones write them.", slope(10), 10, {"tile": (16, 24)})
    yield jpeg(
        "long-lines", "Two rows of the tile in each JPEG line.", slope(12), 12, {"tile": (16, 16)}, lines=8,
    )  # fmt: skip
    yield jpeg("restart", "Restart intervals of three lines, predictor 1.", slope(12), 12, restart_rows=3)
    yield jpeg(
        "restart-predictor-6", "Restart intervals with a predictor that looks up: T.81 begins anew.", slope(12), 12,
        restart_rows=4, predictor=6,
    )  # fmt: skip
    yield jpeg(
        "point-transform", "A point transform of 2: samples come back times 4.", slope(12) & np.uint16(0xFFFC), 12,
        transform=2,
    )  # fmt: skip
    yield jpeg("strips", "Lossless JPEG in four strips.", slope(12), 12, {"rows_per_strip": 10})
    yield jpeg("tiles-wide", "Tiles of 16 × 64, wider than the picture.", slope(12), 12, {"tile": (16, 64)})


def _deflate() -> Iterator[Json]:
    for name, comment, dng in (
        ("deflate", "Deflate, strips, 16 bit.", Dng(slope(16), compression=DEFLATE, rows_per_strip=11)),
        (
            "deflate-differences",
            "Deflate, tiles, horizontal differences (predictor 2), big-endian.",
            Dng(slope(16), order=">", compression=DEFLATE, predictor=2, tile=(16, 32)),
        ),
        ("deflate-packed", "Deflate of 12-bit packed rows.", Dng(slope(12), bits=12, compression=DEFLATE)),
        (
            "deflate-tiles-wide", "Deflate, tiles of 48 × 64, larger than the picture.",
            Dng(slope(16), compression=DEFLATE, tile=(48, 64)),
        ),
    ):  # fmt: skip
        yield case(name, comment, dng)


def _levels() -> Iterator[Json]:
    """Cases of tables, black and white levels, areas and colour filters."""
    curve = np.minimum(np.arange(1024) ** 2 // 16, 65535).astype(np.uint16)
    yield case(
        "linearization", "A LinearizationTable of every value; black and white are on its scale.",
        Dng(chaos(10), bits=10, tags={50712: (SHORT, curve.tolist()), 50717: (LONG, [65000]), 50714: (SHORT, [100])}),
        table=curve, white=65000.0, black=[100.0] * 4,
    )  # fmt: skip
    short = (60000 - 250 * np.arange(200)).astype(np.uint16)
    yield case(
        "linearization-short", "A table shorter than the values: its last entry holds for the rest.",
        Dng(chaos(8), bits=8, tags={50712: (SHORT, short.tolist()), 50717: (LONG, [60000])}),
        table=short, white=60000.0,
    )  # fmt: skip
    yield case(
        "black-pattern", "A black level for each position, as fractions.",
        Dng(chaos(12), bits=12, tags={50713: (SHORT, [2, 2]),
                                      50714: (RATIONAL, [6400, 100, 6425, 100, 6450, 100, 2577, 40])}),
        black=[64.0, 64.25, 64.5, 64.425],
    )  # fmt: skip
    down, across = [(3 * i) % 8 for i in range(HEIGHT)], [(5 * i) % 16 - 8 for i in range(WIDTH)]
    rows, columns = (
        [sum(down[i::2]) / (HEIGHT / 2) for i in (0, 1)],
        [sum(across[j::2]) / (WIDTH / 2) for j in (0, 1)],
    )
    deltas: Tags = {
        50713: (SHORT, [1, 2]),
        50714: (SHORT, [200, 208]),
        50715: (SRATIONAL, [part for v in across for part in (v, 4)]),
        50716: (SRATIONAL, [part for v in down for part in (v, 2)]),
    }
    yield case(
        "black-deltas", "A level for each column of the cell, deltas of rows and columns: the mean by position.",
        Dng(chaos(14), bits=14, order=">", tags=deltas),
        black=[(200 + 8 * j) + rows[i] / 2 + columns[j] / 4 for i in (0, 1) for j in (0, 1)],
    )  # fmt: skip
    yield case(
        "white-level", "A white level below the coding's end, and no black level.",
        Dng(chaos(14), bits=14, tags={50717: (SHORT, [15871])}), white=15871.0,
    )  # fmt: skip
    yield case("white-silent", "No white level: 2^bits - 1.", Dng(chaos(10), bits=10, tags={50717: None}))
    for name, area, cfa in (
        ("even", (4, 6, 38, 54), bytes((1, 0, 2, 1))),
        ("odd", (3, 5, 38, 52), bytes((1, 2, 0, 1))),
    ):
        yield case(
            f"active-area-{name}", "The colour pattern begins at the active area's corner, wherever that lies.",
            Dng(chaos(12), cfa=cfa, bits=12, tags={50829: (LONG, list(area))}), area=area,
        )  # fmt: skip
    masked = [[0, 0, 40, 8], [0, 8, 4, 56]]
    yield case(
        "masked-areas", "Two masked areas beside the active one.",
        Dng(chaos(16), tags={50829: (SHORT, [4, 8, 40, 56]), 50830: (SHORT, [*masked[0], *masked[1]])}),
        area=(4, 8, 40, 56), masked_areas=masked,
    )  # fmt: skip
    for letters, code in (("GRBG", (1, 0, 2, 1)), ("GBRG", (1, 2, 0, 1)), ("BGGR", (2, 1, 1, 0))):
        yield case(f"cfa-{letters.lower()}", f"Colour filters {letters}.", Dng(slope(12), cfa=bytes(code), bits=12))


def _directories() -> Iterator[Json]:
    """Cases of the raw directory's position, and of the fields other than the samples."""
    yield case("sub-directory", "The raw picture in a SubIFD behind a preview.", Dng(chaos(16), place="sub"))
    yield case("nested", "In a SubIFD of a SubIFD, big-endian.", Dng(chaos(16), order=">", place="nested"))
    yield case("chain", "The second directory of the chain.", Dng(chaos(12), bits=12, place="chain"))
    first: Tags = {
        271: (ASCII, b"Acme \0"),
        272: (ASCII, b"Phone 7\0"),
        274: (SHORT, [6]),
        50721: (SRATIONAL, [part for value in range(1, 10) for part in (-value, 8)]),
        50722: (SRATIONAL, [part for value in range(1, 10) for part in (value, 100)]),
        50728: (RATIONAL, [1, 2, 1, 1, 5, 8]),
    }
    yield case(
        "metadata", "Make, model, orientation, matrices, neutral, exposure and ISO from Exif.",
        Dng(chaos(16), order=">", place="sub", first=first,
            exif={33434: (RATIONAL, [1, 50]), 34855: (SHORT, [400])}),
        make="Acme", model="Phone 7", orientation=6, exposure=0.02, iso=400.0,
        color_matrix1=[-value / 8 for value in range(1, 10)], color_matrix2=[value / 100 for value in range(1, 10)],
        as_shot_neutral=[0.5, 1.0, 0.625],
    )  # fmt: skip
    yield case(
        "metadata-phone", "AsShotWhiteXY instead of a neutral, a noise profile for each plane, no make or model.",
        Dng(chaos(10), bits=10, first={
            271: None, 272: None, 50729: (RATIONAL, [345703, 1000000, 358539, 1000000]),
            51041: (DOUBLE, [2e-4, 1e-6, 1.5e-4, 9e-7, 2.5e-4, 2e-6]), 33434: (RATIONAL, [0, 1000]),
        }),
        make="", model="Maker Model 1", as_shot_white_xy=[0.345703, 0.358539],
        noise_profile=[2e-4, 1e-6, 1.5e-4, 9e-7, 2.5e-4, 2e-6],
    )  # fmt: skip
    area = (0, 0, HEIGHT, WIDTH)
    nets = [[[1.0 + (i + j + k) / 16 for j in range(3)] for i in range(2)] for k in range(4)]
    corners = [(row, column, HEIGHT - 1, WIDTH - 1) for row in (0, 1) for column in (0, 1)]
    maps = [gain_map(net, corner, (2, 2), (1.0, 0.5)) for net, corner in zip(nets, corners, strict=True)]
    points, places = [[3, 4], [30, 41]], [[8, 8, 10, 12]]
    flat = [2, 2, 1, *points[0], *points[1], *places[0]]
    bad = opcode(5, struct.pack(f">{len(flat)}I", *flat))
    third = gain_map([[[1.5, 1.25, 2.0]]], area, plane=(0, 3))
    yield case(
        "opcodes", "Four gain maps as Android writes them, one of three planes, bad pixels by place and by value, "
        "and an optional opcode that nobody knows.",
        Dng(chaos(14), bits=14, cfa=bytes((2, 1, 1, 0)), tags={
            51008: opcode_list(bad), 51009: opcode_list(*maps, BAD_PIXELS),
            51022: opcode_list(opcode(99, b"?"), third),
        }),
        gain_maps=[
            {"list": 2, "area": list(corner), "plane": 0, "planes": 1, "row_pitch": 2, "column_pitch": 2,
             "spacing": [1.0, 0.5], "origin": [0.0, 0.0], "gains": [[[g] for g in row] for row in net]}
            for net, corner in zip(nets, corners, strict=True)
        ] + [
            {"list": 3, "area": list(area), "plane": 0, "planes": 3, "row_pitch": 1, "column_pitch": 1,
             "spacing": [1.0, 1.0], "origin": [0.0, 0.0], "gains": [[[1.5, 1.25, 2.0]]]},
        ],
        bad_pixels=[
            {"list": 1, "constant": None, "points": points, "areas": places},
            {"list": 2, "constant": 0, "points": [], "areas": []},
        ],
    )  # fmt: skip


def _errors() -> Iterator[Json]:
    def error(name: str, code: str, comment: str, dng: Dng | bytes) -> Json:
        return case(f"error-{name}", comment, dng, expect=code)

    def tagged(tag: int, kind: int, value: list[int]) -> Dng:
        return Dng(chaos(16), tags={tag: (kind, value)})

    unsupported, unreadable = "unsupported_raw", "unreadable_raw"
    whole = Dng(chaos(16)).encode()
    yield error("linear-raw", "not_sensor_raw", "LinearRaw: demosaiced.", tagged(262, SHORT, [34892]))
    for name, number in (("jpeg-xl", 52546), ("lossy", 34892), ("unknown-codec", 4711)):
        yield error(name, unsupported, f"Compression {number}.", tagged(259, SHORT, [number]))
    yield error("float", unsupported, "Floating-point samples.", tagged(339, SHORT, [3]))
    yield error("three-samples", unsupported, "Three samples a pixel.", tagged(277, SHORT, [3]))
    yield error("bits-24", unsupported, "24 bits a sample.", tagged(258, SHORT, [24]))
    yield error("fill-order", unsupported, "FillOrder 2: bytes with the lowest bit first.",
                Dng(chaos(12), bits=12, tags={266: (SHORT, [2])}))  # fmt: skip
    yield error("bigtiff", unsupported, "BigTIFF.", b"II+\0\x08\0\0\0" + bytes(60))
    yield error("no-dng", unsupported, "A raw TIFF without DNGVersion.", Dng(chaos(16), first={50706: None}))
    yield error("version-2", unsupported, "DNG version 2.", Dng(chaos(16), first={50706: (BYTE, [2, 0, 0, 0])}))
    yield error("x-trans", unsupported, "A 6 × 6 pattern of colours.",
                Dng(chaos(16), tags={33421: (SHORT, [6, 6]), 33422: (BYTE, [0, 1, 1, 1, 2, 1] * 6)}))  # fmt: skip
    yield error("cyan", unsupported, "Complementary colours.", tagged(33422, BYTE, [3, 1, 1, 4]))
    yield error("preview-alone", unsupported, "No full picture.", tagged(254, LONG, [1]))
    lossy = Dng(slope(8), bits=8, compression=JPEG).encode().replace(b"\xff\xc3", b"\xff\xc0", 1)
    yield error("dct", unsupported, "Compression 7 that holds a JPEG with another frame header (SOF0).", lossy)
    yield error("truncated", unreadable, "The second half of the file is missing.", whole[: len(whole) // 2])
    cut = Dng(chaos(16), tags={273: (LONG, [10**6])})
    yield error("beyond-the-end", unreadable, "Samples beyond the file's end.", cut)
    more = Dng(chaos(16), tags={257: (LONG, [HEIGHT + 2]), 278: (LONG, [HEIGHT + 2])})
    yield error("short-data", unreadable, "A strip that would reach into the directory.", more)
    for number, name in ((8, "polynomial"), (12, "scale"), (99, "unknown")):
        required = opcode_list(opcode(number, bytes(8), required=True))
        yield error(f"opcode-{name}", unsupported, f"Opcode {number}, which may not be skipped.",
                    Dng(chaos(16), tags={51009: required}))  # fmt: skip
    yield error("strip-missing", unreadable, "One strip where four are wanted.", tagged(278, LONG, [10]))
    yield error("circle", unreadable, "A directory that follows itself.", b"II*\0\x08\0\0\0\0\0\x08\0\0\0" + bytes(9))
    yield error("no-tiff", unreadable, "Words.", b"not a photo at all, just words")
    yield error("empty", unreadable, "Nothing.", b"")
    yield error("area-outside", unreadable, "An active area larger than the picture.",
                tagged(50829, LONG, [0, 0, HEIGHT + 1, WIDTH]))  # fmt: skip
    yield error("black-infinite", unreadable, "A black level of 1/0.", tagged(50714, RATIONAL, [1, 0]))
    yield error("huge", unreadable, "60,000 × 60,000 samples in a small file.",
                Dng(chaos(16), tags={256: (LONG, [60000]), 257: (LONG, [60000])}))  # fmt: skip
    yield error("jpeg-size", unreadable, "A JPEG of another size than its tile.",
                Dng(slope(12), bits=12, compression=JPEG, tags={257: (LONG, [36]), 278: (LONG, [36])}))  # fmt: skip
    wide = Dng(slope(12), bits=12, compression=JPEG, tags={256: (LONG, [23000]), 257: (LONG, [23000]),
                                                            278: (LONG, [23000])})  # fmt: skip
    claim = wide.encode().replace(struct.pack(">HH", HEIGHT, WIDTH // 2), struct.pack(">HH", 23000, 11500), 1)
    yield error("jpeg-claim", unreadable, "A JPEG of 23,000 × 23,000 samples in a small file.", claim)
    tiled = Dng(slope(10), bits=10, compression=JPEG, tile=(16, 24))
    coded, first, last = tiled.encode(), 8 + len(tiled.pieces()[0]), 8 + sum(map(len, tiled.pieces()))
    for name, comment, at in (
        ("jpeg-code", "Ones where a JPEG's coded samples were.", first - 60),
        ("jpeg-padding", "The same in the rows of an edge tile that lie below the picture.", last - 40),
    ):
        yield error(name, unreadable, comment, coded[:at] + b"\xfe" * 8 + coded[at + 8 :])
    twice = coded.replace(bytes(range(17)), bytes((0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 0)))
    yield error("huffman-twice", unreadable, "A Huffman table that holds a category twice.", twice)
    deflated = Dng(slope(16), compression=DEFLATE, rows_per_strip=11).encode()
    deflated = deflated[:99] + b"\xff" + deflated[100:]
    yield error("deflate-damaged", unreadable, "A deflated strip with a wrong byte.", deflated)
    yield error("deflate-predictor", unsupported, "Deflate with predictor 2 on packed samples.",
                Dng(slope(12), bits=12, compression=DEFLATE, tags={317: (SHORT, [2])}))  # fmt: skip
    noise = Dng(chaos(16), tags={51041: (DOUBLE, [0.0] * 2)}).encode()
    at = noise.index(struct.pack("<HHI", 51041, DOUBLE, 2)) + 8
    yield error("noise-outside", unreadable, "A noise profile beyond the file's end.",
                noise[:at] + struct.pack("<I", len(noise)) + noise[at + 4 :])  # fmt: skip
    kind, data = opcode_list(gain_map([[1.0, 2.0]], (0, 0, HEIGHT, WIDTH)))
    yield error("opcodes-cut", unreadable, "An opcode list that ends early.",
                Dng(chaos(16), tags={51009: (UNDEFINED, data[:-2])}))  # fmt: skip
    many = data[:52] + struct.pack(">2I", 2**31, 2**31) + data[60:]
    yield error(
        "gain-map-points", unreadable, "A gain map of 2^62 points.", Dng(chaos(16), tags={51009: (kind, many)})
    )


def cases() -> Iterator[Json]:
    """All cases."""
    yield from _plain()
    yield from _layout()
    yield from _jpeg()
    yield from _deflate()
    yield from _levels()
    yield from _directories()
    yield from _errors()


def run(call: Call) -> dict[str, Any]:
    """The stage `mosaic`: what the reader finds; Python does not read the fields of `metadata`."""
    given = call.given
    found = read_photo(given["dng"])
    height, width = found.samples.shape
    names = ("sha256", "cfa", "white", "make", "model", "exposure", "iso", "orientation")
    maps = [
        {
            "list": each.stage,
            "area": [each.top, each.left, each.bottom, each.right],
            "plane": each.plane,
            "planes": each.planes,
            "row_pitch": each.row_pitch,
            "column_pitch": each.column_pitch,
            "spacing": list(each.spacing),
            "origin": list(each.origin),
            "gains": each.gains.tolist(),
        }
        for each in found.gain_maps
    ]
    more = {name: getattr(found, name) for name in ("color_matrix1", "color_matrix2", "as_shot_neutral")}
    return {
        **{name: getattr(found, name) for name in names},
        **{name: None if value is None else value.ravel() for name, value in more.items()},
        "width": width,
        "height": height,
        "samples_sha256": digest(found.samples.astype("<u2").tobytes()),
        "black": found.black.ravel(),
        "gain_maps": maps,
    }


_METADATA = {"as_shot_white_xy", "noise_profile", "masked_areas", "bad_pixels"}
"""Fields of a file that Python does not read."""
_ROUNDED = {"black", "color_matrix1", "color_matrix2", "as_shot_neutral", "as_shot_white_xy"}
"""Fields that are quotients, and so rounded."""


def limits(made: Json, scene: Json) -> list[Json]:
    """Against what was written; fields that Python does not read require `metadata`."""

    def bound(name: str) -> tuple[str, float]:
        return ("norm", 1e-15) if name in _ROUNDED else ("exact", 0.0)

    there = [name for name in sorted(made["outputs"]) if made["outputs"][name] is not None]
    return [limit(name, "outputs", *bound(name)) for name in there if name not in _METADATA] + [
        limit(name, "outputs", *bound(name), "metadata") for name in there if name in _METADATA
    ]


STAGE = Stage(
    name="mosaic",
    keys=Keys(
        words("dng"),
        words(
            "sha256 width height samples_sha256 cfa black white make model exposure iso orientation color_matrix1 "
            "color_matrix2 as_shot_neutral gain_maps as_shot_white_xy noise_profile masked_areas bad_pixels"
        ),
        arrays=frozenset(),
    ),
    requires=always("mosaic"),
    cases=cases,
    run=run,
    limits=limits,
)
