"""What a hostile or unlucky machine may do: no code from files, no network, nothing half-written."""

from __future__ import annotations

import ast
import os
import signal
import subprocess
import sys
import time
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

import camssf
from camssf import cli
from camssf.errors import InvalidArgument
from camssf.fleet.manifest import LARGEST_MANIFEST, Manifest
from camssf.report.build import NAMES
from camssf.simulation.frames import simulate
from camssf.simulation.scene import Scene

pytestmark = pytest.mark.requirement("R-HOSTILE")

PACKAGE = Path(camssf.__file__).parent
SOURCES = sorted(PACKAGE.glob("*.py"))
ENVIRONMENT = os.environ | {"OMP_NUM_THREADS": "1", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}


@pytest.fixture(scope="module")
def shots(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("shots")
    simulate("Nikon 5100 (NPL)", ["D55"], folder, scene=Scene(size=(600, 450)), seed=2)
    return folder


def triple(shots: Path) -> list[str]:
    frames = ["--white", str(shots / "white.dng"), "--dark", str(shots / "dark.dng")]
    return ["calibrate", str(shots / "chart.dng"), "--lamp", "D55", *frames]


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.name)
def test_no_file_becomes_code_and_nothing_calls_home(path: Path) -> None:
    """By reading the sources: no eval, no pickle, no shell, no sockets."""
    tree = ast.parse(path.read_text("utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else [node.module or ""]
            roots = {name.partition(".")[0] for name in names}
            assert not roots & {"pickle", "shelve", "marshal", "subprocess", "socket", "http", "ftplib", "requests"}
            assert not any(name.startswith("urllib.request") for name in names)
        if isinstance(node, ast.Call):
            called = ast.unparse(node.func)
            assert called not in {"eval", "exec", "compile", "__import__", "os.system", "os.popen"}, called
            if called in {"np.load", "numpy.load"}:
                keywords = {k.arg: ast.unparse(k.value) for k in node.keywords}
                assert keywords.get("allow_pickle") == "False"


@pytest.mark.full
def test_it_works_without_a_network(shots: Path, tmp_path: Path) -> None:
    """Every socket that anybody opens raises, in a process of its own."""
    code = (
        "import socket, sys\n"
        "def refuse(*_, **__): raise RuntimeError('a socket was opened')\n"
        "socket.socket.connect = socket.socket.bind = socket.create_connection = socket.getaddrinfo = refuse\n"
        "from camssf import cli\n"
        "raise SystemExit(cli.main(sys.argv[1:]))\n"
    )
    arguments = [*triple(shots), "-o", str(tmp_path / "out")]
    done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, env=ENVIRONMENT, timeout=120)
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "out" / "report.html").read_text("utf-8")
    for word in ('src="http', 'href="http', "url(http", "@import", "fetch(", "XMLHttpRequest"):
        assert word not in page


@pytest.mark.full
@pytest.mark.skipif(sys.platform == "win32", reason="no resource limits there")
@pytest.mark.parametrize("room", [0, 3_000, 60_000])
@pytest.mark.parametrize("command", ["calibrate", "simulate"])
def test_a_disk_that_is_full_leaves_nothing(command: str, room: int, shots: Path, tmp_path: Path) -> None:
    """No file may grow beyond `room` bytes: some are written whole, then one fails."""
    out = tmp_path / "out"
    arguments = {
        "calibrate": [*triple(shots), "-o", str(out)],
        "simulate": ["simulate", "--lamp", "D55", "--size", "600x450", "-o", str(out)],
    }[command]
    code = (
        "import resource, sys\n"
        "from camssf import cli\n"
        f"resource.setrlimit(resource.RLIMIT_FSIZE, ({room}, {room}))\n"
        "raise SystemExit(cli.main(sys.argv[1:]))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, env=ENVIRONMENT, timeout=120, text=True
    )
    assert done.returncode == InvalidArgument.exit_status, done.stderr
    assert "Traceback" not in done.stderr
    assert "invalid_argument" in done.stderr
    assert sorted(out.rglob("*")) == []


@pytest.mark.full
@pytest.mark.skipif(sys.platform == "win32", reason="signals differ there")
@pytest.mark.parametrize("delay", [0.0, 0.3, 0.6, 1.0])
def test_ctrl_c_leaves_all_or_nothing(delay: float, shots: Path, tmp_path: Path) -> None:
    """The interrupt comes at any time after the package is loaded."""
    out = tmp_path / "out"
    code = (
        "import sys\nfrom camssf import cli\nprint('ready', flush=True)\nraise SystemExit(cli.main(sys.argv[1:]))\n"
    )
    arguments = [*triple(shots), "-o", str(out)]
    with subprocess.Popen(
        [sys.executable, "-c", code, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=ENVIRONMENT
    ) as running:
        assert running.stdout is not None
        assert running.stderr is not None
        assert running.stdout.readline().strip() == b"ready"
        time.sleep(delay)
        running.send_signal(signal.SIGINT)
        words = running.stderr.read().decode()
        status = running.wait(timeout=60)
    assert status in (0, cli.INTERRUPTED, -signal.SIGINT), words
    assert "Traceback" not in words or delay == 0.0  # before `main` is reached it is Python's own
    left = {path.name for path in out.rglob("*")}
    assert left in (set(), set(NAMES))


def test_sizes_are_capped(tmp_path: Path) -> None:
    """Files that no reader needs to take in whole."""
    large = tmp_path / "large.csv"
    with large.open("wb") as file:
        file.truncate(LARGEST_MANIFEST + 1)
    with pytest.raises(InvalidArgument, match="larger than"):
        Manifest(large).read_all()
    from camssf.documents.result_json import LARGEST_DOCUMENT, read_document
    from camssf.spectra import read_lamp
    from camssf.spectra.text import LARGEST_FILE

    with large.open("r+b") as file:
        file.truncate(LARGEST_FILE + 1)
    with pytest.raises(InvalidArgument):
        read_lamp(str(large))
    with large.open("r+b") as file:
        file.truncate(LARGEST_DOCUMENT + 1)
    with pytest.raises(InvalidArgument, match="larger than"):
        read_document(large)
    assert cli.main(["solve", str(large)]) == InvalidArgument.exit_status
    from camssf.direct import sweep
    from camssf.learning.training import read_curves

    with large.open("r+b") as file:
        file.truncate(500_000_000)
    tracemalloc.start()
    try:
        for reader in (sweep, read_curves):
            with pytest.raises(InvalidArgument, match="larger than"):
                reader(large)
        assert tracemalloc.get_traced_memory()[1] < 150_000_000
    finally:
        tracemalloc.stop()


def test_a_small_tiff_asks_for_little_memory(tmp_path: Path) -> None:
    """A page of 1.8 GB in a file of some bytes; tifffile alone fills in what is not there."""
    import tifffile

    from camssf.direct.reading import _read_tiff
    from camssf.errors import UnreadableRaw

    path = tmp_path / "mono.tif"
    tifffile.imwrite(path, np.zeros((40, 60), np.uint16))
    with tifffile.TiffFile(path, mode="r+") as file:
        for tag in ("ImageWidth", "ImageLength", "RowsPerStrip"):
            file.pages[0].tags[tag].overwrite(30_000)
    tracemalloc.start()
    try:
        with pytest.raises(UnreadableRaw, match="cannot hold"):
            _read_tiff(path)
        assert tracemalloc.get_traced_memory()[1] < 20_000_000
    finally:
        tracemalloc.stop()
