"""A manifest, CSV or Parquet, becomes jobs, each fault with its row; that of a folder of photos, by their names."""

import csv
import os
from dataclasses import replace
from pathlib import Path

import pytest

from camssf import cli
from camssf.errors import InvalidArgument
from camssf.photo.read.unit import Unit
from camssf_fleet.archive import task_of
from camssf_fleet.batch import inputs_hash
from camssf_fleet.manifest import Manifest
from camssf_fleet.manifest_maker import make_manifest
from camssf_fleet.record_queries import connection

SOUND, WHOLE = "name,photo,lamp\n", "name,photo,lamp,white,dark,chart\n"
FORMS = {
    "shots of a camera": WHOLE + "cam,day.dng,D:5500,wd.dng,,nano24:mine.csv\ncam,b.dng,A,none,,\nx,y,D55,,,\n",
    "a spreadsheet's": "\ufeffName;Photo;Lamp\r\ncam;a.dng;D55\r\n\r\n",
    "quoted": SOUND + '"a, ""b""\nc",p,D55\n', "faults": SOUND + "long,a,D55,x\nno photo,,D55\n,a,D55\n",
    "an old Mac's": "name,photo,lamp\rcam,a.dng,D55\rother,b.dng,\r",
    "an old Mac's, too long": "name,photo,lamp\rlong,a,D55,x\r\nb,c,A\n",
    "a header of two lines": '"name\n",photo,lamp\ncam,a.dng,D55\nlong,a,D55,x\n',
    "other letters": SOUND + "k\u00e4mera,\u00fc.dng,\n",
}  # fmt: skip


def written(folder: Path, text: str | bytes, name: str = "manifest.csv", **options: str) -> Manifest:
    (folder / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    return Manifest(folder / name, **options)


@pytest.mark.parametrize("text", FORMS.values(), ids=FORMS)
def test_streamed_or_read_at_once_it_is_the_same(text: str, tmp_path: Path) -> None:
    (tmp_path / "mine.csv").write_text("")
    manifest = written(tmp_path, text)
    for streamed, job in zip(manifest, manifest.read_all(), strict=True):
        assert streamed == replace(job, folder="")
    assert manifest.done == 1.0


def test_rows_of_one_name_are_its_shots_and_paths_are_the_manifest_s(tmp_path: Path) -> None:
    for name in ("mine.csv", "lamp.csv"):
        (tmp_path / name).write_text("")
    chart = "nano24:mine.csv"
    cam, other = written(tmp_path, f"{WHOLE}cam,day.dng,D:5500,wd.dng,dd.dng,{chart}\nother,x.dng,,,,\n"
                                   f"cam,bulb.dng,lamp.csv,none,,{chart}\n").read_all()  # fmt: skip
    assert cam.photos == (str(tmp_path / "day.dng"), str(tmp_path / "bulb.dng"))
    assert cam.lamps == ("D:5500", str(tmp_path / "lamp.csv"))
    assert (cam.white, cam.dark) == ((str(tmp_path / "wd.dng"), None), (str(tmp_path / "dd.dng"), None))
    assert cam.chart == f"nano24:{tmp_path / 'mine.csv'}"
    assert (other.chart, other.lamps, other.white, other.dark) == ("classic24", ("auto",), (None,), (None,))
    assert cam.fault == other.fault == ""


@pytest.mark.parametrize("name", [
    "../evil", "..", ".", "/etc/passwd", "a/../../b", "C:\\Windows", "CON", "lpt1.txt", "x" * 300, "nul\tbyte", "~",
    " ", "summary.csv", "SUMMARY.CSV",
])  # fmt: skip
def test_no_name_escapes_its_folder(name: str, tmp_path: Path) -> None:
    (job,) = written(tmp_path, f'name,photo,lamp\n"{name}",a,D55\n').read_all()
    assert (tmp_path / "out" / job.folder).resolve().parent == (tmp_path / "out").resolve()
    assert len(job.folder) < 120
    assert not set(job.folder) & set('/\\:*?"<>|\t\0')
    assert not job.folder.endswith((".", " "))
    assert job.folder.split(".")[0].casefold() not in ("con", "lpt1")
    assert job.folder.casefold() != "summary.csv"


def test_names_of_folders_stay_readable_and_apart(tmp_path: Path) -> None:
    names = ["Nikon 5100 (NPL)", "Kamera für Späße", "summary", "a/b", "a_b", "a?b", "canon", "Canon"]
    manifest = written(tmp_path, "name,photo,lamp\n" + "".join(f"{name},a,D55\n" for name in names))
    folders = [job.folder for job in manifest.read_all()]
    assert folders[:3] == names[:3]
    assert folders[4] == "a_b"
    assert len({folder.casefold() for folder in folders}) == len(names)
    assert folders == [job.folder for job in manifest.read_all()]


@pytest.mark.parametrize(("name", "content", "words"), [
    ("m.csv", None, "cannot be read"), ("m.csv", b"", "lacks the column"), ("m.csv", b"name,photo\n", "lamp"),
    ("m.csv", SOUND, "no rows"), ("m.csv", "name,photo,lamp,lamp\n", "doubled"),
    ("m.csv", SOUND.encode() + b"\xff\xfe,x,y\n", "cannot be read"), ("m.csv", SOUND + "x" * 2_000_000, "too long"),
    ("m.parquet", None, "cannot be read"), ("m.parquet", b"PAR1xPAR1", "cannot be read"),
])  # fmt: skip
def test_a_manifest_without_sense(name: str, content: str | bytes | None, words: str, tmp_path: Path) -> None:
    if content is not None:
        written(tmp_path, content, name)
    with pytest.raises(InvalidArgument, match=words):
        list(Manifest(tmp_path / name))


def test_faults_are_their_rows_own(tmp_path: Path) -> None:
    (tmp_path / "a\\b").write_text("a name that holds one")
    rows = {
        "a,x,D55": "", "b,x,D55,,,,soon": "no time", "a,y,D55": "stand together", "c,x,D55,,,,,": "more fields",
        ",x,D55": "no name", "d,,D55": "no photo", "e,x,D55": "", "f,x,D55,,,classic24\nf,x,A,,,sg140":
        "different charts", "g,shots\\a.dng,D55": "write / instead", "h,a,lamps\\l.csv": "write / instead",
        "i,a,D55,w\\x": "write / instead", "j,a,D55,,d\\x": "write / instead",
        "k,a,D55,,,nano24:c\\x.csv": "write / instead", "l,C:\\a.dng,D55": "write / instead", "m,a\\b,D55": "",
    }  # fmt: skip
    jobs = list(written(tmp_path, "name,photo,lamp,white,dark,chart,captured\n" + "\n".join(rows)))
    for job, words in zip(jobs, rows.values(), strict=True):
        if os.sep == "/" or "instead" not in words:
            assert (words in job.fault) if words else not job.fault, job


def test_a_further_column_needs_a_registry(tmp_path: Path) -> None:
    with pytest.raises(InvalidArgument, match="an unknown column"):
        written(tmp_path, "name,photo,lamp,lens\na,x,D55,50mm\n").read_all()


def test_parquet_reads_as_its_csv_with_further_columns(tmp_path: Path) -> None:
    text = "cam,a.dng,D55,S1,2026-01-02,lab,1\ncam,b.dng,A,S1,2026-01-02,lab,1\nother,c.dng,A,,,,\n"
    rows = list(written(tmp_path, "name,photo,lamp,serial,captured,site,n\n" + text))
    with connection() as con:
        con.execute(f"COPY (FROM read_csv('{tmp_path}/manifest.csv', all_varchar = true)) TO '{tmp_path}/m.parquet'")
    assert list(Manifest(tmp_path / "m.parquet")) == rows
    cam, other = rows
    assert (cam.unit, cam.captured, len(cam.photos)) == (Unit(serial="S1"), "2026-01-02", 2)
    assert cam.extra == (("site", "lab"), ("n", "1"))
    assert (other.unit, other.captured, other.extra) == (Unit(), "", ())


def test_a_task_is_known_by_what_it_would_be_made_from(tmp_path: Path) -> None:
    for name in ("a", "lamp.csv", "a.png"):
        (tmp_path / name).write_text("1")
    head, row, picture = "name,photo,lamp,chart", "cam,a,lamp.csv,nano24:lamp.csv", "name,photo,lamp\ncam,a.png,A\n"

    def task(text: str = f"{head}\n{row}\n", **options: str) -> str:
        (job,) = written(tmp_path, text, **options)
        return task_of(job, None)

    tasks = [task(), task(basis="gaussian")]
    assert task() == tasks[0]
    (tmp_path / "a").write_text("12")
    tasks.append(task())
    os.utime(tmp_path / "lamp.csv", (1, 1))
    tasks += [task(), task(f"{head}\ncam,a,lamp.csv,\n"), task(f"{head},serial\n{row},9\n"), task(picture)]
    for sidecar in ("1", "12"):
        (tmp_path / "a.png.json").write_text(sidecar)
        tasks.append(task(picture))
    assert len(set(tasks)) == len(tasks)


def test_a_cluster_is_told_where_the_basis_lies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A worker may stand elsewhere; what a result is named after is the same."""
    monkeypatch.chdir(tmp_path)
    for name in ("mine.npz", "p"):
        Path(name).write_bytes(b"one")
    Path("m.csv").write_text("name,photo,lamp\ncam,p,D55\n")
    (job,), (sent,) = Manifest("m.csv", basis="mine.npz"), Manifest("m.csv", basis="mine.npz").absolute()
    assert (sent.photos, sent.basis) == ((str(tmp_path / "p"),), str(tmp_path / "mine.npz"))
    assert inputs_hash(sent) == inputs_hash(job)
    (job,) = Manifest("m.csv").absolute()
    assert job.basis == "auto"


def shoot(folder: Path, *names: str) -> Path:
    for name in names:
        (folder / name).write_text("photo")
    return folder


def made(folder: Path, *names: str) -> list[list[str]]:
    rows = make_manifest(shoot(folder, *names))
    header, *lines = csv.reader((folder / "manifest.csv").read_text("utf-8").splitlines())
    assert header == ["name", "photo", "lamp", "white", "dark", "chart", "serial"]
    assert rows == len(lines)
    return lines


def test_rows_of_a_unit_are_its_shots_with_their_frames(tmp_path: Path) -> None:
    names = ("S2_D65.dng", "S1_D55.DNG", "S1_d55_white.dng", "S1_A_2.dng", "S1_A_1.dng", "S1_A_dark.dng", "S1.txt")
    rows = made(tmp_path, *names)
    assert rows == [
        ["S1", "S1_A_1.dng", "A", "", "S1_A_dark.dng", "", "S1"],
        ["S1", "S1_A_2.dng", "A", "", "S1_A_dark.dng", "", "S1"],
        ["S1", "S1_D55.DNG", "D55", "S1_d55_white.dng", "", "", "S1"],
        ["S2", "S2_D65.dng", "D65", "", "", "", "S2"],
    ]
    one, two = Manifest(tmp_path / "manifest.csv")
    assert (one.lamps, two.lamps, one.unit.serial) == (("A", "A", "D55"), ("D65",), "S1")
    assert one.fault == two.fault == ""


@pytest.mark.parametrize(("name", "unit", "lamp"), [
    ("Pixel 9_A1_B2_D65.dng", "Pixel 9_A1_B2", "D65"), ("A_D55_third try.dng", "A", "D55"),
    ("S1_D55_A.dng", "S1_D55", "A"),  # the last place where a lamp stands
    ("S1_led-b1.nef", "S1", "led-b1"), ("S1_FL1_2.dng", "S1", "FL1"), ("S1_auto.dng", "S1", "auto"),
    ("S1_my_lamp_2.dng", "S1", "my_lamp.csv"), ("S1_BENCH.dng", "S1", "bench.CSV"),
    ("S1_D65_Whitehall.dng", "S1", "D65"),
])  # fmt: skip
def test_a_name_is_a_unit_and_a_lamp(name: str, unit: str, lamp: str, tmp_path: Path) -> None:
    ((row),) = made(tmp_path, name, "my_lamp.csv", "bench.CSV", "d65.csv")
    assert row[:3] == [unit, name, lamp]


def test_a_picture_needs_its_sidecar_and_folders_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "S3_D55.dng").mkdir()
    rows = made(tmp_path, "S1_D55.png", "S1_D55.png.json", "S2_D55.png", "S2_D55.jpg")
    assert [row[1] for row in rows] == ["S1_D55.png"]


@pytest.mark.parametrize(("names", "words"), [
    (["S1_D55.dng", "S2.dng"], "S2.dng does not name a lamp, as UNIT_LAMP.dng does"),
    (["S1_D55.dng", "_D55.dng"], "_D55.dng does not name a lamp"),
    (["S1_D55.dng", "white.dng"], "white.dng does not name a lamp"),
    (["S1_D55.dng", "S1_flash.dng"], "S1_flash.dng does not name a lamp"),
    (["S1_D55.dng", "S1_A_white.dng"], "a white frame, but S1 has no photo under A"),
    (["S1_D55.dng", "S1_D55_dark.dng", "S1_D55_2_dark.dng"], "a second dark frame of S1 under D55"),
    (["S1_D55.txt"], "has no photo of a chart"),
])  # fmt: skip
def test_a_photo_without_a_place_is_named_and_nothing_written(names: list[str], words: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidArgument, match=words):
        make_manifest(shoot(tmp_path, *names))
    assert not (tmp_path / "manifest.csv").exists()


def test_no_manifest_is_written_over(tmp_path: Path) -> None:
    (tmp_path / "manifest.csv").write_text("mine")
    with pytest.raises(InvalidArgument, match="was not changed"):
        make_manifest(shoot(tmp_path, "S1_D55.dng"))
    assert (tmp_path / "manifest.csv").read_text() == "mine"
    with pytest.raises(InvalidArgument, match="cannot be read"):
        make_manifest(tmp_path / "nowhere")


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shoot(tmp_path, "S1_D55.dng", "S2_D55.dng")
    assert cli.main(["batch", "--make-manifest", str(tmp_path)]) == 0
    out, err = capsys.readouterr()
    assert (out, "2 rows written to" in err) == ("", True)
