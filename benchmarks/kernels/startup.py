"""How long camssf takes to start, and how much it weighs: `python -m benchmarks.kernels.startup [--sizes]`.

Each time is the processor's, the least of several fresh interpreters that take turns, beside `import numpy`: a busy
machine says nothing of the program, and the ratio hangs on no machine. (The wall's time is told, too.) `--sizes`
installs the package into a fresh environment and weighs what came, with Python's bytecode and without; it needs a
package index. Exit status 1 where `calibrate --help` takes 0.4 s or more, or where the installation weighs more than
450 MB without bytecode.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from benchmarks.shared import command_parser, save

ROOT = Path(__file__).parents[2]
BAR_SECONDS, BAR_MEGABYTES = 0.4, 450.0
CALLS = {
    "import numpy": ("-c", "import numpy"),
    "import camssf": ("-c", "import camssf"),
    "from camssf import calibrate": ("-c", "from camssf import calibrate"),
    "camssf --help": ("-m", "camssf", "--help"),
    "camssf calibrate --help": ("-m", "camssf", "calibrate", "--help"),
}


def seconds(runs: int) -> dict[str, tuple[float, float]]:
    """The least processor time and the least wall time of each call, s."""
    best = dict.fromkeys(CALLS, (float("inf"), float("inf")))
    for _ in range(runs):
        for name, arguments in CALLS.items():
            start, before = time.perf_counter(), os.times()
            subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL)
            wall, after = time.perf_counter() - start, os.times()
            spent = after.children_user + after.children_system - before.children_user - before.children_system
            best[name] = min(best[name][0], spent), min(best[name][1], wall)
    return best


def weigh(folder: Path) -> tuple[float, float]:
    """Megabytes of the files in a folder, with bytecode and without."""
    sizes = [(path.suffix == ".pyc", path.stat().st_size) for path in folder.rglob("*") if path.is_file()]
    return sum(size for _, size in sizes) / 1e6, sum(size for compiled, size in sizes if not compiled) / 1e6


def installed() -> tuple[float, float]:
    """What pip's installation adds to an empty environment, MB."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
        places = (Path(folder, "bin", "python"), Path(folder, "Scripts", "python.exe"))
        python = next(path for path in places if path.exists())
        code = "import sysconfig; print(sysconfig.get_paths()['purelib'])"
        place = Path(subprocess.run([python, "-c", code], check=True, capture_output=True, text=True).stdout.strip())
        empty = weigh(place)
        environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        subprocess.run([python, "-m", "pip", "install", "-q", "."], check=True, cwd=ROOT, env=environment)
        full = weigh(place)
    return full[0] - empty[0], full[1] - empty[1]


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, print, keep."""
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("--runs", type=int, default=7)
    parser.add_argument("--sizes", action="store_true", help="install into fresh environments, too")
    options = parser.parse_args(argv)
    times = seconds(options.runs)
    unit = times["import numpy"][0]
    for name, (spent, wall) in times.items():
        print(f"{name:<30} {spent:6.3f} s  {spent / unit:5.2f} × import numpy  (wall {wall:.3f} s)")
    found: dict[str, object] = {
        "processor_seconds": {name: spent for name, (spent, _) in times.items()},
        "ratio": {name: spent / unit for name, (spent, _) in times.items()},
    }
    held = times["camssf calibrate --help"][0] < BAR_SECONDS
    if options.sizes:
        full, bare = installed()
        print(f"{'installed':<30} {full:6.0f} MB, without bytecode {bare:.0f} MB")
        found["megabytes"] = {"with_bytecode": full, "without": bare}
        held = held and bare <= BAR_MEGABYTES
    print(save("startup", found))
    print("every bar held" if held else "a bar was MISSED")
    return int(not held)


if __name__ == "__main__":
    sys.exit(main())
