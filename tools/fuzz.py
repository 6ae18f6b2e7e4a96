"""Does any damaged file crash a reader? `python -m tools.fuzz [--count 50000] [--reader dng] [--seed 1]`

Sound files of every kind that camssf reads, damaged at random: bytes changed, cut out, doubled, spliced from another
file, numbers and words of the format put where they do not belong; JSON also as a tree. A reader may return, or
refuse by a `CalibrationError`; any other exception, a warning, a process that dies (LibRaw is C++) or a read longer
than ten seconds is a finding, printed with the seed that makes the file again (`--seed S --count 1`: file S).

Files go through each reader in a process of their own that is replaced when it dies. Exit status 1 with findings.
"""

from __future__ import annotations

import faulthandler
import json
import random
import struct
import sys
import tempfile
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import cache, partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from benchmarks.shared import command_parser, one_thread, progress
from camssf.calibration import solve
from camssf.documents.document import Document, read_document
from camssf.documents.forms import to_plain
from camssf.errors import CalibrationError
from camssf.photo.capture import measure
from camssf.photo.read.dng import read_dng
from camssf.report.build import report
from camssf.result import Result
from camssf.spectra import read_camera, read_chart, read_lamp
from camssf_fleet.manifest import Manifest
from camssf_lab.simulation.frames import simulate
from camssf_lab.simulation.scene import Scene
from golden.forms import ROOT

PATIENCE = 10.0
"""Seconds in which a small file must be read, or the process is ended."""
NUMBERS = (0, 1, 2, 3, 7, 8, 255, 256, 32767, 32768, 65535, 65536, 2**31 - 1, 2**31, 2**32 - 1)
WORDS = (
    b"nan", b"inf", b"-1", b"1e999", b"-0", b"1e-320", b"9" * 400, b"\0", b"\xff\xfe", b"\xef\xbb\xbf", b"\"", b"'",
    b",", b";", b"\t", b"\n", b"\r", b"=1+1", b"../../etc/passwd", b"<script>", b"%s%n", b"BEGIN_DATA", b"END_DATA",
    b"BEGIN_DATA_FORMAT", b"NUMBER_OF_SETS 999999999", b"nm", b"[[[[[[[[", b"{}", b"null", b"true",
    b"<!ENTITY a 'b'>",
    "é".encode(), "٣".encode(), b"1_000", b"0x10",
)  # fmt: skip


def damage(data: bytes, rng: random.Random, others: Sequence[bytes]) -> bytes:
    """A copy with one to eight injuries, most of them small: other bytes stand where a piece was."""
    found = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 2, 3, 5, 8))):
        at = rng.randrange(len(found) + 1)
        if rng.random() < 0.5:  # where headers lie
            at = min(at, rng.randrange(min(len(found), 600) + 1))
        size = rng.choice((1, 1, 2, 4, 8, 64, 1024)) if rng.random() < 0.97 else len(data)
        piece, other, width = bytes(found[at : at + size]), rng.choice(others), rng.choice((1, 2, 4))
        place, number = rng.randrange(len(other) + 1), rng.choice(NUMBERS) % (1 << (8 * width))
        found[at : at + size] = rng.choice((
            b"", 2 * piece, rng.choice(WORDS), rng.choice(WORDS) + piece, other[place : place + size],
            bytes(byte ^ 1 << rng.randrange(8) for byte in piece[:1]) + piece[1:],
            number.to_bytes(width, rng.choice(("little", "big"))) + piece[width:],
        ))  # fmt: skip
    return bytes(found)


def damage_entries(data: bytes, rng: random.Random) -> bytes:
    """A copy of a TIFF with one to three damaged entries of its directories, which lie at the end of our files."""
    found, order = bytearray(data), "<" if data[:2] == b"II" else ">"
    entries, left = [], [struct.unpack_from(order + "I", data, 4)[0]]
    while left:
        at = left.pop()
        (count,) = struct.unpack_from(order + "H", data, at)
        for entry in range(at + 2, at + 2 + 12 * count, 12):
            entries.append(entry)
            tag, _, several, value = struct.unpack_from(order + "HHII", data, entry)
            if tag in (330, 34665) and several == 1:  # a directory inside, or Exif's
                left.append(value)
        left += [each for each in struct.unpack_from(order + "I", data, at + 2 + 12 * count) if each]
    for _ in range(rng.choice((1, 1, 2, 3))):
        form, offset = rng.choice((("H", 0), ("H", 2), ("I", 4), ("I", 8)))  # tag, type, count, value or its place
        at, other = rng.choice(entries) + offset, rng.choice(entries) + offset
        was, another = (struct.unpack_from(order + form, data, place)[0] for place in (at, other))
        number = rng.choice(
            (*NUMBERS, another, was + 1, was - 1, 2 * was, rng.randrange(14), rng.randrange(len(data)))
        )
        struct.pack_into(order + form, found, at, number % (1 << (8 * struct.calcsize(form))))
    return bytes(found)


def damage_tree(tree: Any, rng: random.Random) -> Any:
    """A JSON document, damaged in place: one node becomes another kind of thing, goes, or doubles."""
    strange: tuple[Any, ...] = (
        None, True, -1, 0, 1e308, -1e308, 2**70, "", "x" * 5000, "\0", "../..", [], {}, [[]], [None] * 3, "NaN",
        1e-320, "<script>alert(1)</script>",
    )  # fmt: skip
    node: Any = [tree]
    whole, key, inner = node, 0, tree
    while isinstance(inner, dict | list) and inner and rng.random() < 0.9:
        node, key = inner, rng.choice(list(inner) if isinstance(inner, dict) else range(len(inner)))
        inner = node[key]
    pick = rng.random()
    if pick < 0.1:
        del node[key]
    elif pick < 0.2 and isinstance(node, list):
        node.insert(key, inner)
    elif pick < 0.2:
        node[rng.choice(("", "x", "__class__", "format"))] = rng.choice(strange)
    elif isinstance(inner, float) and pick < 0.6:
        node[key] = inner * rng.choice((-1, 0, 1e9, 1e-9, 1e300))
    else:
        node[key] = rng.choice(strange)
    return whole[0] if whole else None


@cache
def demo() -> dict[str, bytes]:
    """A patches and a result document of a small simulated capture."""
    with tempfile.TemporaryDirectory() as folder:
        photos = simulate("Nikon 5100 (NPL)", ["D55"], folder, scene=Scene(size=(600, 450)), seed=3)
        result = json.dumps(to_plain(solve(measure(photos.shots[0].shot))))
    # Numbers of four digits: the form is what matters, and small files are quick.
    whole = json.loads(result, parse_float=lambda number: float(f"{float(number):.4g}"))
    patches = {key: whole[key] for key in ("format", "version", "capture")}
    return {name: json.dumps(held).encode() for name, held in (("patches", patches), ("result", whole))}


READERS: dict[str, Callable[[Path], object]] = {
    "dng": read_dng,
    "lamp": lambda path: read_lamp(str(path)),
    "chart": lambda path: read_chart(str(path)),
    "camera": lambda path: read_camera(str(path)),
    "patches": lambda path: read_document(path, Document),
    "result": lambda path: report(Result.load(path)),
    "manifest": lambda path: Manifest(path).read_all(),
}
"""What reads a file, by name."""


@cache
def sound_files(reader: str) -> list[tuple[str, bytes]]:
    """Suffixes and contents of files for a reader: small golden DNGs that are read, documents, or tools/sound."""
    if reader in ("patches", "result"):
        return [("json", demo()[reader])]
    paths = sorted((Path(__file__).parent / "sound" / reader).glob("*"))
    if reader == "dng":
        paths = [path for path in sorted((ROOT / "dng").glob("[!e]*.dng")) if path.stat().st_size < 6000]
    return [(path.suffix[1:], path.read_bytes()) for path in paths]


def damaged(reader: str, seed: int) -> tuple[str, bytes]:
    """Suffix and content of file `seed` of a reader; the same on every machine."""
    rng = random.Random(f"{reader} {seed}")
    files = sound_files(reader)
    suffix, data = rng.choice(files)
    if suffix == "json" and rng.random() < 0.7:
        tree = json.loads(data)
        for _ in range(rng.choice((1, 1, 2, 4))):
            tree = damage_tree(tree, rng)
        return suffix, json.dumps(tree).encode()
    if suffix == "dng" and rng.random() < 0.5:
        return suffix, damage_entries(data, rng)
    return suffix, damage(data, rng, [content for _, content in files])


def read(reader: str, folder: Path, seed: int) -> tuple[str, str]:
    """What became of file `seed`: "read", an error's code, or "finding" with the words. A hanging process ends."""
    suffix, data = damaged(reader, seed)
    path = folder / f"file.{suffix}"
    path.write_bytes(data)
    faulthandler.dump_traceback_later(PATIENCE, exit=True)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            READERS[reader](path)
        return "read", ""
    except CalibrationError as error:
        return error.code, ""
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        return "finding", f"{type(error).__name__}: {error} ({Path(place.filename).name}:{place.lineno})"
    finally:
        faulthandler.cancel_dump_traceback_later()


def fuzz(reader: str, seeds: Sequence[int]) -> Iterator[tuple[int, str, str]]:
    """Each seed with its outcome and words; a process that dies or hangs is a finding, and another follows it."""
    left = list(seeds)
    while left:
        with tempfile.TemporaryDirectory() as folder, ProcessPoolExecutor(1, get_context("spawn")) as pool:
            try:
                for kind, words in pool.map(partial(read, reader, Path(folder)), tuple(left)):
                    yield left.pop(0), kind, words
            except BrokenProcessPool:
                yield left.pop(0), "finding", "the process died or never came back"


def main(arguments: Sequence[str] | None = None) -> int:
    """The command."""
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("--count", type=int, default=50_000, help="damaged files a reader")
    parser.add_argument("--reader", choices=tuple(READERS), action="append", help="all unless given; may be repeated")
    parser.add_argument("--seed", type=int, default=0, help="number of the first file")
    options, found = parser.parse_args(arguments), 0
    seeds = range(options.seed, options.seed + options.count)
    for name in options.reader or list(READERS):
        outcomes: Counter[str] = Counter()
        with progress() as bar:
            for seed, kind, words in bar.track(fuzz(name, seeds), total=options.count, description=name):
                outcomes[kind] += 1
                if kind == "finding":
                    bar.console.print(f"{name} {seed}: {words}", markup=False)
        print(f"{name}:", ", ".join(f"{kind} {n}" for kind, n in outcomes.most_common()))
        found += outcomes["finding"]
    return int(found > 0)


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
