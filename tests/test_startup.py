"""Starting is quick, and what is not needed is not loaded; the minimal installation does what its page says."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from benchmarks.kernels import startup
from camssf.cli import INTERRUPTED
from camssf.simulation.frames import simulate
from camssf.simulation.scene import Scene
from camssf.spectra import read_camera

ROOT = Path(__file__).parents[1]
PLAIN = [
    Requirement(line)
    for line in tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["dependencies"]
]
MINIMAL = [
    Requirement(line) for line in (ROOT / "minimal.txt").read_text("utf-8").splitlines() if not line.startswith("#")
]
DROPPED = {"matplotlib"}
HIDE = """
import sys
class Hidden:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {"colour", "colour_cxf", "matplotlib", "pandas", "xarray"}:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Hidden())
import importlib.util
found = importlib.util.find_spec
def find_spec(name, package=None):
    try:
        return found(name, package)
    except ModuleNotFoundError:
        return None
importlib.util.find_spec = find_spec
"""
"""An interpreter in which the dropped libraries are not there."""


def test_the_minimal_list_is_the_plain_one_without_what_is_dropped() -> None:
    plain = {each.name: str(each.specifier) for each in PLAIN}
    minimal = {each.name: str(each.specifier) for each in MINIMAL}
    assert plain.keys() - minimal.keys() == DROPPED
    assert minimal == {name: plain[name] for name in minimal}
    page = (ROOT / "docs" / "install.md").read_text("utf-8")
    assert all(f"`{name}`" in page for name in DROPPED)


def minimal(code: str, *arguments: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", HIDE + code, *arguments], cwd=folder, capture_output=True, text=True, timeout=120
    )


@pytest.mark.full
def test_without_the_dropped_libraries_it_calibrates_and_says_what_is_missing(tmp_path: Path) -> None:
    simulate(read_camera("Canon EOS 5D Mark II"), "D55", tmp_path, scene=Scene(size=(900, 675)))
    command = "from camssf.cli import main\nsys.exit(main(sys.argv[1:]))"
    call = ["calibrate", "chart.dng", "--lamp", "D55", "--white", "white.dng", "--basis", "cameras", "-o", "out"]
    done = minimal(command, *call, "--truth", "truth.csv", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"result.json", "ssf.csv", "report.html"}
    done = minimal(command, "colour", "--from", "out/result.json", "--to", "out/result.json", "--lamp", "A",
                   "--signal", "0.4,0.3,0.2", folder=tmp_path)  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["format"] == "camssf-between/1"
    cxf = '<?xml version="1.0"?><CxF xmlns="http://colorexchangeformat.com/CxF3-core"/>'
    (tmp_path / "chart.cxf").write_text(cxf)
    for arguments, words in (
        (["calibrate", "chart.dng", "--lamp", "D55", "--chart", "chart.cxf"], "pip install 'camssf[cxf]'"),
    ):
        done = minimal(command, *arguments, folder=tmp_path)
        assert done.returncode == 2, done.stderr
        assert words in done.stderr
    done = minimal(command, "demo", "-o", "demo", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    code = (
        "from camssf import Calibration\nfrom camssf.errors import InvalidArgument\n"
        "result = Calibration.load('out/result.json')\n"
        "assert '<svg' in result._repr_html_()\n"
        "for ask in (result.plot, result.to_pandas, result.to_xarray, result.to_colour):\n"
        "    try:\n        ask()\n"
        "    except InvalidArgument as error:\n        assert 'pip install' in error.advice\n"
        "    else:\n        raise SystemExit(1)"
    )
    done = minimal(code, folder=tmp_path)
    assert done.returncode == 0, done.stderr


@pytest.mark.full
def test_ctrl_c_while_it_loads_is_no_traceback() -> None:
    code = (
        "import sys\n"
        "class Interrupted:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'camssf.cli.commands':\n"
        "            raise KeyboardInterrupt\n"
        "sys.meta_path.insert(0, Interrupted())\n"
        "from camssf.__main__ import main\n"
        "sys.exit(main())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout, done.stderr) == (INTERRUPTED, "", "")


def test_help_loads_no_numpy_and_no_library_of_pictures() -> None:
    code = (
        "import sys\nfrom camssf.cli import main\nmain(['calibrate', '--help'])\n"
        "print('\\n'.join(sorted({name.partition('.')[0] for name in sys.modules})), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120)
    assert not {"numpy", "scipy", "colour", "matplotlib", "cv2", "onnxruntime"} & set(done.stderr.split())


def test_the_benchmark_s_bars_and_ratios(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr("benchmarks.shared.RESULTS", tmp_path)
    times = dict.fromkeys(startup.CALLS, (0.2, 0.3))
    monkeypatch.setattr(startup, "seconds", lambda runs: times)
    assert startup.main([]) == 0
    assert "1.00 × import numpy" in capsys.readouterr().out
    times["camssf calibrate --help"] = (0.4, 0.4)
    assert startup.main([]) == 1
    times["camssf calibrate --help"] = (0.39, 9.0)
    for size, status in ((451.0, 1), (450.0, 0)):
        monkeypatch.setattr(startup, "installed", lambda arguments, size=size: (2 * size, size))
        assert startup.main(["--sizes"]) == status
    assert json.loads((tmp_path / "startup.json").read_text())["megabytes"]["minimal"]["without"] == 450.0


def test_weighing_counts_bytecode_apart(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_bytes(bytes(1000))
    (tmp_path / "a.pyc").write_bytes(bytes(500))
    assert startup.weigh(tmp_path) == (0.0015, 0.001)
