"""A report's files: CSV and PNG, all or none of them on disk."""

import errno
import os
import re
import shutil
from functools import cache
from itertools import product
from pathlib import Path
from unittest.mock import DEFAULT, Mock

import numpy as np
import pytest

from camssf.documents.document import Document
from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS
from camssf.report.build import NAMES, Report, report
from tests.cli.conftest import state
from tests.report.conftest import put
from tests.support.documents import changed, document, preview, refused


def test_what_no_report_is_made_of_is_said() -> None:
    made = document()
    unsolved = Document(format=made.format, version=made.version, capture=made.capture)
    for whole, previews, words in (
        (unsolved, [], "was not solved"), (made, [None, preview()], "2 previews for 1 shots"),
        (made, [b"GIF89a"], "Preview 1 is not a JPEG or PNG"),
    ):  # fmt: skip
        with pytest.raises(InvalidArgument, match=words):
            report(whole, previews)


def test_csv_reads_back() -> None:
    made = document()
    made = changed(made, answer__curves__blue=put(made.answer.curves.blue, -1, -1e-12))
    text = report(made).ssf_csv
    head, *lines = text.splitlines()
    assert head == "wavelength_nm,red,green,blue,red_std,green_std,blue_std"
    values = np.array([line.split(",") for line in lines], dtype=float)
    assert np.array_equal(values[:, 0], WAVELENGTHS)
    np.testing.assert_allclose(values[:, 1:], np.hstack([made.curves, made.std]), rtol=0, atol=5.1e-10)
    assert all(re.fullmatch(r"\d{3}\.\d(,-?\d\.\d{9}){6}", line) for line in lines)
    assert "-0.000000000" not in text
    bandless = report(changed(document(), answer__std=None)).ssf_csv
    assert bandless.startswith("wavelength_nm,red,green,blue\n")


@cache
def results() -> tuple[Report, Report, Report]:
    other = changed(document(), capture__shots__0__photo__model="another")
    return report(document()), report(other), report(refused())


def test_save_leaves_five_files(tmp_path: Path) -> None:
    (first, second, _), folder = results(), tmp_path / "a" / "b"
    assert [path.name for path in first.save(folder)] == [name for name in NAMES if name != "ssf.png"]
    texts = {"ssf.csv": first.ssf_csv, "patches.csv": first.patches_csv, "ssf.svg": first.ssf_svg}
    texts["report.html"] = first.html
    written = {name: (text or "").encode() for name, text in texts.items()}
    assert state(folder) == written | {"result.json": first.result_json}
    second.save(str(folder))
    assert state(folder)["result.json"] == second.result_json


def test_a_refused_result_replaces_no_curves(tmp_path: Path) -> None:
    """It goes to a folder of its own; there, and where nothing else stands, a later one replaces it."""
    first, second, refusal = results()
    first.save(tmp_path)
    (tmp_path / "notes.txt").write_text("mine")
    before = state(tmp_path)
    for _ in range(2):
        written = refusal.save(tmp_path)
        assert written == [tmp_path / "refused" / "result.json", tmp_path / "refused" / "report.html"]
    assert {name: content for name, content in state(tmp_path).items() if not name.startswith("refused")} == before
    assert refusal.save(tmp_path / "refused") == written
    assert [path.parent for path in second.save(tmp_path / "refused")] == [tmp_path / "refused"] * 5


def test_a_refused_result_replaces_no_file_that_it_does_not_know(tmp_path: Path) -> None:
    _, _, refusal = results()
    contents = ("", "[]", '{"verdict": 1}', '{"verdict": {"status": "doubtful"}}')
    for number, (name, content) in enumerate(product(NAMES, contents)):
        folder = tmp_path / str(number)
        folder.mkdir()
        (folder / name).write_text(content)
        refusal.save(folder)
        assert (folder / name).read_text() == content
        assert sorted(path.name for path in folder.iterdir()) == sorted([name, "refused"]), (name, content)


def test_save_is_all_or_none(tmp_path: Path) -> None:
    """Whichever file cannot be written or put in its place, over an earlier result or not."""
    first, second, refusal = results()
    errors = (OSError(errno.ENOSPC, "No space left on device"), KeyboardInterrupt())
    comings = [(second, turn) for turn in range(4)] + [(refusal, turn) for turn in range(2)]
    for number, (earlier, (coming, turn), error, name) in enumerate(
        product((False, True), comings, errors, ("fsync", "replace"))
    ):
        folder = tmp_path / str(number) / "out"
        if earlier:
            first.save(folder)
        before = state(tmp_path)
        expected = InvalidArgument if isinstance(error, OSError) else KeyboardInterrupt
        with pytest.MonkeyPatch.context() as patched:
            ends = [DEFAULT] * turn + [error] + [DEFAULT] * 20
            patched.setattr(os, name, Mock(wraps=getattr(os, name), side_effect=ends))
            with pytest.raises(expected):
                coming.save(folder)
        assert state(tmp_path) == before, (earlier, turn, error, name)
        shutil.rmtree(tmp_path / str(number), ignore_errors=True)


def test_save_refuses_what_is_in_the_way(tmp_path: Path) -> None:
    first, _, refusal = results()
    (tmp_path / "file").write_text("mine")
    (tmp_path / "out" / "ssf.svg").mkdir(parents=True)
    before = state(tmp_path)
    for result, folder in ((first, "file"), (first, "out"), (refusal, "out"), (first, "file/below"), (first, "a\0b")):
        with pytest.raises(InvalidArgument):
            result.save(tmp_path / folder)
        assert state(tmp_path) == before
