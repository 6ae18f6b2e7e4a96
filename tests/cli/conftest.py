"""A simulated capture, its result as the command line leaves it, and streams, that the tests of commands share."""

import io
import sys
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from importlib import import_module
from pathlib import Path
from typing import Any, TypeAlias

import pytest

from camssf import cli
from tests.support.captures import photos
from tests.support.failures import raising

Capture: TypeAlias = pytest.CaptureFixture[str]
Feed: TypeAlias = Callable[[str | bytes | None], None]
Patch: TypeAlias = pytest.MonkeyPatch
Swap: TypeAlias = Callable[[Any], None]
FILES = ["patches.csv", "report.html", "result.json", "ssf.csv", "ssf.svg"]


@pytest.fixture(scope="session")
def shots() -> Path:
    """A folder with chart.dng, white.dng, dark.dng, truth.csv and corners.json; nobody writes to it."""
    return photos().shots[0].chart.parent


@pytest.fixture(scope="session")
def triple(shots: Path) -> list[str]:
    """The arguments of that capture."""
    frames = {kind: str(shots / f"{kind}.dng") for kind in ("chart", "white", "dark")}
    return [frames["chart"], "--lamp", "D55", "--white", frames["white"], "--dark", frames["dark"]]


@pytest.fixture(scope="session")
def result(shots: Path, triple: list[str], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What `calibrate` leaves; nobody writes to it."""
    out = tmp_path_factory.mktemp("result") / "deep" / "out"
    assert cli.main(["calibrate", *triple, "--truth", str(shots / "truth.csv"), "-o", str(out)]) == 0
    return out


@pytest.fixture
def feed(monkeypatch: Patch) -> Feed:
    """Put something on stdin, or close it."""

    def put(data: str | bytes | None) -> None:
        raw = data.encode() if isinstance(data, str) else data
        monkeypatch.setattr(sys, "stdin", None if raw is None else io.TextIOWrapper(io.BytesIO(raw), "utf-8"))

    return put


@pytest.fixture
def swap(monkeypatch: Patch) -> Swap:
    """Put a function, or an exception, in the place of the calibration."""
    return lambda value: monkeypatch.setattr(import_module("camssf.calibration"), "attempt", raising(value))


def state(folder: Path) -> dict[str, bytes | None]:
    """The content of each file, and None for each folder, by its path."""
    return {str(p.relative_to(folder)): p.read_bytes() if p.is_file() else None for p in folder.rglob("*")}


def spoken(arguments: list[str], coding: str = "utf-8", stdin: bytes = b"") -> tuple[int, bytes, bytes]:
    """Status, stdout and stderr of a command with strict streams: what cannot be encoded is an exception."""
    out, err, entered = (io.TextIOWrapper(io.BytesIO(data), coding, errors="strict") for data in (b"", b"", stdin))
    with redirect_stdout(out), redirect_stderr(err), pytest.MonkeyPatch.context() as patched:
        patched.setattr(sys, "stdin", entered)
        status = cli.main(arguments)
    out.flush()
    err.flush()
    return status, out.buffer.getvalue(), err.buffer.getvalue()
