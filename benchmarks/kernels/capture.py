"""`python -m benchmarks.kernels.capture`: a whole calibration beside a bare decode of the same file.

Makes a 12-megapixel lossless-JPEG DNG of a simulated chart, then in one run, in turns: `rawpy.imread().raw_image`,
which unpacks the samples, and `camssf.calibrate(...)`: reading, chart search, patches, curves, scores and verdict,
without HTML. One thread. Imports and first calls are not counted. Bars: at most 2 × the decode (goal 1.3 ×); memory
peak, of a process of its own and beyond what its imports take (Linux only), at most 4 × the mosaic. Exit status 1
where a bar is missed.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, TypeAlias

import rawpy

from benchmarks.kernels.turns import clocked, in_turn, ratio, ratio_cells
from benchmarks.shared import command_parser, one_thread, save, versions
from camssf import Options, calibrate
from camssf_lab.simulation.camera import Sensor
from camssf_lab.simulation.frames import simulate
from camssf_lab.simulation.scene import Scene

SIZE = (4000, 3000)
RATIO_BAR, MEMORY_BAR = 2.0, 4.0
Result: TypeAlias = dict[str, Any]
MEMORY = """
import re, sys
from pathlib import Path
from camssf import Options, calibrate
def kilobytes(field):
    return int(re.search(field + r":\\s+(\\d+) kB", Path("/proc/self/status").read_text())[1])
calibrate(sys.argv[1], "D55", options=Options(basis=sys.argv[3]))   # a small photo: every import and first call
before = kilobytes("VmRSS")
calibrate(sys.argv[2], "D55", options=Options(basis=sys.argv[3]))
print(kilobytes("VmHWM") - before)
"""


def decode(path: Path) -> int:
    """The yardstick: LibRaw's samples and nothing else."""
    with rawpy.imread(str(path)) as raw:
        return int(raw.raw_image[-1, -1])


def measure(runs: int, basis: str) -> Result:
    """Both in turns, and the memory of a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        print("simulating a 12-megapixel lossless-JPEG DNG ...", file=sys.stderr)
        camera, where = "Nikon 5100 (NPL)", Path(folder)
        large, packed = Scene(size=SIZE), Sensor(compression="ljpeg")
        photo = simulate(camera, "D55", where / "12mp", scene=large, sensor=packed).shots[0].chart
        small = simulate(camera, "D55", where / "small", scene=Scene(size=(900, 675))).shots[0].chart
        calibrate(small, "D55", options=Options(basis=basis))
        decode(photo)
        times = in_turn(
            {
                "decode_seconds": clocked(lambda: decode(photo)),
                "calibrate_seconds": clocked(lambda: calibrate(photo, "D55", options=Options(basis=basis))),
            },
            runs,
        )
        words = [sys.executable, "-c", MEMORY, str(small), str(photo), basis]
        peak = subprocess.run(words, capture_output=True, text=True, check=True)
        megabytes = photo.stat().st_size / 1e6
    medians = {name: statistics.median(seconds) for name, seconds in times.items()}
    spread = ratio(times["calibrate_seconds"], times["decode_seconds"])
    over = int(peak.stdout) * 1024 / (SIZE[0] * SIZE[1] * 2)
    return {"file_megabytes": megabytes} | medians | spread | {"peak_over_mosaic": over}


def held(result: Result) -> bool:
    """Whether both bars are met; NaN misses."""
    return bool(result["ratio"] <= RATIO_BAR and result["peak_over_mosaic"] <= MEMORY_BAR)


def main(arguments: list[str] | None = None) -> int:
    """Prints what was measured; 1 where a bar is missed."""
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("--runs", type=int, default=9)
    parser.add_argument("--basis", default="cameras")
    options = parser.parse_args(arguments)

    result = measure(options.runs, options.basis)
    print(f"DNG {result['file_megabytes']:.1f} MB, {options.runs} pairs, medians")
    print(f"bare decode      {result['decode_seconds']:.3f} s")
    print(f"calibrate        {result['calibrate_seconds']:.3f} s   ({options.basis})")
    median, spread = ratio_cells(result)
    print(f"ratio            {median}   ({spread}; bar {RATIO_BAR:g}, goal 1.3)")
    print(f"peak memory      {result['peak_over_mosaic']:.2f} x the mosaic   (bar {MEMORY_BAR:g})")
    print("every bar held" if held(result) else "a bar was MISSED")
    print(save("capture", {"versions": versions("rawpy"), "runs": options.runs, "basis": options.basis} | result))
    return 0 if held(result) else 1


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
