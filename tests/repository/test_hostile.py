"""What a hostile or unlucky machine may do: no code from files, no network, nothing half-written."""

import ast
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile

import camssf
from camssf import cli
from camssf.errors import InvalidArgument, UnreadableRaw
from camssf.report.build import NAMES
from camssf.result import Result
from camssf.spectra import read_lamp
from camssf_fleet.manifest import Manifest
from camssf_lab.direct import sweep
from camssf_lab.direct.reading import _read_tiff
from camssf_lab.learning.training import read_curves
from tests.support.captures import photos
from tests.support.processes import SEARCH, memory_below

pytestmark = pytest.mark.requirement("R-HOSTILE")

PACKAGES = sorted(Path(camssf.__file__).parents[1].glob("camssf*"))
WITHOUT_PNG = set(NAMES) - {"ssf.png"}
ENVIRONMENT = os.environ | {"OMP_NUM_THREADS": "1", "PYTHONPATH": SEARCH}


@pytest.fixture(scope="module")
def triple() -> list[str]:
    shot = photos(size=(600, 450), seed=2).shots[0]
    return ["calibrate", str(shot.chart), "--lamp", "D55", "--white", str(shot.white), "--dark", str(shot.dark)]


@pytest.mark.full
def test_no_file_becomes_code_and_nothing_calls_home() -> None:
    """By reading the sources: no eval, no pickle, no shell, no sockets but the one on which `camssf app` listens."""
    sources = [path for package in PACKAGES for path in sorted(package.rglob("*.py"))]
    assert len(sources) > 100
    (listener,) = (path for path in sources if path.match("camssf_app/server.py"))
    for path, node in (
        (source, node) for source in sources for node in ast.walk(ast.parse(source.read_text("utf-8")))
    ):
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else [node.module or ""]
            roots = {name.partition(".")[0] for name in names}
            assert not roots & {"pickle", "shelve", "marshal", "subprocess", "http", "ftplib", "requests"}
            assert "socket" not in roots or path == listener
            assert not any(name.startswith("urllib.request") for name in names)
        if isinstance(node, ast.Call):
            called = ast.unparse(node.func)
            assert called not in {"eval", "exec", "compile", "__import__", "os.system", "os.popen"}, called
            if called in {"np.load", "numpy.load"}:
                keywords = {k.arg: ast.unparse(k.value) for k in node.keywords}
                assert keywords.get("allow_pickle") == "False"


FULL_DISK = """
import contextlib, io, json, resource, sys
from camssf.cli import main
told = []
for name, arguments in json.loads(sys.argv[1]).items():
    for room in (0, 3_000, 60_000):
        err = io.StringIO()
        resource.setrlimit(resource.RLIMIT_FSIZE, (room, resource.RLIM_INFINITY))
        with contextlib.redirect_stderr(err):
            status = main([*arguments, "-o", f"{name}-{room}"])
        resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
        told.append([f"{name}-{room}", status, err.getvalue()])
print(json.dumps(told))
"""


@pytest.mark.full
@pytest.mark.skipif(sys.platform == "win32", reason="no resource limits there")
def test_a_disk_that_is_full_leaves_nothing(triple: list[str], tmp_path: Path) -> None:
    """No file may grow beyond some number of bytes: some are written whole, then one fails."""
    commands = {"calibrate": triple, "simulate": ["simulate", "--lamp", "D55", "--size", "600x450"]}
    done = subprocess.run(
        [sys.executable, "-c", FULL_DISK, json.dumps(commands)],
        cwd=tmp_path, capture_output=True, env=ENVIRONMENT, timeout=300, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    assert len(report) == 6
    for name, status, words in report:
        assert status == InvalidArgument.exit_status, (name, words)
        assert "Traceback" not in words
        assert "invalid_argument" in words
        assert sorted((tmp_path / name).rglob("*")) == [], name
        assert not (tmp_path / name).exists(), name


CTRL_C = """
import json, os, signal, sys
from camssf.cli import main
signal.signal(signal.SIGPROF, signal.default_int_handler)
print("ready", flush=True)
told = []
for at, seconds in enumerate((10, 1e-3, 0.01, 0.03, 0.07, 0.15, 0.25, 0.4)):
    status = None
    try:
        signal.setitimer(signal.ITIMER_PROF, seconds)
        status = main([*sys.argv[1:], "-o", f"out-{at}"])
        signal.setitimer(signal.ITIMER_PROF, 0)
    except KeyboardInterrupt:  # outside of main
        pass
    left = sorted(os.listdir(f"out-{at}")) if os.path.isdir(f"out-{at}") else []
    told.append([status, left])
print(json.dumps(told))
"""
"""Interrupted after some seconds of processor time, the first time in vain: everything is loaded then."""


@pytest.mark.full
@pytest.mark.skipif(sys.platform == "win32", reason="signals differ there")
def test_ctrl_c_leaves_all_or_nothing(triple: list[str], tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", CTRL_C, *triple], cwd=tmp_path, capture_output=True, env=ENVIRONMENT, timeout=300
    )
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout.splitlines()[-1])
    for status, left in report:
        assert status in (0, cli.INTERRUPTED, None)
        assert left in ([], sorted(WITHOUT_PNG))
    assert cli.INTERRUPTED in [status for status, _ in report]
    assert report[0] == [0, sorted(WITHOUT_PNG)]


@pytest.mark.parametrize(("size", "read"), [
    (10_000_000, lambda path: Manifest(path).read_all()), (20_000_000, lambda path: read_lamp(str(path))),
    (64 * 2**20, Result.load), (500_000_000, sweep), (500_000_000, read_curves),
], ids=["manifest", "lamp", "result", "sweep", "curves"])  # fmt: skip
def test_sizes_are_capped(size: int, read: Any, tmp_path: Path) -> None:
    """No reader takes in whole a file that is larger than it needs."""
    with (tmp_path / "large.csv").open("wb") as file:
        file.truncate(size + 1)
    with memory_below(150_000_000), pytest.raises(InvalidArgument, match="larger than"):
        read(tmp_path / "large.csv")


def test_a_small_tiff_asks_for_little_memory(tmp_path: Path) -> None:
    """A page of 1.8 GB in a file of some bytes; tifffile alone fills in what is not there."""
    path = tmp_path / "mono.tif"
    tifffile.imwrite(path, np.zeros((40, 60), np.uint16))
    with tifffile.TiffFile(path, mode="r+") as file:
        for tag in ("ImageWidth", "ImageLength", "RowsPerStrip"):
            file.pages[0].tags[tag].overwrite(30_000)
    with memory_below(20_000_000), pytest.raises(UnreadableRaw, match="cannot hold"):
        _read_tiff(path)
