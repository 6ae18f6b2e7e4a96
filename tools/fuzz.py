"""Does any damaged file crash a reader? `python -m tools.fuzz [--count 50000] [--reader dng] [--seed 1]`

Sound files of every kind that camssf reads, damaged at random: bytes changed, cut out, doubled, spliced from another
file, numbers and words of the format put where they do not belong; JSON also as a tree. A reader may return, or
refuse by a `CalibrationError`; any other exception, a warning, a process that dies (LibRaw is C++) or a read longer
than ten seconds is a finding, printed with the seed that makes the file again (`--seed S --count 1`: file S).

Files go through each reader in a process of their own that is replaced when it dies. Exit status 1 with findings.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import random
import struct
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Sequence
from functools import cache
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from benchmarks.shared import console, one_thread, progress, save, table, versions
from camssf.errors import CalibrationError

SLOW = 10.0
"""Seconds in which a small file must be read."""
PATIENCE = 120.0
"""Seconds after which a process is given up, its start on a busy machine included."""
BATCH = 200
"""Files asked for at once."""
GOLDEN = Path(__file__).parents[1] / "golden"
NUMBERS = (0, 1, 2, 3, 7, 8, 255, 256, 32767, 32768, 65535, 65536, 2**31 - 1, 2**31, 2**32 - 1)
WORDS = (
    b"nan", b"inf", b"-1", b"1e999", b"-0", b"1e-320", b"9" * 400, b"\0", b"\xff\xfe", b"\xef\xbb\xbf", b"\"", b"'",
    b",", b";", b"\t", b"\n", b"\r", b"=1+1", b"../../etc/passwd", b"<script>", b"%s%n", b"BEGIN_DATA", b"END_DATA",
    b"BEGIN_DATA_FORMAT", b"NUMBER_OF_SETS 999999999", b"nm", b"[[[[[[[[", b"{}", b"null", b"true",
    b"<!ENTITY a 'b'>",
    "é".encode(), "٣".encode(), b"1_000", b"0x10",
)  # fmt: skip


def mutate(data: bytes, rng: random.Random, others: Sequence[bytes]) -> bytes:
    """A damaged copy: one to eight injuries, most of them small; the size at most doubles and a bit."""
    found = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 2, 3, 5, 8))):
        at = rng.randrange(len(found) + 1)
        if rng.random() < 0.5:  # where headers lie
            at = min(at, rng.randrange(min(len(found), 600) + 1))
        end = min(len(found), at + rng.choice((1, 2, 4, 8, 64, 1024)))
        kind = rng.randrange(9)
        if kind == 0 and at < len(found):
            found[at] ^= 1 << rng.randrange(8)
        elif kind == 1 and at < len(found):
            found[at] = rng.randrange(256)
        elif kind == 2:
            width = rng.choice((1, 2, 4))
            number = rng.choice(NUMBERS) % (1 << (8 * width))
            found[at : at + width] = number.to_bytes(width, rng.choice(("little", "big")))
        elif kind == 3:
            del found[at:end]
        elif kind == 4 and len(found) < 2 * len(data) + 4096:
            found[at:at] = found[at:end]
        elif kind == 5 and len(found) < 2 * len(data) + 4096:
            found[at:at] = rng.choice(WORDS)
        elif kind == 6:
            found[at:end] = rng.choice(WORDS)
        elif kind == 7:
            other = rng.choice(others)
            place = rng.randrange(len(other) + 1)
            found[at:end] = other[place : place + end - at]
        elif rng.random() < 0.2:
            del found[at:]
    return bytes(found)


def mutate_entry(data: bytes, rng: random.Random) -> bytes:
    """A copy of a TIFF with one to three damaged entries of its directories, which lie at the end of our files."""
    found = bytearray(data)
    order = "<" if data[:2] == b"II" else ">"
    entries = _entries(data, order)
    for _ in range(rng.choice((1, 1, 2, 3))):
        at = rng.choice(entries)
        _, _, count, value = struct.unpack_from(order + "HHII", data, at)
        numbers = (*NUMBERS, count + 1, max(count - 1, 0), 2 * count, value + 1, rng.randrange(len(data)))
        number, kind = rng.choice(numbers) % 2**32, rng.randrange(6)
        if kind == 0:
            struct.pack_into(order + "H", found, at, struct.unpack_from(order + "H", data, rng.choice(entries))[0])
        elif kind == 1:
            struct.pack_into(order + "H", found, at + 2, rng.randrange(14))
        elif kind in (2, 3):
            struct.pack_into(order + "I", found, at + 4 * kind - 4, number)
        elif value < len(data) - 16:
            place = value if kind == 4 else at + 8
            found[place + rng.randrange(4)] ^= 1 << rng.randrange(8)
    return bytes(found)


def _entries(data: bytes, order: str) -> list[int]:
    """Where the entries of all directories lie."""
    found, left = [], [struct.unpack_from(order + "I", data, 4)[0]]
    while left:
        at = left.pop()
        (count,) = struct.unpack_from(order + "H", data, at)
        for entry in range(at + 2, at + 2 + 12 * count, 12):
            found.append(entry)
            tag, _, several, value = struct.unpack_from(order + "HHII", data, entry)
            if tag in (330, 34665) and several == 1:
                left.append(value)
        left += [each for each in struct.unpack_from(order + "I", data, at + 2 + 12 * count) if each]
    return found


def mutate_tree(value: Any, rng: random.Random) -> Any:
    """A damaged copy of a JSON document: one node becomes another kind of thing, goes, or doubles."""
    strange: tuple[Any, ...] = (
        None, True, -1, 0, 1e308, -1e308, 2**70, "", "x" * 5000, "\0", "../..", [], {}, [[]], [None] * 3, "NaN",
        1e-320, "<script>alert(1)</script>",
    )  # fmt: skip
    if isinstance(value, dict) and value and rng.random() < 0.9:
        key = rng.choice(list(value))
        rest = {k: v for k, v in value.items() if k != key}
        pick = rng.random()
        if pick < 0.08:
            return rest
        if pick < 0.12:
            return value | {rng.choice(("", "x", "__class__", "format")): rng.choice(strange)}
        return value | {key: mutate_tree(value[key], rng)}
    if isinstance(value, list) and value and rng.random() < 0.9:
        at = rng.randrange(len(value))
        pick = rng.random()
        if pick < 0.1:
            return value[:at] + value[at + 1 :]
        if pick < 0.2:
            return [*value[:at], value[at], *value[at:]]
        return [*value[:at], mutate_tree(value[at], rng), *value[at + 1 :]]
    if isinstance(value, float) and rng.random() < 0.5:
        return value * rng.choice((-1, 0, 1e9, 1e-9, 1e300))
    return rng.choice(strange)


# readers: sound files, and what reads them


def _dng(path: Path) -> None:
    from camssf.photo.read.dng import read_dng

    read_dng(path)


def _lamp(path: Path) -> None:
    from camssf.spectra import read_lamp

    read_lamp(str(path))


def _chart(path: Path) -> None:
    from camssf.spectra import read_chart

    read_chart(str(path))


def _camera(path: Path) -> None:
    from camssf.spectra import read_camera

    read_camera(str(path))


def _patches(path: Path) -> None:
    from camssf.documents.document import Document, read_document

    read_document(path, Document)


def _result(path: Path) -> None:
    from camssf.report.build import report
    from camssf.result import Result

    report(Result.load(path))


def _manifest(path: Path) -> None:
    from camssf_fleet.manifest import Manifest

    Manifest(path).read_all()


@cache
def _demo() -> dict[str, bytes]:
    """A patches and a result document of a small simulated capture."""
    from camssf.calibration import solve
    from camssf.documents.document import Document
    from camssf.documents.forms import to_plain
    from camssf.photo.capture import measure
    from camssf_lab.simulation.frames import simulate
    from camssf_lab.simulation.scene import Scene

    with tempfile.TemporaryDirectory() as folder:
        shot = simulate("Nikon 5100 (NPL)", ["D55"], folder, scene=Scene(size=(600, 450)), seed=3).shots[0]
        capture = measure(shot.shot)
        result = solve(capture)
    patches = Document(format=result.format, version=result.version, capture=capture)
    documents = {"patches": to_plain(patches), "result": to_plain(result)}
    return {name: json.dumps(_short(document)).encode() for name, document in documents.items()}


def _short(value: Any) -> Any:
    """Numbers to four digits: the form is what matters, and small files are quick."""
    if isinstance(value, dict):
        return {key: _short(v) for key, v in value.items()}
    if isinstance(value, list | tuple):
        return [_short(v) for v in value]
    return float(f"{value:.4g}") if isinstance(value, float) else value


def _spectrum(separator: str = ",") -> bytes:
    rows = [f"{nm}{separator}{50 + nm % 37}" for nm in range(380, 731, 5)]
    return "\n".join([f"wavelength{separator}power", *rows, ""]).encode()


def _cgats(patches: int) -> bytes:
    bands = range(380, 731, 10)
    names = " ".join(f"nm{band}" for band in bands)
    head = ["CGATS.17", "NUMBER_OF_FIELDS 37", "BEGIN_DATA_FORMAT", f"SAMPLE_NAME {names}", "END_DATA_FORMAT",
             f"NUMBER_OF_SETS {patches}", "BEGIN_DATA"]  # fmt: skip
    body = [
        f"{'ABCD'[i // 6]}{i % 6 + 1} " + " ".join(f"{0.9 / (1 + i % 7):.4f}" for _ in bands) for i in range(patches)
    ]
    return "\n".join([*head, *body, "END_DATA", ""]).encode()


def _table(patches: int) -> bytes:
    from camssf.spectra import read_chart

    known = read_chart("classic24")
    rows = [",".join(["name", *(str(nm) for nm in range(380, 721, 10))])]
    rows += [",".join([name.replace(",", ""), *(f"{v:.5f}" for v in values[::20])])
             for name, values in zip(known.patches, known.values, strict=True)]  # fmt: skip
    return "\n".join([*rows[: patches + 1], ""]).encode()


def _cxf(patches: int) -> bytes:
    spectrum = " ".join("0.5" for _ in range(36))
    objects = "".join(
        f'<cc:Object ObjectType="Standard" Name="A{i}" Id="{i}"><cc:ColorValues><cc:ReflectanceSpectrum '
        f'ColorSpecification="c" StartWL="380">{spectrum}</cc:ReflectanceSpectrum></cc:ColorValues></cc:Object>'
        for i in range(patches)
    )
    return (
        '<?xml version="1.0" encoding="UTF-8"?><cc:CxF xmlns:cc="http://colorexchangeformat.com/CxF3-core">'
        f"<cc:Resources><cc:ObjectCollection>{objects}</cc:ObjectCollection><cc:ColorSpecificationCollection>"
        '<cc:ColorSpecification Id="c"><cc:MeasurementSpec>'
        "<cc:MeasurementType>Spectrum_Reflectance</cc:MeasurementType>"
        '<cc:WavelengthRange StartWL="380" Increment="10"/></cc:MeasurementSpec></cc:ColorSpecification>'
        "</cc:ColorSpecificationCollection></cc:Resources></cc:CxF>"
    ).encode()


def _curves() -> bytes:
    rows = [f"{nm},{1 + nm % 5},{2 + nm % 7},{3 + nm % 3}" for nm in range(380, 731, 5)]
    return "\n".join(["wavelength_nm,red,green,blue", *rows, ""]).encode()


def _spdx() -> bytes:
    samples = "".join(f'<SpectralData wavelength="{nm}.0">{50 + nm % 37}</SpectralData>' for nm in range(380, 731, 5))
    return (
        '<?xml version="1.0"?><IESTM2714 xmlns="iestm2714" version="1.0"><Header><Comments>x</Comments></Header>'
        f"<SpectralDistribution><SpectralQuantity>relative</SpectralQuantity>{samples}</SpectralDistribution>"
        "</IESTM2714>"
    ).encode()


def _argyll() -> bytes:
    bands = range(380, 731, 10)
    fields, values = " ".join(f"SPEC_{nm}" for nm in bands), " ".join(f"{50 + nm % 37}" for nm in bands)
    return (
        'SPECT\n\nMEAS_TYPE "EMISSION"\nSPECTRAL_BANDS "36"\nSPECTRAL_START_NM "380.0"\nSPECTRAL_END_NM "730.0"\n'
        f"NUMBER_OF_FIELDS 36\nBEGIN_DATA_FORMAT\n{fields}\nEND_DATA_FORMAT\nNUMBER_OF_SETS 1\nBEGIN_DATA\n{values}\n"
        "END_DATA\n"
    ).encode()


def _sekonic() -> bytes:
    lines = [f"Spectral Data {nm}[nm],{50 + nm % 37}" for step in (5, 2) for nm in range(380, 781, step)]
    return "\n".join(["Date Saved,15/03/2021", "Tcp [K],3262", "", *lines, ""]).encode()


def _uprtek() -> bytes:
    return "\n".join(
        ["Model Name\tCV600", "Memo", *(f"{nm}nm\t{50 + nm % 37}" for nm in range(380, 781, 2))]
    ).encode()


def _rawtoaces() -> bytes:
    rows = {str(nm): [1.0 + nm % 5, 2 + nm % 7, 3.5] for nm in range(380, 731, 5)}
    spectra = {"units": "relative", "index": {"main": ["R", "G", "B"]}, "data": {"main": rows}}
    return json.dumps({"header": {"manufacturer": "M", "model": "m"}, "spectral_data": spectra}).encode()


def _illuminant() -> bytes:
    spectra = {
        "index": {"main": ["power"]},
        "data": {"main": {str(nm): [50.0 + nm % 37] for nm in range(380, 731, 5)}},
    }
    return json.dumps({"header": {"illuminant": "lamp"}, "spectral_data": spectra}).encode()


def _one_row() -> bytes:
    bands = range(380, 731, 5)
    rows = (["name", *(f"{nm} nm" for nm in bands)], ["lamp", *(f"{50 + nm % 37},5" for nm in bands)])
    return "\n".join(";".join(row) for row in rows).encode()


def _marked() -> bytes:
    return b"Date: x\n>>>>>Begin<<<<<\n" + _spectrum("\t").partition(b"\n")[2] + b">>>>>End<<<<<\nCCT\t5503\n"


def _dcamprof(note: str = "") -> bytes:
    curves = [[1.0 + (nm + c) % 5 for nm in range(400, 721, 10)] for c in range(3)]
    names = ("red_ssf", "green_ssf", "blue_ssf")
    found = {"camera_name": "M m", "ssf_bands": [400, 720, 10]} | dict(zip(names, curves, strict=True))
    return f"{note}{json.dumps(found)}".encode()


def _cmf() -> bytes:
    sound = _argyll().replace(b"SPECT\n", b"CMF  \n", 1).replace(b'MEAS_TYPE "EMISSION"\n', b"")
    head, values, end = sound.partition(b"NUMBER_OF_SETS 1\nBEGIN_DATA\n")
    line = end.partition(b"\n")[0]
    return head + values.replace(b"1", b"3") + b"\n".join([line, line, end])


def _spectacle() -> bytes:
    rows = [f"{nm}.0,{1 + nm % 5},{2 + nm % 7},3,{2 + nm % 6},.1,.1,nan,.1" for nm in range(380, 731, 5)]
    return "\n".join(["# wavelength,R,G,B,G2,R_err,G_err,B_err,G2_err", *rows, ""]).encode()


def _camspec() -> bytes:
    line = "\t".join(f"0.{nm}" for nm in range(400, 721, 10))
    return "\n".join(["Canon EOS 5D", line, line, line, ""]).encode()


def _dngs() -> list[tuple[str, bytes]]:
    files = [path for path in sorted((GOLDEN / "dng").glob("*.dng")) if not path.name.startswith("error")]
    return [("dng", path.read_bytes()) for path in files if path.stat().st_size < 6000]


MANIFEST = b"name,photo,lamp,white,dark,chart\nA,a.dng,D55,w.dng,none,classic24\nB,b.dng,2856K,,,\nB,c.dng,D65,,,\n"
READERS: dict[str, tuple[Callable[[Path], None], Callable[[], list[tuple[str, bytes]]]]] = {
    "dng": (_dng, _dngs),
    "lamp": (
        _lamp,
        lambda: [
            ("csv", _spectrum()),
            ("txt", _spectrum("\t")),
            ("spd", _spectrum(" ")),
            ("txt", _cgats(1)),
            ("sp", _argyll()),
            ("spdx", _spdx()),
            ("csv", "\n".join(f"{nm},{50 + nm % 37},{0.5 + nm % 3}" for nm in range(380, 731, 5)).encode()),
            ("csv", _sekonic()),
            ("xls", _uprtek()),
            ("json", _illuminant()),
            ("csv", _one_row()),
            ("txt", _marked()),
        ],
    ),
    "chart": (_chart, lambda: [("csv", _table(24)), ("txt", _cgats(24)), ("cxf", _cxf(24))]),
    "camera": (
        _camera,
        lambda: [
            ("csv", _curves()),
            ("csv", _curves().partition(b"\n")[2]),
            ("json", _rawtoaces()),
            ("json", _dcamprof()),
            ("txt", _dcamprof("// a camera\n/* of */ ")),
            ("csv", _spectacle()),
            ("txt", _camspec()),
            ("cmf", _cmf()),
        ],
    ),
    "patches": (_patches, lambda: [("json", _demo()["patches"])]),
    "result": (_result, lambda: [("json", _demo()["result"])]),
    "manifest": (_manifest, lambda: [("csv", MANIFEST), ("csv", MANIFEST.replace(b",", b";"))]),
}
"""By name: what reads a file, and sound files with their suffixes."""


def damaged(reader: str, seed: int) -> tuple[str, bytes]:
    """Suffix and content of file `seed` of a reader; the same on every machine."""
    rng = random.Random(f"{reader} {seed}")
    files = _files(reader)
    suffix, data = rng.choice(files)
    if suffix == "json" and rng.random() < 0.7:
        tree = _tree(data)
        for _ in range(rng.choice((1, 1, 2, 4))):
            tree = mutate_tree(tree, rng)
        return suffix, json.dumps(tree).encode()
    if suffix == "dng" and rng.random() < 0.5:
        return suffix, mutate_entry(data, rng)
    return suffix, mutate(data, rng, [content for _, content in files])


@cache
def _tree(data: bytes) -> Any:
    return json.loads(data)


@cache
def _files(reader: str) -> list[tuple[str, bytes]]:
    return READERS[reader][1]()


def read(reader: str, seed: int, folder: Path) -> tuple[str, str]:
    """What became of file `seed`: "read", an error's code, or "finding" with the words."""
    suffix, data = damaged(reader, seed)
    path = folder / f"file.{suffix}"
    path.write_bytes(data)
    start = time.monotonic()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            READERS[reader][0](path)
        outcome = ("read", "")
    except CalibrationError as error:
        outcome = (error.code, "")
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        return "finding", f"{type(error).__name__}: {error} ({Path(place.filename).name}:{place.lineno})"
    if time.monotonic() - start > SLOW:
        return "finding", f"took {time.monotonic() - start:.0f} s"
    return outcome


def _serve(pipe: Connection, reader: str) -> None:
    """In the other process: lists of seeds in, outcomes out, each as soon as it is known."""
    aside = tempfile.TemporaryDirectory()
    with aside as folder:
        while seeds := pipe.recv():
            for seed in seeds:
                pipe.send(read(reader, seed, Path(folder)))


def fuzz(
    reader: str, seeds: Sequence[int], advance: Callable[[], None]
) -> tuple[Counter[str], list[tuple[int, str]]]:
    """Outcomes by kind, and findings with their seeds."""
    found: Counter[str] = Counter()
    findings: list[tuple[int, str]] = []
    context = multiprocessing.get_context("spawn")
    child = pipe = None
    done = 0
    while done < len(seeds):
        if child is None or pipe is None:
            pipe, theirs = context.Pipe()
            child = context.Process(target=_serve, args=(theirs, reader), daemon=True)
            child.start()
            theirs.close()
        batch = list(seeds[done : done + BATCH])
        pipe.send(batch)
        for seed in batch:
            kind, words = _outcome(child, pipe)
            done += 1
            found[kind] += 1
            if kind == "finding":
                findings.append((seed, words))
            advance()
            if not child.is_alive():
                child = None
                break
    if child is not None and pipe is not None:
        pipe.send(None)
        child.join()
    return found, findings


def _outcome(child: multiprocessing.process.BaseProcess, pipe: Connection) -> tuple[str, str]:
    """The next one; of a process that dies or hangs, that."""
    try:
        if pipe.poll(PATIENCE):
            kind, words = pipe.recv()
            return str(kind), str(words)
        child.kill()
        child.join()
        return "finding", "never came back"
    except (EOFError, OSError):
        child.join()
        return "finding", f"the process died with status {child.exitcode}"


def main(arguments: Sequence[str] | None = None) -> int:
    """The command."""
    parser = argparse.ArgumentParser(prog="python -m tools.fuzz", description=__doc__)
    parser.add_argument("--count", type=int, default=50_000, help="damaged files a reader")
    parser.add_argument("--reader", choices=tuple(READERS), action="append", help="all unless given; may be repeated")
    parser.add_argument("--seed", type=int, default=0, help="number of the first file")
    options = parser.parse_args(arguments)
    rows, total = [], {}
    out = console()
    names = options.reader or list(READERS)
    with progress() as bar:
        for name in names:
            task = bar.add_task(name, total=options.count)
            start = time.monotonic()
            seeds = range(options.seed, options.seed + options.count)
            found, findings = fuzz(name, seeds, lambda task=task: bar.advance(task))  # type: ignore[misc]
            total[name] = {
                "files": options.count,
                "first": options.seed,
                "outcomes": dict(found.most_common()),
                "findings": findings[:100],
                "seconds": round(time.monotonic() - start, 1),
            }
            others = ", ".join(
                f"{kind} {count}" for kind, count in found.most_common() if kind not in ("read", "finding")
            )
            rows.append(
                [name, options.count, found["read"], others, found["finding"], f"{total[name]['seconds']:.0f}"]
            )
            for seed, words in findings[:20]:
                bar.console.print(f"{name} {seed}: {words}", markup=False)
    out.print(table("Damaged files", ["reader", "files", "read", "refused", "findings", "s"], rows))
    if options.count >= 50_000:
        out.print(save("fuzz", total | {"versions": versions("rawpy")}))
    return 1 if any(each["findings"] for each in total.values()) else 0


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
