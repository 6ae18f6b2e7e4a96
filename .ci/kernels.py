"""The numerical tests and the golden check on the linear algebra of other processors.

    python .ci/kernels.py            every variant that this processor can run
    python .ci/kernels.py --probe    only say what would be in force

OpenBLAS chooses its kernels by processor, NumPy its loops; both sum in another order, so the last bits differ, and a
bound that only one of them keeps is luck. OPENBLAS_CORETYPE and NPY_DISABLE_CPU_FEATURES take away what a smaller
processor lacks. Neither complains about a name it does not know, so each variant is asked, in a process of its own,
what it really has in force. One that has the same as an earlier one is named and not run again; one that did not take
effect, or too few different ones, is a failure.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
CORES = ("Haswell", "Zen", "Prescott")
WIDE = ("X86_V4", "AVX512")
"""How NumPy's names for loops that need AVX-512 begin; before 2.4 each of its parts had one."""
MIDDLE = ("X86_V3", "AVX2", "FMA3")
FEWEST = 3
"""Different variants that an x86-64 processor with AVX2 has: its own, Prescott's, and NumPy without AVX2."""
PROBE = """
import json, numpy, scipy.linalg
from numpy._core._multiarray_umath import __cpu_dispatch__ as names, __cpu_features__ as has
from threadpoolctl import threadpool_info
cores = sorted({pool["architecture"] for pool in threadpool_info() if pool["internal_api"] == "openblas"})
print(json.dumps({"openblas": cores, "numpy": [name for name in names if has[name]]}))
"""
COMMANDS = (
    ("tests", ["-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", "-m", "numerical and not full"]),
    ("golden", ["-m", "golden.generate", "--check"]),
    ("models", ["-m", "camssf_onnx", "check"]),
    ("golden models", ["-m", "golden.models"]),
)


@dataclass(frozen=True)
class Force:
    """What computes: OpenBLAS's kernels and NumPy's loops beyond its baseline."""

    openblas: tuple[str, ...]
    numpy: tuple[str, ...]

    def __str__(self) -> str:
        return f"OpenBLAS {' and '.join(self.openblas) or 'absent'}; NumPy {' '.join(self.numpy) or 'baseline only'}"


def probe(extra: dict[str, str]) -> Force | None:
    """What is in force under these variables; None where Python does not even start with them."""
    done = subprocess.run(
        [sys.executable, "-c", PROBE], env=os.environ | extra, capture_output=True, text=True, timeout=120
    )
    if done.returncode != 0:
        return None
    found = json.loads(done.stdout)
    return Force(tuple(found["openblas"]), tuple(found["numpy"]))


def variants(default: Force) -> dict[str, dict[str, str]]:
    """Their variables by name. NumPy's names are asked of itself: they change from version to version."""
    wide = [name for name in default.numpy if name.startswith(WIDE)]
    middle = [name for name in default.numpy if name.startswith(MIDDLE)]
    found: dict[str, dict[str, str]] = {"as it is": {}}
    cores = [*CORES, "SkylakeX"] if wide else CORES  # without AVX-512 SkylakeX's would be an illegal instruction
    found |= {f"OPENBLAS_CORETYPE={core}": {"OPENBLAS_CORETYPE": core} for core in cores}
    for word, names in (("AVX-512", wide), ("AVX-512 and AVX2", wide + middle)):
        found[f"NumPy without {word}"] = {"NPY_DISABLE_CPU_FEATURES": " ".join(names)} if names else {}
    return found


def took_effect(extra: dict[str, str], force: Force) -> bool:
    """Whether nothing that was switched off is still on; OpenBLAS's names are judged by being different."""
    return not set(extra.get("NPY_DISABLE_CPU_FEATURES", "").split()) & set(force.numpy)


def run(variant: str, extra: dict[str, str]) -> list[str]:
    """All commands, on one thread; the names of those that failed. What they print comes when all are done."""
    failed, told = [], [f"== {variant}"]
    one = {"OPENBLAS_NUM_THREADS": "1"}  # variants run side by side
    for name, command in COMMANDS:
        begun = time.monotonic()
        done = subprocess.run(
            [sys.executable, *command],
            env=os.environ | one | extra,
            cwd=ROOT,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
        )
        told += [done.stdout.rstrip(), f"-- {name}: exit status {done.returncode}, {time.monotonic() - begun:.0f} s"]
        if done.returncode != 0:
            failed.append(name)
    print("\n".join(told), flush=True)
    return failed


def main(arguments: list[str] | None = None) -> int:
    """Exit status 0 if every variant passed and enough of them were different."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--probe", action="store_true", help="say what would be in force; run nothing")
    parser.add_argument("--skip-default", action="store_true", help="the full tests have just run as it is")
    options = parser.parse_args(arguments)

    default = probe({})
    if default is None:
        print("kernels: NumPy, SciPy or threadpoolctl is missing: install camssf with its extra `dev`")
        return 2
    seen: dict[Force, str] = {}
    bad: list[str] = []
    todo: list[tuple[str, dict[str, str]]] = []
    for name, extra in variants(default).items():
        force = probe(extra)
        if force is None:
            print(f"== {name}: Python does not start with it on this processor", flush=True)
            continue
        if not took_effect(extra, force):
            print(f"== {name}: still in force is {force}", flush=True)
            bad.append(f"{name} took no effect")
            continue
        if force in seen:
            print(f"== {name}: {force}, the same as {seen[force]!r}: not run again", flush=True)
            continue
        seen[force] = name
        print(f"== {name}: {force}", flush=True)
        if not options.probe and not (options.skip_default and not extra):
            todo.append((name, extra))
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for (name, _), failed in zip(todo, pool.map(lambda each: run(*each), todo), strict=True):
            bad += [f"{name}: {command}" for command in failed]
    if platform.machine().lower() in ("x86_64", "amd64") and len(seen) < FEWEST:
        bad.append(f"only {len(seen)} of at least {FEWEST} variants differ")
    print("; ".join(bad) or "none failed", flush=True)
    print(f"kernels: {len(seen)} variants, {len(bad)} failed", flush=True)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
