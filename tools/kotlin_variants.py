"""What LibRaw and tifffile read in Kotlin's DNG files: `python -m tools.kotlin_variants [--classpath PATH]`

Has Kotlin's test writer put out its variants, decodes each with LibRaw (rawpy) and with tifffile and imagecodecs, and
stores the SHA-256 of the active area's samples (little-endian 16 bit), or the words of the refusal, where Kotlin's
tests find them. The same for the real files of data/dng. Run it anew when a variant is added. tifffile applies
no LinearizationTable.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import logging
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import rawpy
import tifffile
from numpy.typing import NDArray

from benchmarks.kernels.kotlin_decode import BINDINGS, Unavailable, class_path
from benchmarks.shared import one_thread, versions

STORED = BINDINGS / "core" / "src" / "test" / "resources" / "dng" / "judges.json"
REAL = Path(__file__).parents[1] / "data" / "dng"


def mosaic_page(tiff: tifffile.TiffFile) -> Any:
    """The page of the colour filter mosaic, down to grandchildren."""
    waiting = list(tiff.pages)
    while waiting:
        page: Any = waiting.pop(0)
        if page.tags.valueof(262) == 32803:
            return page
        waiting += list(page.pages or [])
    raise ValueError("no mosaic")


def digest(samples: NDArray[np.integer[Any]], area: tuple[int, int, int, int] | None) -> str:
    """Of the active area (top, left, bottom, right)."""
    top, left, bottom, right = area or (0, 0, *samples.shape)
    return hashlib.sha256(samples[top:bottom, left:right].astype("<u2").tobytes()).hexdigest()


def by_libraw(file: Path, area: tuple[int, int, int, int] | None) -> str:
    """The digest, or why not."""
    try:
        with rawpy.imread(str(file)) as raw:
            return digest(raw.raw_image, area)
    except rawpy.LibRawError as error:
        return f"refused: {error.args[0] if error.args else error!r}"


def by_tifffile(page: Any, area: tuple[int, int, int, int] | None) -> str:
    """The digest, or why not."""
    try:
        return digest(page.asarray(), area)
    except Exception as error:  # a judge may fail in any way
        return f"refused: {str(error).splitlines()[0][:90]}"


def judge(file: Path) -> dict[str, str]:
    """Both judges' digests."""
    with tifffile.TiffFile(file) as tiff:
        page = mosaic_page(tiff)
        area = page.tags.valueof(50829)
        return {"libraw": by_libraw(file, area), "tifffile": by_tifffile(page, area)}


def judge_all(folder: Path) -> dict[str, dict[str, str]]:
    """Every DNG of a folder, in two processes whose memory differs: LibRaw leaves some samples to chance."""
    command = [sys.executable, "-m", "tools.kotlin_variants", "--judge", str(folder)]
    runs = []
    for fill in ("85", "170"):  # of glibc's fresh memory
        done = subprocess.run(
            command, env=os.environ | {"MALLOC_PERTURB_": fill}, check=True, capture_output=True, text=True
        )
        runs.append(json.loads(done.stdout))
    for name, found in runs[0].items():
        if found["libraw"] != runs[1][name]["libraw"]:
            found["libraw"] = "refused: other samples each time"
    return dict(runs[0])


def main() -> int:
    """Writes the file; 2 where it cannot."""
    parser = argparse.ArgumentParser(prog="python -m tools.kotlin_variants", description=__doc__)
    parser.add_argument("--classpath", help="of the compiled bindings and tests, and kotlin-stdlib")
    parser.add_argument("-o", type=Path, default=STORED, help="where to write")
    parser.add_argument("--judge", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    libraw = ".".join(map(str, rawpy.libraw_version))
    logging.getLogger("tifffile").setLevel(logging.CRITICAL)
    if options.judge:
        print(json.dumps({file.name: judge(file) for file in sorted(options.judge.glob("*.dng"))}))
        return 0
    with tempfile.TemporaryDirectory() as folder:
        try:
            path = options.classpath or class_path()
            subprocess.run(["java", "-cp", path, "org.camssf.photo.dng.VariantFiles", folder], check=True)
        except (Unavailable, OSError, subprocess.CalledProcessError) as error:
            print(error, file=sys.stderr)
            return 2
        found = {
            "command": "python -m tools.kotlin_variants",
            "versions": versions("rawpy", "tifffile", "imagecodecs") | {"libraw": libraw},
            "variants": judge_all(Path(folder)),
            "real": judge_all(REAL),
        }
    options.o.parent.mkdir(parents=True, exist_ok=True)
    temporary = options.o.with_suffix(f".{os.getpid()}")
    temporary.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    os.replace(temporary, options.o)
    print(f"{options.o.name}: {len(found['variants'])} variants, {len(found['real'])} real files")
    return 0


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
