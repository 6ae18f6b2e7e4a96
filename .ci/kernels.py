"""The numerical tests and the golden check on the linear algebra of an old processor: `python .ci/kernels.py`.

OpenBLAS chooses its kernels by processor, NumPy its loops; both sum in another order, so the last bits differ, and a
bound that only one of them keeps is luck. OPENBLAS_CORETYPE and NPY_DISABLE_CPU_FEATURES take away what a smaller
processor lacks: everything beyond Prescott of 2004 and NumPy's baseline. Neither complains about a name it does not
know, so a process of its own says what is really in force.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).parents[1]
PROBE = """
import json, numpy, scipy.linalg
from numpy._core._multiarray_umath import __cpu_dispatch__ as names, __cpu_features__ as has
from threadpoolctl import threadpool_info
cores = sorted({pool["architecture"] for pool in threadpool_info() if pool["internal_api"] == "openblas"})
print(json.dumps({"openblas": cores, "numpy": [name for name in names if has[name]]}))
"""
NUMERICAL = ("-m", "numerical", "--ignore", "tests/kotlin")
"""Nothing below tests/kotlin is: its tests need what Maven builds, which may still be at work."""
COMMANDS = {
    "tests": ["-m", "pytest", "-q", "-n0", "-Werror", "-p", "no:cacheprovider", *NUMERICAL],
    "golden": ["-m", "golden.generate", "--check"],
    "models": ["-m", "camssf_onnx", "check"],
}


def probe(extra: dict[str, str]) -> dict[str, list[str]]:
    """OpenBLAS's kernels and NumPy's loops beyond its baseline that are in force under these variables."""
    command = [sys.executable, "-c", PROBE]
    done = subprocess.run(command, env=os.environ | extra, stdout=subprocess.PIPE, text=True, check=True, timeout=120)
    found: dict[str, list[str]] = json.loads(done.stdout)
    return found


def main() -> int:
    """Exit status 0 if the old processor's linear algebra, where there is one, was in force and all passed."""
    names, old = list(COMMANDS), {}
    if platform.machine().lower() in ("x86_64", "amd64"):
        own = probe({})
        old = {"OPENBLAS_CORETYPE": "Prescott", "NPY_DISABLE_CPU_FEATURES": " ".join(own["numpy"])}
        force = probe(old)
        print(f"as it is: {own}\nnow: {force}", flush=True)
        if force["numpy"] or force["openblas"] == own["openblas"]:
            print("kernels: the variables took no effect")
            return 1
    else:
        print(f"kernels: {platform.machine()} has no older ones to fall back to: golden alone", flush=True)
        names = ["golden"]

    def run(name: str) -> bool:
        begun = time.monotonic()
        done = subprocess.run(
            [sys.executable, *COMMANDS[name]], env=os.environ | old | {"OPENBLAS_NUM_THREADS": "1"}, cwd=ROOT,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
        )  # fmt: skip
        status = f"-- {name}: exit status {done.returncode}, {time.monotonic() - begun:.0f} s"
        print(f"{done.stdout.rstrip()}\n{status}", flush=True)
        return done.returncode == 0

    with ThreadPoolExecutor(2) as pool:
        bad = [name for name, passed in zip(names, pool.map(run, names), strict=True) if not passed]
    print(f"kernels: failed: {', '.join(bad) or 'none'}", flush=True)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
