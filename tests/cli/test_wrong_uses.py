"""What a newcomer does wrong, each as a command: what it says, what it exits with, and that it spoils nothing.

One row is one mistake. A command runs in a folder with the files of `home`; none of them may change. Apart from what
the row says is left, nothing may be there afterwards.
"""

import ast
import json
import os
import re
import shlex
import shutil
import zipfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import tifffile
from PIL import Image

from camssf import cli
from camssf.documents.document import document_bytes
from camssf.grid import WAVELENGTHS
from camssf.report.build import report
from camssf.spectra import read_chart, read_lamp
from camssf_fleet.registry import Registry
from tests.cli.conftest import Capture, Patch
from tests.support.captures import calibrated, photos
from tests.support.documents import changed, refused
from tests.support.registries import bells, made


class Wrong(NamedTuple):
    """A command, without `camssf`, its exit status, and what the message names; a refusal's report is in `left`."""

    call: str
    status: int
    object: str  # which is wrong
    step: str = ""  # to do next
    left: str = ""


def calls(template: str, *rows: tuple[object, ...]) -> list[Wrong]:
    """Rows whose first word is a part of the command."""
    return [Wrong(template.format(word), *rest) for word, *rest in rows]


def alike(status: int, object_: str, step: str, *words: str) -> list[Wrong]:
    """Commands that are answered alike."""
    return [Wrong(call, status, object_, step) for call in words]


RAW = "Give the camera's RAW photo as DNG, not a picture."
AGAIN = "Copy the file from the camera again"
SHOT = "calibrate chart.dng --lamp D55 -o out"
AREA = "--region 190,170,40,40 --white-region 190,450,40,40"
ANOTHER = "Give another file for one of them"
NO_DNG = ("photo.jpg", "photo.heic", "video.mp4", "photos.zip", "png.dng", "note.dng")
PHOTO = '{"format": "camssf-corners/1", "photos": {"chart.dng": %s}}'
NO_CORNERS = ["[" * 100_000, '{"format": "camssf-corners/2", "photos": {}}', PHOTO % '{"corners": [[1, 2]]}']

NO_LISTS = ("1-9999999999", "9" * 5000, "1-8,9-7")
AT = "--region 9,9,9,9 --white-region 9,9,9,9"
ROWS = [
    # Files that are missing, or are no photo.
    *calls(
        "calibrate {} --lamp D55 -o out",
        ("chart.dgn", 3, "no file chart.dgn", "Check the path."),
        ("''", 2, "PHOTO is empty", "Give the path"),
        ("folder", 3, "folder is a folder", "Name a file, not a folder."),
        ("https://a.org/b.dng", 2, "https://a.org/b.dng is a URL", "Copy it here first"),
        ("ch art.dng", 2, "2 photo(s) (ch, art.dng)", "quote a name with spaces"),
        *((name, 3, f"{name} is not a DNG file", RAW) for name in NO_DNG),
        ("photo.png", 3, "photo.png is a picture", "write that sidecar"),
        ("cut.dng", 3, "cut.dng is truncated", AGAIN),
        ("linear.dng", 3, "linear.dng is a linear DNG", "plain RAW (DNG) mode"),
        ("chart.dng --white chart.dng", 2, "The chart's photo and the white frame are the same photo", ANOTHER),
        ("chart.dng --dark twin.dng", 2, "The chart's photo and the dark frame are the same photo", ANOTHER),
    ),
    Wrong("calibrate chart.dng chart.dng -o out", 2, "chart.dng was given 2 times", "Give each photo once"),
    Wrong("calibrate typo.dng --lamp D55 -o good", 3, "no file typo.dng", "Check the path."),
    Wrong("calibrate s3://b/a.dng --lamp tungstn -o good", 2, "s3://b/a.dng is a URL", "Copy it here first"),
    Wrong("calibrate chart.dng --white '' -o out", 2, "--white is empty", "Give the path"),
    Wrong("patches chart.dng --white white.dng --dark white.dng", 2, "the dark frame are the same photo", ANOTHER),
    Wrong("solve none.json", 2, "none.json: No such file", "Check the path."),
    Wrong("batch truth.csv -o out", 2, "truth.csv lacks the column name", "Its first line is name,photo"),
    # Photos that carry no answer. What is known of them is left in the report.
    *calls(
        "calibrate {} -o out",
        ("dark.dng --lamp D55", 4, "dark.dng: no chart", "Let the chart fill more of the frame", "out"),
        ("over.dng --lamp D55", 5, "Shot 1: up to 100.0%", "with less exposure", "out"),
        ("chart.dng", 6, "spectrum was not given", "daylight, bulb", "out"),
        ("chart.dng --white dark.dng --dark white.dng --lamp D55", 5, "swapped", "Give the bright frame", "out"),
        ("chart.dng other.dng --lamp D55 --lamp D55", 5, "different cameras", "one camera at a time", "out"),
    ),
    # Corners by hand, and files of corners.
    *calls(
        f"{SHOT} --corners {{}}",
        ("'1179,158 1719,158 1719,515 1179,515'", 2, "outside the photo of 900 × 675", "Give four points x,y in"),
        ("'179,158 719,515 719,158 179,515'", 2, "convex quadrilateral", "Give four points x,y in pixels"),
        ("'1,2 3,4'", 2, "'1,2 3,4' is not four points", "top left, top right"),
        ("none.json", 2, "Cannot read the corners"),
        ("other-photo.json", 2, "names no photo chart.dng"),
        *((f"corners-{i}.json", 2, "holds no corners") for i in range(len(NO_CORNERS))),
    ),
    # Lamps, charts and curves.
    *calls(
        "calibrate chart.dng --lamp {} -o out",
        ("tungstn", 2, "No lamp is called 'tungstn'", "Did you mean tungsten"),
        ("5500", 2, "'5500' is ambiguous", "D:5500 for daylight"),
        ("short.csv", 6, "short.csv covers only 455 to 595", "cover 400 to 700"),
        ("photos.zip", 2, "photos.zip is an archive", "Save the table"),
    ),
    *calls(
        f"{SHOT} --chart {{}}",
        ("classic42", 2, "No chart is called 'classic42'", "Did you mean classic24"),
        ("lamp.csv", 2, "lamp.csv is not a table of reflectances", "a line for each patch"),
        ("card.json", 2, "card.json holds a layout, my card, and no reflectances", "as in card.json:mine"),
        ("card.json:inks.csv", 2, "inks.csv holds 24 patches, my card has 35", "one spectrum for each"),
        ("wide.json:inks.csv", 2, "wide.json: the gaps are too wide", "docs/tables.md shows a layout."),
    ),
    Wrong(f"{SHOT} --truth lamp.csv", 2, "lamp.csv is not a table of a camera's curves", "Its first line must read"),
    Wrong(f"{SHOT} --truth nobody", 2, "No measured camera is called 'nobody'", "`camssf cameras` lists"),
    # Names, numbers and units.
    Wrong("calibrate", 2, "Missing argument", "--help"),
    Wrong("calibrat chart.dng", 2, "No such command 'calibrat'", "Did you mean 'calibrate'"),
    Wrong("chart.dng", 2, "No such command 'chart.dng'", "--help"),
    Wrong("calibrate chart.dng --output out", 2, "No such option: --output", "--out"),
    *calls(
        f"{SHOT} {{}}",
        ("--lamp A", 2, "1 photo(s) (chart.dng) but 2 lamp(s) (D55, A)", "Give one --lamp a photo"),
        ("--chart nano24 --chart mini24", 2, "--chart was given 2 times", "Give it once."),
        ("--basis phone", 2, "'phone' is neither a basis", "Name one of these"),
        ("--engine torch", 2, "no engine 'torch'", "onnx, reference"),
        ("--gamma much", 2, "--gamma", "--help"),
        ("--gamma=-1", 2, "gamma", "Leave them out"),
        ("--white white.dng --white-reflectance 95", 2, "got 95", "Write 95 % as 0.95."),
        ("--white-reflectance 0.9", 2, "but no white frame", "Give the white frame"),
        ("--lamp-tolerance 2", 2, "'2' is not a lamp tolerance", "Write 2%, 300K"),
        ("--chart-tolerance 3", 2, "tolerance is 3", "Write 1 % as 1%"),
        ("--light-per-patch 8", 2, "got 8.0", "Write 8 % as 0.08."),
        ("--fit 0-24", 2, "numbered 1 to 24", "Give some of these numbers"),
        *((f"--fit {many}", 2, "not a list of patches", "Write 7-18") for many in NO_LISTS),
    ),
    Wrong("simulate -o out", 2, "A simulation needs a lamp", "Name one"),
    *calls(
        "simulate {} -o out",
        (f"--lamp D55 --size {'9' * 5000}x9", 2, "not a size", "4000x3000"),
        ("--lamp D55 --size 30000x30000", 2, "megapixels"),
        ("--lamp auto", 2, "A light that is not named has no spectrum", "Lamps:"),
    ),
    *alike(2, "", "--make-manifest", "batch", "batch manifest.csv --make-manifest folder"),
    Wrong("batch manifest.csv --workers tcp://127.0.0.1:9", 2, "", "--registry"),
    Wrong("batch manifest.csv -o chart.dng", 2, "chart.dng is a file", "Name a folder."),
    Wrong("batch manifest.csv --workers 0", 2, "--workers '0'", "Give 1 or more"),
    Wrong("app --port 99999", 2, "--port", "65535"),
    Wrong("explain overexposure", 2, "no error code 'overexposure'", "overexposed"),
    # Where results go.
    Wrong("calibrate chart.dng --lamp D55 -o chart.dng", 2, "chart.dng is a file", "Name a folder."),
    Wrong("calibrate note.dng --lamp D55 -o own", 2, "own/report.html belongs to no sound result", "Move it away"),
    Wrong("report result.json -o own", 2, "own/report.html belongs to no sound result", "Move it away"),
    Wrong("report result.json -o out --photo white.dng", 2, "white.dng"),
    Wrong("demo -o good", 2, "good holds a result that is not from a demo", "Choose another folder"),
    Wrong("demo -o pages", 2, "pages/pictures.html is not from a demo", "Choose another folder"),
    Wrong("simulate --lamp D55 --size 480x360 -o pages", 2, "corners.json is not a simulated file"),
    Wrong("simulate --lamp D55 --size 480x360 -o .", 2, "truth.csv is not a simulated file", "Name another folder"),
    *calls(
        "export result.json {}",
        ("--to rawtoace -o x.json", 2, "no export to 'rawtoace'", "Take one of rawtoaces"),
        ("--to rawtoaces --licence ' ' -o x.json", 2, "licence"),
        ("--to clf --lamp nonsense -o x.clf", 2, "No lamp is called 'nonsense'"),
        ("", 2, "No output file", "Add -o FILE."),
        *((f"-o good/{name}", 2, "belongs to the result in") for name in ("result.json", "ssf.csv", "report.html")),
        ("-o result.json", 2, "result.json belongs to the result", "Name another file."),
        ("-o chart.dng", 2, "chart.dng is a photo", "Name another file."),
        ("-o folder", 2, "folder cannot be written (it is a folder)", "Name a file"),
        ("-o pipe", 2, "pipe cannot be written (it is a device or a pipe)", "Name a file"),
        ("-o none/x.csv", 2, "none/x.csv cannot be written", "Make its folder first"),
    ),
    Wrong(f"spectrum result.json chart.dng {AREA} -o chart.dng", 2, "chart.dng is an input", "Name another file."),
    # Results that are damaged, foreign, or of another camera.
    Wrong("export newer.json -o x.csv", 2, "is camssf/3, not camssf/2; another version", "`camssf calibrate`"),
    Wrong("solve changed.json", 2, "changed.json: sha256 is not the hash of the rest", "as it was written"),
    Wrong("export curveless.json -o x.csv", 2, "answer is missing, but the verdict", "`camssf calibrate`"),
    Wrong("export refused.json -o x.csv", 2, "was refused"),
    Wrong("export cut.json -o x.csv", 2, "cut.json is not valid JSON", "Give the result.json"),
    Wrong("export passport.jws -o x.csv", 2, "passport.jws is a passport", "`camssf passport verify`"),
    Wrong("passport show result.json", 10, "holds no passport", "Give the passport"),
    Wrong("passport sign result.json --key truth.csv -o x.jws", 2, "truth.csv is not a private key", "passport key"),
    Wrong(f"colour result.json other.dng {AREA}", 5, "other.dng was taken by", "Calibrate that camera"),
    Wrong("colour result.json chart.dng --region 190,170,40,40", 2, "a white or grey surface", "--white-region"),
    Wrong(f"colour result.json chart.dng {AREA} --observer 1932", 2, "'1932'", "Take 1931 or 1964."),
    Wrong(
        "colour result.json chart.dng --region 5000,450,40,40 --white-region 190,450,40,40",
        2, "Region 1 (5000,450,40,40) leaves the photo, which is 900 × 675", "Pixels are counted",
    ),
    Wrong(f"spectrum result.json chart.dng {AREA} -o x.bmp", 2, "x.bmp", "ends in .csv or .svg"),
    Wrong(f"spectrum result.json chart.dng {AREA} --prior nails", 2, "'nails'", "general or skin"),
    *calls(
        "calibrate other.dng --previous {}",
        ("curveless.json", 2, "curveless.json: answer", "Give the result.json"),
        ("other.dng", 2, "other.dng is a photo", "Measure it first"),
        ("result.json", 5, "of another camera than", "Give the result of this unit"),
    ),
    Wrong("calibrate chart.dng --previous result.json", 2, "is already in the previous result", "Take a new photo."),
    Wrong("calibrate x.dng --previous good/result.json -o good", 2, "holds the previous result", "another folder"),
    Wrong("parity result.json other.dng", 2, "used the white frame white.dng", "Give just that"),
    # Of a registry of phones.
    *calls(
        "registry {}",
        ("list missing", 2, "There is no folder missing", "Name the folder that `camssf registry add`"),
        ("list own", 2, "own is no registry: it holds no file of records."),
        ("delete phones", 2, "Missing argument", "--help"),
        ("add own result.json", 2, "own", "Name a new or an empty folder."),
        ("compare phones", 2, "Nothing to compare was named", "Give --model to compare its units, or --serial to"),
        ("compare phones --serial none", 2, "no result of a unit with the serial number none"),
        ("compare phones --model Model", 2, "1 unit of Model with a serial number and accepted results"),
        ("export phones -o x.txt", 2, "x.txt ends in neither .parquet nor .csv."),
        ("export phones -o none/x.csv", 2, "none/x.csv"),
        ("report phones -o fleet.pdf", 2, "fleet.pdf does not end in .html"),
        ("report missing -o x.html", 2, "There is no folder missing"),
        *((f"add phones {name}.json", 2, f"{name}.json") for name in ("none", "empty")),
        ("add phones note.dng", 2, "note.dng is text, no result and no passport"),
        ("add phones result.json --captured soon", 2, "soon"),
        ("add phones result.json --serial A --captured 9000-01-01", 2, "lies in the future"),
    ),
    # Addresses in a file's place, of every command that reads or writes one.
    *alike(
        2, "https://bucket/x", "is a URL; camssf reads and writes local files only",
        "calibrate URL", "calibrate chart.dng --lamp URL", "calibrate chart.dng --lamp D55 -o URL",
        *(f"{SHOT} --{more}" for more in ("white URL", "dark URL", "chart URL", "chart classic24:URL")),
        f"{SHOT} --corners URL.json", "simulate --lamp D55 -o URL", "simulate --lamp D55 -o out --camera URL.csv",
        "simulate --lamp D55 -o out --camera URL.csv:Canon", "batch URL", "batch URL --registry r",
        *(f"batch manifest.csv {option} URL" for option in ("-o", "--basis", "--registry")),
        "batch manifest.csv --registry r -o URL", "batch manifest.csv --registry r --basis URL",
        "patches URL", "demo -o URL", "solve URL", "validate URL", "validate result.json --truth URL", "report URL",
        *(f"report result.json {option} URL" for option in ("-o", "--photo", "--passport")),
        "export URL -o x.csv", "export result.json -o URL", "export result.json --to icc --lamp URL -o x.icc",
        f"colour URL chart.dng {AT}", f"colour result.json URL {AT}", f"colour result.json chart.dng {AT} --dark URL",
        f"spectrum URL chart.dng {AT}", f"spectrum result.json URL {AT}",
        *(f"spectrum result.json chart.dng {AT} --{option} URL" for option in ("prior", "index")),
        "direct URL", "direct URL.csv URL.csv", "direct sweep.csv -o URL", "parity URL chart.dng",
        "parity result.json URL", "passport key -o URL",
        "passport sign result.json --key URL -o x.jws", "passport verify URL --key k.pem",
        "registry add URL result.json", "registry add r URL", "registry list URL", "registry compare URL --model x",
        "registry export URL -o x.csv",
    ),
    # A photo in another file's place.
    *alike(
        2, "white.dng is a photo (DNG or TIFF), no", "",
        "solve white.dng", "validate white.dng", "report white.dng", "export white.dng -o x.csv",
        f"colour white.dng white.dng {AT}", f"spectrum white.dng white.dng {AT}",
        f"spectrum result.json white.dng {AT} --prior white.dng", "parity white.dng white.dng",
        "batch white.dng", "batch white.dng --registry r", "direct white.dng", "registry add r white.dng",
        "calibrate white.dng --lamp white.dng", "calibrate white.dng --lamp D55 --chart white.dng",
        "validate result.json --truth white.dng",
    ),
]  # fmt: skip


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A stranger's folder: sound photos and tables, and those with which something is wrong."""
    folder = tmp_path_factory.mktemp("home")
    shot = photos().shots[0]
    other, chart = photos(camera="Demo phone").shots[0].chart, folder / "chart.dng"
    for name, path in {
        "chart.dng": shot.chart, "white.dng": shot.white, "dark.dng": shot.dark, "twin.dng": shot.chart,
        "linear.dng": shot.chart, "over.dng": shot.chart, "other.dng": other, "truth.csv": photos().truth,
    }.items():  # fmt: skip
        shutil.copy(str(path), folder / name)
    photo, data = chart.read_bytes(), document_bytes(calibrated())
    card = {"format": "camssf-layout/1", "name": "my card", "columns": 7, "rows": 5, "patch": 18, "gap": 3}
    result = json.loads(data)
    curveless = {name: value for name, value in result.items() if name not in ("answer", "sha256")}
    for name, content in {
        "cut.dng": photo[: len(photo) // 2], "note.dng": "hello", "photo.heic": b"\0\0\0\x18ftypheic" + bytes(500),
        "video.mp4": b"\0\0\0\x18ftypmp42" + bytes(500), "passport.jws": "eyJh.eyJi.c2ln",
        "manifest.csv": "name,photo,lamp\na,chart.dng,D55\n", "empty.json": "{}", "card.json": json.dumps(card),
        "wide.json": json.dumps(card | {"gap": 30}), "other-photo.json": PHOTO.replace("chart", "other") % "{}",
        **{f"corners-{i}.json": content for i, content in enumerate(NO_CORNERS)},
        "result.json": data, "refused.json": document_bytes(refused()), "cut.json": data[:5000],
        "newer.json": json.dumps(result | {"format": "camssf/3"}), "curveless.json": json.dumps(curveless),
        "changed.json": data.replace(b'"iso": 100.0', b'"iso": 200.0'),
        "own/report.html": "mine", "pages/pictures.html": "mine", "pages/corners.json": "mine",
    }.items():  # fmt: skip
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    with zipfile.ZipFile(folder / "photos.zip", "w") as archive:
        archive.write(folder / "truth.csv", "truth.csv")
    grey = Image.fromarray(np.full((90, 120, 3), 128, np.uint8))
    for name, form in (("photo.jpg", "jpeg"), ("photo.png", "png"), ("png.dng", "png")):
        grey.save(folder / name, form)
    with tifffile.TiffFile(folder / "linear.dng", mode="r+") as file:
        file.pages[0].tags["PhotometricInterpretation"].overwrite(34892)
    samples = tifffile.memmap(folder / "over.dng", mode="r+")
    samples[:] = np.minimum(4 * samples.astype(int), 16383)
    samples.flush()
    nm = np.arange(380.0, 731.0, 5.0)
    lamp = np.interp(nm, WAVELENGTHS, read_lamp("D55").values)
    inks = [np.interp(nm, WAVELENGTHS, value) for value in read_chart("classic24").values]
    for name, columns in (("lamp", [nm, lamp]), ("short", [nm[15:44], lamp[15:44]]), ("inks", [nm, *inks])):
        np.savetxt(folder / f"{name}.csv", np.transpose(columns), delimiter=",", fmt="%.6g")
    report(changed(calibrated(), capture__shots__all__photo__make="Canon")).save(folder / "good")
    Registry(folder / "phones", new=True).add([made(1, bells())])
    (folder / "folder").mkdir()
    if hasattr(os, "mkfifo"):
        os.mkfifo(folder / "pipe")
    return folder


@pytest.mark.requirement("R-REFUSAL")
@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.call[:90])
def test_a_wrong_use(row: Wrong, home: Path, monkeypatch: Patch, capsys: Capture) -> None:
    def state() -> dict[str, tuple[int, int]]:
        """Size and time of each file, by its path."""
        times = {path: (path.stat().st_size, path.stat().st_mtime_ns) for path in home.rglob("*")}
        return {str(path.relative_to(home)): (0, 0) if path.is_dir() else time for path, time in times.items()}

    monkeypatch.chdir(home)
    before = state()
    status = cli.main(shlex.split(row.call.replace("URL", "https://bucket/x")))
    out, err = capsys.readouterr()
    left = {name for name in state() if name not in before}
    expected = {row.left, *(f"{row.left}/{name}" for name in ("result.json", "report.html"))} if row.left else set()
    page = (home / row.left / "report.html").read_text("utf-8") if row.left else ""
    for name in sorted(left, reverse=True):
        (home / name).rmdir() if (home / name).is_dir() else (home / name).unlink()
    assert status == row.status, err
    assert out == "" or status == 5  # what is known of a refused capture
    assert left == expected
    assert state() == before
    assert row.object in err
    assert row.step in err
    assert not re.search("Traceback|bug:|Errno|numpy|codec|None", err)
    assert "data:image" in page or not row.left  # the report of a refusal shows what is known: the photo


@pytest.mark.repository
def test_no_advice_of_the_library_names_an_option() -> None:
    """The page in the browser and callers of Python have none: only texts of the terminal's commands name them."""
    reference = Path(cli.__file__).parents[2]
    terminal = {"cli", "cli.py", "camssf_fleet", "learning", "server.py"}
    ours = [path for path in reference.rglob("*.py") if not terminal & set(path.relative_to(reference).parts)]
    assert len(ours) > 100
    for path in ours:
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Call | ast.Dict):
                for text in ast.walk(node):
                    if isinstance(text, ast.Constant) and isinstance(text.value, str):
                        words = re.sub("`.*?`", "", text.value)  # a command as a whole may be named
                        assert not re.search(r"(^|\s|\()--[a-z]", words), f"{path.name}: {text.value}"
    page = reference / "camssf_app" / "data"
    data = [reference / "camssf" / "data" / name for name in ("errors.json", "messages.json", "lamp-names.json")]
    for path in (*data, page / "app.js", page / "index.html"):
        assert not re.search(r"--[a-z]", path.read_text("utf-8")), path.name
