"""The Kotlin library on AArch64 without a phone: `python -m benchmarks.kernels.arm_jvm [CASE ...] [--work DIR]`

Runs every golden case that Kotlin can run, or those named, in an AArch64 JVM under user-mode QEMU, with the real
AArch64 ONNX Runtime out of its jar, and the same in this machine's JVM. Bar: no case fails, and the recovered curves
differ from those that Python stored by at most 1e-9 of the peak. Build first:
`mvn -f android-bindings -DskipTests package`. Emulation is exact arithmetic by the processor's rules, not timing;
Android's own loader stays unproven.

Needs qemu-user-static and a Debian's apt-get, but no root. The first run fetches a JVM for arm64 from the machine's
own apt source into the cache folder, 0.3 GB unpacked; later runs need no network.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

from benchmarks.kernels.arm import CACHE, root_folder, tools
from benchmarks.kernels.turns import Unavailable, class_path, or_unavailable
from benchmarks.shared import command_parser, console, save, table

BAR = 1e-9
JRE = "default-jre-headless"
GOLDEN = Path(__file__).parents[2] / "golden"


def java_of(root: Path) -> Path:
    """The emulated system's JVM."""
    found = sorted((root / "usr/lib/jvm").glob("java-*/bin/java"))
    if not found:
        raise Unavailable(f"there is no JVM in {root}: delete that folder and its .done, and run this again.")
    return found[0]


def run(command: list[str], cases: list[str]) -> dict[str, Any]:
    """The golden runner's closing line as numbers.

    Raises:
        Unavailable: it did not come to its end.
    """
    heap = ["-XX:+UseSerialGC", "-Xmx768m", "-cp", class_path(), "org.camssf.golden.GoldenRunner"]
    done = subprocess.run([*command, *heap, str(GOLDEN), *cases], capture_output=True, text=True)
    counts = r"golden: (\d+) of (\d+) cases ran, (\d+) failed, (\d+) skipped"
    ended = re.search(rf"on (\S+), Java (\S+)\n{counts}.*within (\S+) of the peak", done.stdout)
    if ended is None:
        said = (done.stderr or done.stdout).strip().splitlines()
        raise Unavailable(f"the golden runner ended with {done.returncode}: {' '.join(said[-3:])}")
    machine, java, ran, total, failed, skipped, off = ended.groups()
    return {
        "machine": machine, "java": java, "cases": int(total), "ran": int(ran), "failed": int(failed),
        "skipped": int(skipped), "worst": float(off),
        "faults": [line for line in done.stdout.splitlines() if line.startswith("FAULT")],
    }  # fmt: skip


@or_unavailable
def main(arguments: list[str] | None = None) -> int:
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("case", nargs="*", help="stage/name of golden cases (default: all)")
    parser.add_argument("--work", type=Path, default=CACHE, help="folder to keep the arm64 system in")
    options = parser.parse_args(arguments)
    out = console()
    tools()
    print("preparing the arm64 system, once ...", file=sys.stderr)
    root = root_folder(options.work.absolute(), JRE)
    here = run(["java"], options.case)
    emulator = ["qemu-aarch64-static", "-cpu", "cortex-a72", "-L", str(root), str(java_of(root))]
    there = run(emulator, options.case)
    head = ("machine", "Java", "cases", "ran", "failed", "skipped", "curves off Python's, of the peak")
    names = ("machine", "java", "cases", "ran", "failed", "skipped")
    lines = [[*(each[name] for name in names), f"{each['worst']:.1e}"] for each in (here, there)]
    out.print(table("Golden vectors in the JVM, ONNX Runtime out of its jar", head, lines))
    for fault in [*here["faults"], *there["faults"]]:
        out.print(fault)
    good = there["machine"] == "aarch64" and all(not e["failed"] and e["worst"] <= BAR for e in (here, there))
    out.print(f"written: {save('arm_jvm', {'bar': BAR, 'held': good, 'runs': [here, there]})}")
    worst = max(here["worst"], there["worst"])
    out.print(f"{'held' if good else 'MISSED'}: {there['ran']} cases, worst {worst:.1e} of the peak (bar {BAR:.0e})")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
