"""The models on AArch64 without a phone: `python -m benchmarks.kernels.arm [--work DIR] [--count 60] [--seed 0]`

Runs the shipped models through the real AArch64 ONNX Runtime under user-mode QEMU and on this machine, on the same
inputs (seeded problems of `certify`), and prints the worst difference of each output; `arm_jvm` runs the golden
cases, whose stored outputs are the NumPy reference's. Bar: norm-wise, max |a - b| / max |b| <= 1e-10; and the duality
gap on ARM <= 1e-9. It also counts the calls that need the finish on one of the two only. Emulation is exact
arithmetic by the processor's rules, not timing.

Needs qemu-user-static and a Debian's apt-get, but no root. The first run fetches arm64 packages from the machine's
own apt source and two wheels from pip's own index into the cache folder; later runs need no network.
"""

from __future__ import annotations

import importlib.metadata
import os
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.claims.certify import draw
from benchmarks.kernels.turns import Unavailable, or_unavailable
from benchmarks.shared import command_parser, console, one_thread, save, table, versions
from camssf.grid import Floats
from camssf.recovery.onnx_model import load_model

BAR, GAP_BAR = 1e-10, 1e-9
CACHE = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "camssf-arm"
UNCOMPARED = ("gap", "layers_gap", "finish_steps")
TOOLS = {"qemu-aarch64-static": "qemu-user-static", "apt-get": "apt", "dpkg-deb": "dpkg"}
CPUINFO = """processor\t: 0
BogoMIPS\t: 100.00
Features\t: fp asimd evtstrm aes pmull sha1 sha2 crc32 cpuid
CPU implementer\t: 0x41
CPU architecture: 8
CPU variant\t: 0x0
CPU part\t: 0xd08
CPU revision\t: 3

"""
"""ONNX Runtime reads the processor's description and crashes on an x86 one; QEMU prefers this to the host's."""


def tools() -> None:
    """Raises Unavailable where a program is missing."""
    missing = [package for program, package in TOOLS.items() if shutil.which(program) is None]
    if missing:
        raise Unavailable(f"missing: {', '.join(missing)}. Install with: apt-get install {' '.join(missing)}")


def apt_source() -> str:
    """The file that names the machine's own main archive and its key."""
    form = "$(SOURCESENTRY)|$(CODENAME)|$(COMPONENT)|$(CREATED_BY)"
    for line in _run("apt-get", "indextargets", "--format", form).splitlines():
        entry, codename, component, kind = line.split("|")
        if kind == "Packages" and component == "main" and "-" not in codename:
            return entry.rpartition(":")[0]
    raise Unavailable("apt has no main archive: run apt-get update.")


def root_folder(work: Path, package: str = "python3") -> Path:
    """The files of a package for arm64 (Python, or a JVM) and of all that it needs; nothing in it is set up."""
    root = work / f"root-{package}"
    done = root.with_name(root.name + ".done")
    if done.exists():
        return root
    shutil.rmtree(root, ignore_errors=True)
    root.mkdir(parents=True)
    with tempfile.TemporaryDirectory() as temporary:
        apt = Path(temporary)
        for name in ("state/lists/partial", "cache/archives/partial"):
            (apt / name).mkdir(parents=True)
        (apt / "status").touch()  # nothing is installed there, so that apt fetches everything
        settings = {
            "APT::Architecture": "arm64", "APT::Architectures": "arm64", "APT::Sandbox::User": "root",
            "Dir::State": apt / "state", "Dir::State::status": apt / "status", "Dir::Cache": apt / "cache",
            "Dir::Etc::sourcelist": apt_source(), "Dir::Etc::sourceparts": "-",
        }  # fmt: skip
        apt_get = ["apt-get", "-qq", *(f"-o{name}={value}" for name, value in settings.items())]
        _run(*apt_get, "update")
        _run(*apt_get, "install", "--yes", "--download-only", "--no-install-recommends", package)
        for archive in sorted((apt / "cache/archives").glob("*.deb")):
            _run("dpkg-deb", "-x", str(archive), str(root))
    for name, text in {
        "proc/cpuinfo": CPUINFO,
        "sys/devices/system/cpu/possible": "0\n",
        "sys/devices/system/cpu/present": "0\n",
        "sys/devices/system/cpu/online": "0\n",
        "sys/devices/system/cpu/kernel_max": "0\n",
    }.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    done.touch()
    return root


def wheels(work: Path, root: Path) -> Path:
    """AArch64 builds of the NumPy and ONNX Runtime that run here, for the Python in `root`."""
    minor = max(int(p.name[8:]) for p in (root / "usr/lib").glob("python3.*") if p.name[8:].isdigit())
    pins = [f"{name}=={importlib.metadata.version(name)}" for name in ("numpy", "onnxruntime")]
    folder = work / "-".join(["wheels", f"3.{minor}", *(pin.replace("==", "-") for pin in pins)])
    if not folder.exists():
        fetched = work / "fetched"
        shutil.rmtree(fetched, ignore_errors=True)
        platforms = ["--platform", "manylinux_2_28_aarch64", "--platform", "manylinux_2_27_aarch64"]
        for pin in pins:
            _run(
                sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--only-binary=:all:", *platforms,
                "--python-version", f"3{minor}", "--dest", str(fetched), pin,
            )  # fmt: skip
        for wheel in fetched.glob("*.whl"):
            with zipfile.ZipFile(wheel) as content:
                content.extractall(fetched / "unpacked")
        (fetched / "unpacked").rename(folder)
        shutil.rmtree(fetched)
    return folder


def emulate(root: Path, packages: Path, given: Path, made: Path) -> None:
    """Run `run_models.py` on the emulated processor; it counts on stderr."""
    here = Path(__file__).parent
    source = here.parents[1] / "reference"
    keep = {k: v for k, v in os.environ.items() if k.endswith("_NUM_THREADS")}
    environment = keep | {
        "PYTHONHOME": str(root / "usr"),
        "PYTHONPATH": os.pathsep.join([str(packages), str(source)]),
        "PYTHONDONTWRITEBYTECODE": "1",
        "PATH": os.environ["PATH"],
    }
    command = [
        "qemu-aarch64-static", "-cpu", "cortex-a72", "-L", str(root), str(root / "usr/bin/python3"),
        str(here / "run_models.py"), str(given), str(made),
    ]  # fmt: skip
    subprocess.run(command, env=environment, check=True)


def compare(here: dict[str, Floats], there: dict[str, Floats]) -> tuple[list[dict[str, Any]], float]:
    """For each basis and output the worst norm-wise difference and where; and the largest gap on ARM.

    The gaps themselves are rounding noise above their floor: the answer's is held to its own bar, the layers' is not
    compared, nor are the steps of the finish, which that one decides on.
    """
    worst: dict[tuple[str, str], dict[str, Any]] = {}
    gap = 0.0
    for key, ours in here.items():
        basis, case, name = key.split("/")
        theirs = there[key]
        if name == "gap":
            gap = max(gap, float(theirs.max()))
        if name in UNCOMPARED:
            continue
        if np.isnan(ours).all() and np.isnan(theirs).all():  # no prior, no band
            continue
        size = float(np.abs(ours).max())
        off = float(np.abs(ours - theirs).max()) / (size if size > 0 else 1.0)
        entry = worst.setdefault((basis, name), {"basis": basis, "output": name, "cases": 0, "worst": -1.0})
        entry["cases"] += 1
        entry["equal_bits"] = entry.get("equal_bits", 0) + int(np.array_equal(ours, theirs))
        if not off <= entry["worst"]:
            entry["worst"], entry["case"] = off, case
    return list(worst.values()), gap


@or_unavailable
def main(arguments: list[str] | None = None) -> int:
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("--work", type=Path, default=CACHE, help="folder to keep the arm64 system in")
    parser.add_argument("--count", type=int, default=60, help="seeded problems")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    out = console()
    work = options.work.absolute()
    tools()
    print("preparing the arm64 system, once ...", file=sys.stderr)
    root = root_folder(work)
    packages = wheels(work, root)
    cases = {}
    for i in range(options.count):
        problem, _ = draw(options.seed, i)
        cases[problem.basis, f"seed{options.seed}-{i}"] = problem.inputs
    given, made = work / "inputs.npz", work / "outputs.npz"
    made.unlink(missing_ok=True)
    with given.open("wb") as stream:
        flat = {f"{basis}/{case}/{name}": v for (basis, case), x in cases.items() for name, v in x.items()}
        np.savez(stream, **flat)  # type: ignore[arg-type]
    emulate(root, packages, given, made)
    with np.load(made) as content:
        there = {name: content[name] for name in content.files}
    machine = str(there.pop("machine"))
    here = {
        f"{basis}/{case}/{name}": value
        for (basis, case), inputs in cases.items()
        for name, value in load_model(basis).run(inputs).items()
    }
    rows, gap = compare(here, there)
    took = [key for key in here if key.endswith("/finish_steps") and (here[key].any() != there[key].any())]
    rows.sort(key=lambda row: (row["basis"], row["output"]))
    versions_ = versions()
    title = (
        f"{versions_['machine']} against {machine}: {len(cases)} seeded problems; "
        f"ONNX Runtime {versions_['onnxruntime']}"
    )
    head = ("basis", "output", "worst difference", "in case", "cases", "same bits")
    keys = ("case", "cases", "equal_bits")
    lines = [(row["basis"], row["output"], f"{row['worst']:.1e}", *(row[key] for key in keys)) for row in rows]
    out.print(table(title, head, lines))
    worst = max(row["worst"] for row in rows)
    good = worst <= BAR and gap <= GAP_BAR and machine == "aarch64"
    out.print(f"the finish is needed on one of the two processors only in {len(took)} of {len(cases)} calls")
    out.print(f"worst difference {worst:.1e} (bar {BAR:.0e}); largest gap on {machine} {gap:.1e} (bar {GAP_BAR:.0e})")
    out.print("held" if good else "MISSED")
    content = {
        "seed": options.seed, "count": len(cases), "machine": machine,
        "versions": versions_, "bar": BAR, "worst": worst, "gap_bar": GAP_BAR, "gap": gap, "held": good,
        "finish_on_one": len(took), "outputs": rows,
    }  # fmt: skip
    out.print(f"written: {save('arm', content)}")
    return 0 if good else 1


def _run(*command: str) -> str:
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
