"""Kotlin's DNG reader beside LibRaw: `python -m benchmarks.kernels.kotlin_decode [--runs 30] [--classpath PATH]`

A 12-megapixel mosaic, smooth with shot noise, in the forms that phones write. One warm JVM with a small heap and
LibRaw (rawpy) decode each file in turn; the ratio is taken pair by pair. Both open the file, parse it and decode all
samples; "with hash" is all of DngReader.read, which also takes the file's SHA-256. The sums of the samples must
agree. Bar: 1.5 x LibRaw for lossless JPEG and for uncompressed, and a heap below 256 MB.
Needs `mvn -f android-bindings test-compile` (or a class path), and imagecodecs.
"""

from __future__ import annotations

import os
import re
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import rawpy
from numpy.typing import NDArray

from benchmarks.kernels.turns import BINDINGS, Jvm, Unavailable, in_turn, or_unavailable, ratio, ratio_cells
from benchmarks.shared import command_parser, console, one_thread, progress, save, table, versions
from golden.dngs import JPEG, Dng

SIZE = (3024, 4032)
BAR = 1.5
HEAP = 64
"""Megabytes of the JVM."""
SERVER = "org.camssf.photo.dng.DecodeServer"
FORMS: dict[str, dict[str, Any]] = {
    "uncompressed, 16 bit": {"bits": 16},
    "uncompressed, 16 bit, big-endian": {"bits": 16, "order": ">"},
    "uncompressed, 12 bit packed": {"bits": 12, "rows_per_strip": 48},
    "uncompressed, 10 bit packed": {"bits": 10, "rows_per_strip": 48},
    "lossless JPEG, 12 bit, one strip": {"bits": 12, "compression": JPEG},
    "lossless JPEG, 12 bit, tiles 256 x 240": {"bits": 12, "compression": JPEG, "tile": (240, 256)},
    "lossless JPEG, 10 bit, tiles 256 x 240": {"bits": 10, "compression": JPEG, "tile": (240, 256)},
}


class Photo(Dng):
    """Lossless JPEG of this size by libjpeg-turbo."""

    def _piece(self, block: NDArray[np.uint16]) -> bytes:
        if self.compression != JPEG:
            return super()._piece(block)
        import imagecodecs

        pairs = np.ascontiguousarray(block).reshape(len(block), -1, 2)
        return bytes(imagecodecs.jpeg_encode(pairs, lossless=True, bitspersample=self.bits))


def compiled() -> str:
    """The compiled bindings and Kotlin's library in the local Maven repository."""
    classes = [BINDINGS / "core" / "target" / kind for kind in ("classes", "test-classes")]
    classes.append(BINDINGS / "model" / "target" / "classes")
    version = re.search(r"<kotlin.version>(.*?)<", (BINDINGS / "pom.xml").read_text(encoding="utf-8"))
    home = Path(os.environ.get("MAVEN_REPOSITORY", Path.home() / ".m2" / "repository"))
    found = version.group(1) if version else ""
    library = home / f"org/jetbrains/kotlin/kotlin-stdlib/{found}/kotlin-stdlib-{found}.jar"
    for place in (*classes, library):
        if not place.exists():
            raise Unavailable(f"{place} is missing: run mvn -f android-bindings test-compile, or give --classpath.")
    return os.pathsep.join(str(place) for place in (*classes, library))


def scene(bits: int) -> NDArray[np.uint16]:
    """A slope from an eighth to seven eighths of the range, four colours of unlike gain, and shot noise."""
    rng = np.random.default_rng(7)
    height, width = SIZE
    full = 2.0**bits
    slope = 0.125 + 0.375 * (np.linspace(0, 1, height)[:, None] + np.linspace(0, 1, width)[None, :])
    slope[0::2, 0::2] *= 0.6
    slope[1::2, 1::2] *= 0.5
    light = slope * full
    noisy = light + rng.normal(size=SIZE) * np.sqrt(light * full / 4000.0)  # 4,000 electrons at full scale
    return np.clip(np.rint(noisy), 0, full - 1).astype(np.uint16)


def libraw(file: Path) -> tuple[float, int]:
    """Seconds to open and decode, and the sum of the samples."""
    start = time.perf_counter()
    with rawpy.imread(str(file)) as raw:
        image = raw.raw_image
        seconds = time.perf_counter() - start
        return seconds, int(image.sum(dtype=np.int64))


def measure(jvm: Jvm, file: Path, runs: int) -> dict[str, Any]:
    """Medians and the ratio's spread over `runs` turns, after half as many to warm up."""
    sums = set()

    def kotlin(what: str) -> tuple[float, int]:
        nanoseconds, total = jvm.ask(f"{what} {file}")
        return int(nanoseconds) / 1e9, int(total)

    def seconds(decode: Callable[[], tuple[float, int]]) -> float:
        taken, total = decode()
        sums.add(total)
        return taken

    contenders = {
        "libraw_seconds": lambda: seconds(lambda: libraw(file)),
        "kotlin_seconds": lambda: seconds(lambda: kotlin("decode")),
        "kotlin_with_hash_seconds": lambda: seconds(lambda: kotlin("read")),
    }
    times = in_turn(contenders, runs, warm=max(runs // 2, 5))
    if len(sums) != 1:
        raise SystemExit(f"{file.name}: the samples differ from LibRaw's.")
    medians = {name: statistics.median(taken) for name, taken in times.items()}
    spread = ratio(times["kotlin_seconds"], times["libraw_seconds"])
    return {"megabytes": file.stat().st_size / 1e6} | medians | spread


@or_unavailable
def main() -> int:
    """Runs, prints, saves; 1 where the bar is broken, 2 where it cannot run."""
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("--runs", type=int, default=30)
    parser.add_argument("--classpath", help="of the compiled bindings and tests, and kotlin-stdlib")
    parser.add_argument("--only", default="", help="forms whose name holds this")
    options = parser.parse_args()
    forms: dict[str, dict[str, Any]] = {}
    path = options.classpath or compiled()
    with tempfile.TemporaryDirectory() as folder, Jvm(path, SERVER, heap=HEAP) as jvm, progress() as bar:
        chosen = [name for name in FORMS if options.only in name]
        for name in bar.track(chosen, description="12 megapixels"):
            file = Path(folder) / "photo.dng"
            file.write_bytes(Photo(scene(FORMS[name]["bits"]), **FORMS[name]).encode())
            forms[name] = measure(jvm, file, options.runs)
    keys = ("libraw_seconds", "kotlin_seconds", "kotlin_with_hash_seconds")
    rows = [
        (name, f"{one['megabytes']:.1f}", *(f"{1e3 * one[key]:.0f}" for key in keys), *ratio_cells(one))
        for name, one in forms.items()
    ]
    head = ("12 megapixels", "MB", "LibRaw ms", "Kotlin ms", "with hash ms", "ratio", "10 to 90 %")
    title = f"Decoding, medians of {options.runs} pairs, warm, heap of {HEAP} MB; bar {BAR} x LibRaw"
    console().print(table(title, head, rows))
    if not options.only:
        content = {"versions": versions("rawpy"), "runs": options.runs, "heap_megabytes": HEAP, "forms": forms}
        print(save("kotlin_decode", content))
    return int(any(one["ratio"] > BAR for one in forms.values()))


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
