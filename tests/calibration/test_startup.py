"""Starting is quick, and what is not needed is not loaded; no library of an extra is needed without it."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.captures import photos

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
"""An interpreter in which the libraries of extras are not there."""


PLAIN_RUN = """
import contextlib, io, json, os
from camssf import Result
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
assert set(os.listdir("out")) == {"result.json", "ssf.csv", "patches.csv", "ssf.svg", "report.html"}
status, _, err = said(*photo, "--chart", "chart.cxf")
assert status == 2, err
assert 'pip install -e ".[cxf]"' in err
status, _, err = said("demo", "-o", "demo")
assert status == 0, err
result = Result.load("out/result.json")
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
        [sys.executable, "-c", HIDE + PLAIN_RUN], cwd=tmp_path, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
