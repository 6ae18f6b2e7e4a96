"""What the freeze of what users get finds: a changed number, a changed word, a lost file."""

import json
import shutil
from pathlib import Path

import pytest

from tools import freeze


@pytest.fixture
def kept(tmp_path: Path) -> Path:
    """A small folder as `write` leaves it."""
    folder = tmp_path / "kept"
    document = {"ssf": {"red": [0.1, 1.0, 1e-9]}, "gap": [1e-26], "verdict": {"status": "accepted"}, "l2": 1}
    freeze.put(folder / "results" / "a.json", json.dumps(document))
    freeze.put(folder / "results" / "a.status", "0\n")
    freeze.put(folder / "exports" / "csv", "1,2\n3,4\n")
    freeze.put(folder / "pages" / "a.txt", freeze.text_of_page("<style>p {}</style><p>accepted<b> 0.5</b></p>"))
    (folder / "exports" / "icc").write_bytes(b"\xff\x00\x01")
    return folder


@pytest.mark.parametrize(
    ("name", "old", "new", "words"),
    [
        ("results/a.json", "0.1,", "0.10000000001,", "results/a.json/ssf/red/0: 0.1 kept, 0.10000000001 now"),
        ("results/a.json", "0.1,", "0.1000000000000001,", None),  # below the bound
        ("results/a.json", "1e-09", "1.0000001e-09", None),  # of a list whose largest is 1
        ("results/a.json", "1e-26", "3e-25", None),
        ("results/a.json", "accepted", "doubtful", 'results/a.json/verdict/status: "accepted" kept, "doubtful" now'),
        ("results/a.json", '"l2": 1', '"l1": 1', "results/a.json/l1: only made now"),
        ("results/a.json", '"l2": 1', '"l2": true', "results/a.json/l2: 1 kept, true now"),
        ("results/a.json", "[1e-26]", "[]", "results/a.json/gap: 1 entries kept, 0 now"),
        ("results/a.status", "0", "4", "results/a.status: +4"),
        ("exports/csv", "3,4", "3,5", "exports/csv: +3,5"),
        ("exports/icc", "\x01", "\x02", "exports/icc: 3 bytes kept, 3 now, the first that differs is number 2"),
        ("pages/a.txt", "0.5", "0.6", "pages/a.txt: +0.6"),
    ],
)
def test_a_change_is_found(
    kept: Path, tmp_path: Path, name: str, old: str, new: str, words: str | None,
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    def make(folder: Path) -> None:
        shutil.copytree(kept, folder, dirs_exist_ok=True)
        before = (folder / name).read_bytes()
        assert old.encode("latin-1") in before
        (folder / name).write_bytes(before.replace(old.encode("latin-1"), new.encode("latin-1")))

    monkeypatch.setattr(freeze, "make", make)
    assert freeze.main(["compare", str(kept)]) == (0 if words is None else 1)
    out = capsys.readouterr().out
    assert "no difference" in out if words is None else words in out


def test_a_file_that_is_missing_or_new_is_found(kept: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    shutil.copytree(kept, other)
    assert freeze.differences(kept, other) == []
    (other / "exports" / "csv").unlink()
    freeze.put(other / "exports" / "dcp", "x")
    assert freeze.differences(kept, other) == ["exports/csv: only kept", "exports/dcp: only made now"]


def test_pictures_are_compared_by_their_pixels(tmp_path: Path) -> None:
    Image = pytest.importorskip("PIL.Image")
    for name, corner in (("kept", 0), ("same", 1), ("other", 200)):
        (tmp_path / name / "pages").mkdir(parents=True)
        picture = Image.new("RGB", (20, 20))
        picture.putpixel((3, 3), (corner, 0, 0))
        picture.save(tmp_path / name / "pages" / "a.png")
    assert freeze.differences(tmp_path / "kept", tmp_path / "same") == []
    assert freeze.differences(tmp_path / "kept", tmp_path / "other") == ["pages/a.png: 0.25 % of the pixels differ"]


def test_nothing_is_kept_in_the_repository_or_over_something_else(kept: Path) -> None:
    for words in (["write", str(freeze.ROOT / "frozen")], ["write", str(kept)], ["compare", str(kept / "exports")]):
        with pytest.raises(SystemExit) as caught:
            freeze.main(words)
        assert caught.value.code == 2


def test_every_call_is_one_of_the_command_line() -> None:
    """So that names within the package may change."""
    text = Path(freeze.__file__).read_text("utf-8")
    assert "import camssf" not in text
    assert "from camssf" not in text
    assert len(freeze.CAPTURES) == 12
    assert {*freeze.PAGES, freeze.EXPORTED} <= {*freeze.CAPTURES}
