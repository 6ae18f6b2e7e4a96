"""Starting is quick, and what is not needed is not loaded; the minimal installation does what its page says."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from camssf.cli import INTERRUPTED
from tests.captures import photos

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


MINIMAL_RUN = """
import contextlib, io, json, os
from camssf import Calibration
from camssf.cli import main
from camssf.errors import InvalidArgument

def said(*words):
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = main(words)
    return status, out.getvalue(), err.getvalue()

photo = ["calibrate", "chart.dng", "--lamp", "D55"]
status, _, err = said(*photo, "--white", "white.dng", "--basis", "cameras", "-o", "out", "--truth", "truth.csv")
assert status == 0, err
assert set(os.listdir("out")) == {"result.json", "ssf.csv", "report.html"}
status, out, err = said("colour", "--from", "out/result.json", "--to", "out/result.json", "--lamp", "A",
                        "--signal", "0.4,0.3,0.2")
assert status == 0, err
assert json.loads(out)["format"] == "camssf-between/1"
status, _, err = said(*photo, "--chart", "chart.cxf")
assert status == 2, err
assert "pip install 'camssf[cxf]'" in err
status, _, err = said("demo", "-o", "demo")
assert status == 0, err
result = Calibration.load("out/result.json")
assert "<svg" in result._repr_html_()
for ask in (result.plot, result.to_pandas, result.to_xarray, result.to_colour):
    try:
        ask()
    except InvalidArgument as error:
        assert "pip install" in error.advice
    else:
        raise AssertionError(ask)
"""


@pytest.mark.full
def test_without_the_dropped_libraries_it_calibrates_and_says_what_is_missing(tmp_path: Path) -> None:
    made = photos()
    for path in (made.shots[0].chart, made.shots[0].white, made.truth):
        shutil.copy(str(path), tmp_path)
    cxf = '<?xml version="1.0"?><CxF xmlns="http://colorexchangeformat.com/CxF3-core"/>'
    (tmp_path / "chart.cxf").write_text(cxf)
    done = subprocess.run(
        [sys.executable, "-c", HIDE + MINIMAL_RUN], cwd=tmp_path, capture_output=True, text=True, timeout=300
    )
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
