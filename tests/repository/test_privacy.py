"""Nothing is sent, nothing is left behind but what was asked for. docs/privacy.md says it in words."""

import mmap
import os
import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace

import pytest

from camssf.errors import InvalidArgument
from camssf.recovery import onnx_model
from tests.support.processes import SEARCH

pytestmark = pytest.mark.requirement("R-PRIVACY")

ROOT = Path(__file__).parents[2]
TRACES = ("mat-debug", "DeveloperTools", "ORT_DISABLE_TELEMETRY", "events.data.microsoft.com")
"""Of ONNX Runtime 1.29.0: names of its log, its folder in the home, its variable, and the address it reports to."""
CONNECT = "import socket; socket.socket(socket.AF_INET, socket.SOCK_DGRAM).connect(('127.0.0.1', 9))"
"""A connection that the watch must see. A datagram's: nothing is sent."""


class Places:
    """A home, a cache, a folder for temporary files and one to work in, all of them new."""

    def __init__(self, folder: Path) -> None:
        places = [folder / name for name in ("home", "cache", "temporary", "work", "watch")]
        self.home, self.cache, self.temporary, self.work, self.watch = places
        for place in places:
            place.mkdir(parents=True)

    def run(self, *words: str, before: tuple[str, ...] = (), **more: str) -> subprocess.CompletedProcess[str]:
        """Python with these arguments, in these folders."""
        dropped = ("MPLCONFIGDIR", "XDG_CONFIG_HOME", "XDG_DATA_HOME", onnx_model.SWITCH)
        kept = {name: value for name, value in os.environ.items() if name not in dropped}
        own = {"HOME": self.home, "XDG_CACHE_HOME": self.cache, "TMPDIR": self.temporary, "PYTHONPATH": SEARCH}
        environment = kept | {name: str(place) for name, place in own.items()} | more
        command = [*before, sys.executable, *words]
        return subprocess.run(command, cwd=self.work, env=environment, capture_output=True, text=True, timeout=300)

    def left(self) -> list[str]:
        """What lies in home, cache and the temporary folder."""
        return sorted(str(path) for place in (self.home, self.cache, self.temporary) for path in place.rglob("*"))

    def strace(self, *words: str, before: tuple[str, ...] = ()) -> tuple[subprocess.CompletedProcess[str], list[str]]:
        """Every process and thread, from the kernel's side."""
        trace = self.watch / "trace"
        done = self.run(*words, before=(*before, "strace", "-f", "-qq", "-e", "trace=network", "-o", str(trace)))
        return done, [line for line in trace.read_text().splitlines() if "sa_family=AF_INET" in line]


@pytest.fixture
def places(tmp_path: Path) -> Places:
    return Places(tmp_path)


@pytest.fixture
def strace() -> None:
    """Skips where sockets cannot be watched."""
    if not shutil.which("strace") or subprocess.run(["strace", "-qq", "-o", os.devnull, "true"]).returncode:
        pytest.skip("strace is not to be had here")


EVERYTHING = """
from camssf import Shot, calibrate
from camssf.cli import main
from camssf.report.build import report

if __name__ == "__main__":
    for words in (
        "demo -o out",
        "calibrate out/shots/chart.dng --lamp D55 -o again",
        "batch one.csv -o many --workers 2",
        "passport key -o keys",
        "passport sign again/result.json --key keys/passport-key.pem --photo out/shots/chart.dng -o keys/a.jws",
        "passport verify keys/a.jws --key keys/passport-key.pub.pem",
        "registry add phones out/result.json again/result.json",
        "registry list phones",
        "registry verify phones",
        "registry export phones -o phones/all.csv",
    ):
        assert main(words.split()) == 0, words
    frames = [f"out/shots/{name}.dng" for name in ("chart", "white", "dark")]
    assert report(calibrate(Shot(frames[0], "D55", white=frames[1], dark=frames[2])), png=True).ssf_png
"""
"""Commands and library; a file, since a batch's workers import it again."""


@pytest.mark.full
@pytest.mark.usefixtures("strace")
def test_commands_and_library_leave_nothing_send_nothing_and_need_no_network(places: Places) -> None:
    """In a namespace without a network, where one is to be had."""
    assert places.strace("-c", CONNECT)[1], "the watch sees no connection"
    (places.work / "one.csv").write_text("name,photo,lamp\na,out/shots/chart.dng,D55\n")
    (places.work / "everything.py").write_text(EVERYTHING)
    done, seen = places.strace("everything.py", before=away())
    assert done.returncode == 0, done.stderr
    assert seen == []
    assert places.left() == []
    assert sorted(path.name for path in places.work.iterdir()) == [
        "again", "everything.py", "keys", "many", "one.csv", "out", "phones",
    ]  # fmt: skip
    assert sorted(path.name for path in (places.work / "keys").iterdir()) == [
        "a.jws", "passport-key.pem", "passport-key.pub.pem",
    ]  # fmt: skip
    files = ["patches.csv", "report.html", "result.json", "ssf.csv", "ssf.svg"]
    assert sorted(path.name for path in (places.work / "again").iterdir()) == files
    assert sorted(path.name for path in (places.work / "out").iterdir()) == sorted(
        ["named", "pictures.html", "shots", *files]
    )
    assert sorted(path.name for path in (places.work / "out" / "named").iterdir()) == files


def away() -> tuple[str, ...]:
    """What runs a command in a namespace without a network, if that can be had."""
    words = ("unshare", "-rn")
    had = shutil.which("unshare") and subprocess.run([*words, "true"], capture_output=True).returncode == 0
    return words if had else ()


def holds(path: Path, word: str) -> bool:
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        return content.find(word.encode()) >= 0


def test_the_installed_onnx_runtime_has_nothing_to_report_with() -> None:
    """Fails where the pin is raised to a version that reports."""
    spec = find_spec("onnxruntime")
    folder = Path(next(iter(spec.submodule_search_locations)))
    libraries = [path for path in folder.rglob("*") if re.search(r"\.(so(\.[\d.]+)?|dylib|pyd|dll)$", path.name)]
    # What the search must find, lest it found nothing because it read nothing.
    assert any(holds(path, "ORT_DISABLE_ALL") for path in libraries)
    assert {path.name: word for path in libraries for word in TRACES if holds(path, word)} == {}


@pytest.mark.parametrize(("version", "switch", "taken"), [
    *((version, None, True) for version in ("1.28.1", "1.9.0", "0.99")), ("1.29.0", "1", True),
    *((version, None, False) for version in ("1.29.0", "1.100.0", "2.0.0", "1.29.0.dev1", "nightly")),
    ("1.29.0", "0", False),
])  # fmt: skip
def test_one_imported_before_is_taken_if_it_cannot_report_or_was_told_not_to(
    version: str, switch: str | None, taken: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    called: list[str] = []
    module = SimpleNamespace(__version__=version, disable_telemetry_events=lambda: called.append("disabled"))
    monkeypatch.setitem(sys.modules, "onnxruntime", module)
    monkeypatch.setenv(onnx_model.SWITCH, switch or "")
    if switch is None:
        monkeypatch.delenv(onnx_model.SWITCH)
    if taken:
        onnx_model.onnx_runtime()
        assert (called, os.environ[onnx_model.SWITCH]) == (["disabled"], "1")
        return
    with pytest.raises(InvalidArgument, match="imported before camssf") as caught:
        onnx_model.onnx_runtime()
    assert all(words in caught.value.advice for words in ("1.28.0", f"{onnx_model.SWITCH}=1"))
    assert version in caught.value.message


@pytest.mark.parametrize("before", [None, "0"])
def test_the_switch_is_set_before_it_is_loaded(
    before: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """By a stand-in that says what it finds as it is imported."""
    (tmp_path / "onnxruntime.py").write_text(
        f"import os\n__version__ = '1.29.0'\nprint(os.environ.get({onnx_model.SWITCH!r}))\n"
        "def disable_telemetry_events(): print('disabled')\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(sys.modules, "onnxruntime", None)  # so that the stand-in goes again
    del sys.modules["onnxruntime"]
    monkeypatch.setenv(onnx_model.SWITCH, before or "")
    if before is None:
        monkeypatch.delenv(onnx_model.SWITCH)
    onnx_model.onnx_runtime()
    assert capsys.readouterr().out.split() == ["1", "disabled"]


@pytest.mark.repository
def test_one_place_loads_it() -> None:
    folders = ("reference", "export", "golden", "benchmarks", "tests")
    files = [path for folder in folders for path in sorted((ROOT / folder).rglob("*.py"))]
    loads = re.compile(r"^\s*(import|from) onnxruntime\b", re.MULTILINE)
    places = [path.relative_to(ROOT).as_posix() for path in files if loads.search(path.read_text("utf-8"))]
    assert places == ["reference/camssf/recovery/onnx_model.py"]
