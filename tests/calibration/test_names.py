"""A known name goes before a file of that name, everywhere; a path is written as one, `./D55`, and is not empty."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import typer

from camssf import cli
from camssf.error_codes import explain_code
from camssf.errors import CalibrationError, InvalidArgument
from camssf.photo.read.raw import read_raw
from camssf.photo.read.unit import read_unit
from camssf.recovery.basis import basis_of
from camssf.result import Result
from camssf.spectra import read_camera, read_chart, read_lamp, read_light
from camssf_colour import read_prior
from camssf_fleet.manifest import Manifest
from camssf_fleet.passport.keys import read_private
from camssf_lab.direct.columns import read_columns

READ: dict[Callable[[Any], Any], tuple[str, ...]] = {
    read_light: ("D55", "d 55", "2856K", "D:5500", "sun", "halogen", "daylight", "equal-energy", "FL3.1", "auto",
                 "torch"),
    read_chart: ("classic24", "Nano24", "passport24:ohta"), read_camera: ("Canon EOS 5D Mark II", "Demo phone"),
    basis_of: ("phones", "gaussian"), read_prior: ("general",),
}  # fmt: skip
"""Readers, and names that they know."""


@pytest.mark.parametrize(("read", "name"), [(read, name) for read, names in READ.items() for name in names])
def test_a_name_goes_before_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, read: Any, name: str) -> None:
    monkeypatch.chdir(tmp_path)
    known = read(name)
    Path(name).write_text("no table")
    again = read(name)
    for part in ("name", "source"):
        assert getattr(again, part, None) == getattr(known, part, None)
    for path in (f"./{name}", Path(name), Path("./") / name, str(tmp_path / name)):
        with pytest.raises(InvalidArgument):
            read(path)


def commands(group: Any) -> list[Any]:
    """All commands of the command line."""
    parts = getattr(group, "commands", None)
    return [group] if parts is None else [command for part in parts.values() for command in commands(part)]


def test_an_empty_path_is_refused_by_every_command() -> None:
    """Every option and argument that the help calls a file or a folder."""
    tried = 0
    for command in commands(typer.main.get_command(cli.app)):
        before: list[str] = []
        for option in command.params:
            argument = option.param_type_name == "argument"
            path = any(word in (option.metavar or "") for word in ("FILE", "FOLDER", "JSON", "DNG", "CSV", "PHOTO"))
            if path:
                for empty in ("", " "):
                    words = [*before, empty] if argument else [option.opts[-1], *[empty] * option.nargs]
                    with pytest.raises(InvalidArgument, match="is empty"):
                        command.make_context("x", words)
                tried += 1
            before += ["x"] if argument else []
    assert tried > 50


READERS = {
    "photo.dng": (read_raw, read_unit), "picture.png": (read_raw,), "result.json": (Result.load,),
    "table.csv": (read_lamp, read_chart, read_camera, lambda path: read_columns(path, ("wavelength_nm", "response"))),
    "manifest.csv": (lambda path: list(Manifest(path)),), "key.pem": (read_private,),
}  # fmt: skip


@pytest.mark.parametrize(("name", "read"), [(name, read) for name, readers in READERS.items() for read in readers])
def test_the_advice_for_a_missing_file_is_not_that_for_a_damaged_one(tmp_path: Path, name: str, read: Any) -> None:
    path = tmp_path / name
    for _ in range(2):
        with pytest.raises(CalibrationError) as caught:
            read(str(path))
        assert str(path) in caught.value.message
        assert not re.search("again|take", caught.value.advice), caught.value.advice
        if path.exists():
            assert "folder" in str(caught.value) or "directory" in str(caught.value), caught.value
            assert "There is no file" not in caught.value.message
        else:
            path.mkdir()
    assert "again" not in explain_code("unreadable_raw").do[0], "the fleet's page shows it for missing files, too"
