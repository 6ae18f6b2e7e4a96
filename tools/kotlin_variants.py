"""What LibRaw and tifffile read in Kotlin's DNG files: `python -m tools.kotlin_variants`

Has Kotlin's test writer put out its variants, decodes each with LibRaw (rawpy) and with tifffile and imagecodecs, and
stores the SHA-256 of the active area's samples (little-endian 16 bit), or the words of the refusal, where Kotlin's
tests find them. The same for the real files of data/dng. Run it anew when a variant is added, after `mvn package`.
tifffile applies no LinearizationTable.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import rawpy
import tifffile

from benchmarks.shared import one_thread, versions
from benchmarks.turns import BINDINGS, class_path
from camssf.files import write_file

STORED = BINDINGS / "core" / "src" / "test" / "resources" / "dng" / "judges.json"
MOSAIC, ACTIVE_AREA, PHOTOMETRIC = 32803, 50829, 262
JUDGE = "import sys; from tools.kotlin_variants import print_judged; print_judged(sys.argv[1])"


def judge(file: Path) -> dict[str, str]:
    """The digest of the active area (top, left, bottom, right) by each judge, or why not."""

    def digest(samples: Any) -> str:
        top, left, bottom, right = area or (0, 0, *samples.shape)
        return hashlib.sha256(samples[top:bottom, left:right].astype("<u2").tobytes()).hexdigest()

    found = {}
    with tifffile.TiffFile(file) as tiff:
        pages: list[Any] = list(tiff.pages)
        for page in pages:  # grows by the pages within pages
            pages += page.pages or []
        mosaic = next(page for page in pages if page.tags.valueof(PHOTOMETRIC) == MOSAIC)
        area = mosaic.tags.valueof(ACTIVE_AREA)
        try:
            with rawpy.imread(str(file)) as raw:
                found["libraw"] = digest(raw.raw_image)
        except rawpy.LibRawError as error:
            found["libraw"] = f"refused: {error.args[0] if error.args else error!r}"
        try:
            found["tifffile"] = digest(mosaic.asarray())
        except Exception as error:  # a judge may fail in any way
            found["tifffile"] = f"refused: {str(error).splitlines()[0][:90]}"
    return found


def judge_all(folder: Path) -> dict[str, dict[str, str]]:
    """Every DNG of a folder, in two processes whose memory differs: LibRaw leaves some samples to chance."""
    first, second = (
        json.loads(subprocess.check_output([sys.executable, "-c", JUDGE, folder], env=os.environ | fill))
        for fill in ({"MALLOC_PERTURB_": "85"}, {"MALLOC_PERTURB_": "170"})  # of glibc's fresh memory
    )
    for name, found in first.items():
        if found["libraw"] != second[name]["libraw"]:
            found["libraw"] = "refused: other samples each time"
    return dict(first)


def print_judged(folder: str) -> None:
    """What judges say of every DNG of a folder, as JSON."""
    logging.getLogger("tifffile").setLevel(logging.CRITICAL)
    print(json.dumps({file.name: judge(file) for file in sorted(Path(folder).glob("*.dng"))}))


def main() -> None:
    """Writes the file."""
    with tempfile.TemporaryDirectory() as folder:
        places = os.pathsep.join([str(BINDINGS / "core" / "target" / "test-classes"), class_path()])
        subprocess.run(["java", "-cp", places, "org.camssf.photo.dng.VariantFiles", folder], check=True)
        libraw = {"libraw": ".".join(map(str, rawpy.libraw_version))}
        found = {
            "command": "python -m tools.kotlin_variants",
            "versions": versions("rawpy", "tifffile", "imagecodecs") | libraw,
            "variants": judge_all(Path(folder)),
            "real": judge_all(BINDINGS.parent / "data" / "dng"),
        }
    write_file(STORED, json.dumps(found, indent=1) + "\n")
    print(f"{STORED.name}: {len(found['variants'])} variants, {len(found['real'])} real files")


if __name__ == "__main__":
    one_thread(__spec__)
    main()
