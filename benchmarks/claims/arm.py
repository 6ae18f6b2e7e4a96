"""Does the Kotlin library give the same numbers on AArch64?

Runs every golden case that Kotlin can run, or those of `--cases`, in an AArch64 JVM under user-mode QEMU, with the
real AArch64 ONNX Runtime out of its jar, and the same in this machine's JVM. Bar: no case fails, and the recovered
curves differ from those that Python stored by at most 1e-9 of the peak. Build first:
`mvn -f android-bindings -DskipTests package`. Emulation is exact arithmetic by the processor's rules, not timing;
Android's own loader stays unproven.

Needs qemu-user-static and a Debian's apt-get, but no root. The first run fetches a JVM for arm64 from the machine's
own apt source into the cache folder, 0.3 GB unpacked; later runs need no network.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

from benchmarks.claim import Run
from benchmarks.turns import Unavailable, class_path
from golden.forms import ROOT

BAR = 1e-9
JRE = "default-jre-headless"
CACHE = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "camssf-arm"
OPTIONS = {"cases": ("", "stage/name of golden cases, with spaces between (default: all)")}
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


def root_folder(work: Path, package: str) -> Path:
    """The files of a package for arm64 and of all that it needs; nothing in it is set up."""
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


def java_of(root: Path) -> Path:
    """The emulated system's JVM."""
    found = sorted((root / "usr/lib/jvm").glob("java-*/bin/java"))
    if not found:
        raise Unavailable(f"there is no JVM in {root}: delete that folder and its .done, and run this again.")
    return found[0]


def golden(command: list[str], cases: list[str]) -> tuple[tuple[str, str, int, int, float], list[str]]:
    """The golden runner's closing line: machine, Java, cases, failed, curves off; and its faults.

    Raises:
        Unavailable: it did not come to its end.
    """
    heap = ["-XX:+UseSerialGC", "-Xmx768m", "-cp", class_path(), "org.camssf.golden.GoldenRunner"]
    done = subprocess.run([*command, *heap, str(ROOT), *cases], capture_output=True, text=True)
    counts = r"golden: (\d+) cases ran, (\d+) failed"
    ended = re.search(rf"on (\S+), Java (\S+)\n{counts}.*within (\S+) of the peak", done.stdout)
    if ended is None:
        said = (done.stderr or done.stdout).strip().splitlines()
        raise Unavailable(f"the golden runner ended with {done.returncode}: {' '.join(said[-3:])}")
    machine, java, ran, failed, off = ended.groups()
    faults = [line for line in done.stdout.splitlines() if line.startswith("FAULT")]
    return (machine, java, int(ran), int(failed), float(off)), faults


def claim(run: Run) -> None:
    """A row a processor."""
    cases = run.options.cases.split()
    tools()
    root = root_folder(CACHE.absolute(), JRE)
    emulator = ["qemu-aarch64-static", "-cpu", "cortex-a72", "-L", str(root), str(java_of(root))]
    rows, faults = zip(*(golden(command, cases) for command in (["java"], emulator)), strict=True)
    columns = dict.fromkeys(("machine", "Java"), "") | dict.fromkeys(("cases", "failed"), "d")
    columns |= {"curves off Python's, of the peak": ".1e"}
    run.table("Golden vectors in the JVM, ONNX Runtime out of its jar", columns, rows)
    for fault in [line for lines in faults for line in lines]:
        run.say(fault)
    run.bar("the second processor is AArch64", rows[1][0] == "aarch64", least=1)
    run.bar("cases that fail", sum(row[3] for row in rows), most=0)
    run.bar("curves off Python's, of the peak", max(row[-1] for row in rows), most=BAR)


def _run(*command: str) -> str:
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout
