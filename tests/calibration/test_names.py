"""A known name goes before a file of that name, everywhere; a path is written as one, `./D55`, and is not empty."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import typer

from camssf import cli
from camssf.error_codes import explain_code
from camssf.errors import CalibrationError, InvalidArgument
from camssf.photo.capture import CHART_TABLE, input_hash
from camssf.photo.read.raw import read_raw
from camssf.photo.read.unit import read_unit
from camssf.recovery.basis import basis_of, read_basis
from camssf.result import Result
from camssf.spectra import read_camera, read_chart, read_lamp, read_light
from camssf_colour import read_prior
from camssf_fleet.batch import inputs_hash
from camssf_fleet.inputs import basis_path
from camssf_fleet.manifest import Manifest
from camssf_fleet.passport.excerpt import excerpt_of
from camssf_fleet.passport.keys import read_private
from camssf_lab.direct.columns import read_columns
from tests.support.documents import changed, document

READ: dict[str, tuple[Callable[[Any], Any], tuple[str, ...]]] = {
    "lamp": (read_light, ("D55", "d 55", "2856K", "D:5500", "sun", "halogen", "daylight", "equal-energy", "FL3.1",
                          "auto", "torch")),
    "chart": (read_chart, ("classic24", "Nano24", "passport24:ohta")),
    "camera": (read_camera, ("Canon EOS 5D Mark II", "Demo phone")),
    "basis": (basis_of, ("phones", "gaussian")),
    "prior": (read_prior, ("general",)),
}  # fmt: skip
"""Readers, and names that they know."""
CASES = [(read, name) for read, names in READ.values() for name in names]
LAMP = "".join(f"{nm},{1 + nm / 1000}\n" for nm in range(380, 725, 5))


@pytest.mark.parametrize(("read", "name"), CASES)
def test_a_name_goes_before_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, read: Callable[[Any], Any], name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    known = read(name)
    Path(name).write_text("no table")
    again = read(name)
    assert (getattr(again, "name", None), getattr(again, "source", None)) == (
        getattr(known, "name", None),
        getattr(known, "source", None),
    )
    for path in (f"./{name}", Path(name), Path("./") / name, str(tmp_path / name)):
        with pytest.raises(InvalidArgument):
            read(path)


def manifest(folder: Path, *rows: str) -> list[Any]:
    folder.mkdir(exist_ok=True)
    (folder / "m.csv").write_text("\n".join(["name,photo,lamp,white,dark,chart", *rows]))
    return list(Manifest(folder / "m.csv"))


@pytest.mark.parametrize("home", [".", "below"])
def test_photos_called_like_lamps_and_charts_do_not_shadow_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, home: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("below").mkdir()
    for name in ("D55", "auto", "sun", "classic24", "babelcolor", "2856K", "none"):
        Path(home, name).write_text("a photo")
    rows = [
        f"{i},D55,{lamp},none,2856K,{chart}"
        for i, (lamp, chart) in enumerate(
            (("D55", "classic24"), ("", ""), ("sun", "nano24:babelcolor"), ("2856K", "classic24"))
        )
    ]
    for job, row in zip(manifest(Path(home), *rows), rows, strict=True):
        lamp, chart = row.split(",")[2], row.split(",")[5]
        assert (job.lamps, job.chart) == ((lamp or "auto",), chart or "classic24")
        assert not job.fault
        read_light(job.lamps[0])
        read_chart(job.chart)
        assert Path(job.photos[0]).read_text() == Path(job.dark[0]).read_text() == "a photo"
        assert job.white == (None,)
        found = inputs_hash(job)
        Path(home, "sun").write_text(f"another photo, {row}")
        assert inputs_hash(job) == found, "not an input"
    Path(home, "D55").write_text(LAMP)
    (job,) = manifest(Path(home), "one,D55,./D55,./none,,nano24:./babelcolor")
    assert read_lamp(job.lamps[0]).source == "file D55"
    assert job.white[0] is not None
    with pytest.raises(InvalidArgument, match="babelcolor"):
        read_chart(job.chart)
    found = inputs_hash(job)
    Path(home, "babelcolor").write_text("changed")
    assert inputs_hash(job) != found


def test_hashes_of_a_capture_are_those_of_the_files_that_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("D55", "sun", "classic24", "ohta"):
        Path(name).write_text("a photo")
    for lamp in ("D55", "sun", "auto"):
        assert input_hash("shot 1, lamp", lamp) == {}
    for chart in ("classic24", "classic24:ohta"):
        assert input_hash(CHART_TABLE, chart) == {}
    assert list(input_hash("shot 1, lamp", "./D55")) == ["shot 1, lamp: D55"]
    assert list(input_hash(CHART_TABLE, "classic24:./ohta")) == ["chart table: ohta"]
    assert changed(excerpt_of(document()), shots__0__white_reference="white patch").scale() is not None
    Path("phones").write_text("a photo")
    assert basis_path("phones") is None
    assert basis_path("./phones") == Path("phones")
    assert read_basis("phones").name == "phones"


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


def test_an_empty_folder_writes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    monkeypatch.chdir(tmp_path)
    for line in ("demo -o", "calibrate photo.dng -o", "batch m.csv -o", "simulate --lamp D55 -o"):
        assert cli.main([*line.split(), ""]) == 2
        assert "-o" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


READERS = {
    "photo.dng": (read_raw, read_unit),
    "picture.png": (read_raw,),
    "table.csv": (read_lamp, read_chart, read_camera, lambda path: read_columns(path, ("wavelength_nm", "response"))),
    "result.json": (Result.load,),
    "manifest.csv": (lambda path: list(Manifest(path)),),
    "key.pem": (read_private,),
}


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
