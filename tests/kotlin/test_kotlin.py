"""Kotlin's calibrator beside Python's on the same captures. Needs `mvn -f android-bindings package`, and Java.

Where either is missing the whole file is one skip, which says so.
"""

import hashlib
import json
import os
import shutil
import subprocess
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pytest

from camssf.calibration import attempt, solve
from camssf.cli import main
from camssf.compare.differences import TABLE, differences, of_largest, row_of
from camssf.compare.parity import STAGES, first, parity
from camssf.documents.document import ADVICE, Document, answer_in, document_bytes
from camssf.documents.forms import Json, read
from camssf.errors import CalibrationError
from camssf.grid import Floats
from camssf.options import Options
from camssf.photo.capture import measure
from camssf.photo.read.dng import read_dng
from camssf.photo.shot import Shot
from camssf.result import Result
from camssf.spectra import CameraCurves, read_chart, read_lamp
from camssf_lab.simulation.frames import SimulatedShot, Simulation, simulate
from camssf_lab.simulation.scene import Scene
from golden.forms import resolve
from golden.scenes import PHONE
from tests.support.text_tables import TABLES
from tools.fuzz import damaged

pytestmark = [pytest.mark.full, pytest.mark.requirement("R-PARITY")]

BINDINGS = Path(os.environ.get("CAMSSF_BINDINGS", Path(__file__).parents[2] / "android-bindings"))
GOLDEN = BINDINGS / "golden" / "target"


def _jars() -> list[Path]:
    return [jar for jar in sorted(GOLDEN.glob("camssf-golden-*.jar")) if "sources" not in jar.name]


def java(*words: str, **how: Any) -> dict[str, Any]:
    """A JVM with the built classes, as keywords of `subprocess`."""
    path = os.pathsep.join([*map(str, _jars()), (GOLDEN / "classpath.txt").read_text().strip()])
    return {"args": ["java", "-Xmx512m", "-XX:TieredStopAtLevel=1", "-cp", path, *words], "text": True, **how}


if shutil.which("java") is None:
    pytest.skip("there is no Java: Kotlin's results are not compared with Python's", allow_module_level=True)
if not (GOLDEN / "classpath.txt").exists() or not _jars():
    pytest.skip(
        "no jar (mvn -f android-bindings package, needs Java): Kotlin's results are not compared with Python's",
        allow_module_level=True,
    )


@dataclass
class Case:
    """One capture, told to both."""

    shots: list[SimulatedShot]
    corners: list[Floats]
    lamps: list[str]
    white: bool = True
    dark: bool = True
    options: dict[str, Any] = field(default_factory=dict)

    def frames(self, shot: SimulatedShot) -> dict[str, Path]:
        """White and dark frame of a shot, where they are told."""
        return {role: getattr(shot, role) for role in ("white", "dark") if getattr(self, role)}


def parsed(content: bytes) -> Json:
    """A document without the hash of its content."""
    document: Json = json.loads(content)
    del document["sha256"]
    return document


class Kotlin:
    """One JVM for all captures."""

    def __init__(self) -> None:
        pipes: Any = dict.fromkeys(("stdin", "stdout"), subprocess.PIPE)
        self.process = subprocess.Popen(**java("org.camssf.golden.Calibrate", **pipes))

    def __call__(self, case: Case, out: Path) -> Json:
        """The result document; it has the form of one, and the hash of its content."""
        self.run(case, out)
        Result.load(out)
        return parsed(out.read_bytes())

    def run(self, case: Case, out: Path) -> None:
        """Write the document."""
        options = dict(case.options)
        own = {"lamp_tolerance": options.pop("lamp_tolerance", None)}
        shots = [
            own | {"photo": shot.chart, "lamp": lamp, "corners": np.ravel(corners).tolist()} | case.frames(shot)
            for shot, lamp, corners in zip(case.shots, case.lamps, case.corners, strict=True)
        ]
        self.process.stdin.write(json.dumps({"shots": shots, "output": out, **options}, default=str) + "\n")
        self.process.stdin.flush()
        status = self.process.stdout.readline().split()
        assert status and status[0] in ("0", "5"), status  # noqa: PT018


@pytest.fixture(scope="module")
def kotlin() -> Iterator[Kotlin]:
    jvm = Kotlin()
    with jvm.process:
        yield jvm
        jvm.process.stdin.close()


def python(case: Case) -> Json:
    """Python's, refused or not; a file's name in its words as Kotlin knows it, without the folder."""
    options = dict(case.options)
    chart, tolerance = options.pop("chart", "classic24"), options.pop("lamp_tolerance", None)
    previous = options.pop("previous", None)
    shots = [
        Shot(shot.chart, lamp, corners=corners, lamp_tolerance=tolerance, **case.frames(shot))
        for shot, lamp, corners in zip(case.shots, case.lamps, case.corners, strict=True)
    ]
    result = attempt(shots, chart=chart, options=Options(**options), previous=previous)
    content = document_bytes(result)
    for path in (path for shot in case.shots for path in (shot.chart, shot.white, shot.dark) if path):
        content = content.replace(str(path).encode(), path.name.encode())
    return parsed(content)


MEANS = "/capture/shots/means"
BOUNDS = {
    MEANS: 0.0,
    f"{MEANS}/noise": 1e-9,
    **{f"{MEANS}/{role}/standard_error": 1e-15 for role in ("chart", "white", "dark")},
    **{f"{MEANS}/{role}/gradient": 1e-12 for role in ("chart", "white", "dark")},
    **{f"/capture/shots/{role}/name": 0.0 for role in ("photo", "white", "dark")},
    "/version": 0.0,
    "/capture/shots/pose": 1e-8,
    "/capture/shots/lamp/values": 1e-14,
    "/answer/curves": 1e-12,
    "/answer/std": 1e-12,
    "/answer/channel_gain": 1e-15,
}
"""Unlike those of `camssf parity`: the photo is read on one processor, and nothing is taken over."""
MODELS = ("curves", "std", "code_covariance", "proof", "evidence", "channel_gain")
"""Fields of an answer that are the model's own outputs."""


def check(ours: Json, theirs: Json, *, bits: bool = False) -> None:
    """All differences within their bounds, no field missing; `bits`: the model's own outputs to the last one."""
    with pytest.MonkeyPatch.context() as patched:
        for path, bound in BOUNDS.items():
            patched.setitem(TABLE, path, (row_of(path)[0], of_largest, bound))
        row_of.cache_clear()
        assert [found.words for found in differences(theirs, ours) if not found.agrees] == []
    row_of.cache_clear()
    for name in MODELS if bits else ():
        assert theirs["answer"][name] == ours["answer"][name], name


PHONE_CURVES = CameraCurves("phone", resolve(PHONE), "bells")
Photographed: TypeAlias = tuple[list[SimulatedShot], Floats]


def of_apple(made: Simulation) -> Photographed:
    """The photos say that a phone took them."""
    for shot in made.shots:
        for path in filter(None, (shot.chart, shot.white, shot.dark)):
            path.write_bytes(path.read_bytes().replace(b"camssf\0", b"Apple \0"))
    return list(made.shots), made.pose.corners


@pytest.fixture(scope="module")
def photos(tmp_path_factory: pytest.TempPathFactory) -> Photographed:
    """Corners by a hand, some pixels off."""
    scene = Scene(size=(1200, 900), tilt=6, rotation=4, vignetting=0.2)
    made = simulate("Nikon 5100 (NPL)", ["D55", "A"], tmp_path_factory.mktemp("photos"), seed=11, scene=scene)
    return list(made.shots), made.pose.corners + np.array([[7, -6], [-7, 5], [4, 8], [-5, -7]])


@pytest.fixture(scope="module")
def phone(tmp_path_factory: pytest.TempPathFactory) -> Photographed:
    folder = tmp_path_factory.mktemp("phone")
    return of_apple(simulate(PHONE_CURVES, ["D55", "A"], folder, seed=3, scene=Scene(size=(1200, 900))))


def test_one_shot_is_equal_to_the_last_bit(photos: Photographed, tmp_path: Path, kotlin: Kotlin) -> None:
    """A tabulated lamp: no logarithm or power whose last bit the two languages' libraries round differently.

    And a basis and a lamp's tolerance that are told: what is chosen is mixed outside the model, by sums that each
    language takes its own way.
    """
    shots, corners = photos
    case = Case(shots[:1], [corners], ["D55"], options={"basis": "cameras", "lamp_tolerance": "2%"})
    ours, theirs = python(case), kotlin(case, tmp_path / "result.json")
    assert theirs["verdict"]["status"] == "accepted" or theirs["verdict"]["reasons"]
    check(ours, theirs, bits=True)


BARE: dict[str, Any] = {"white": False, "dark": False}
CAPTURES: dict[str, tuple[str, dict[str, Any], str]] = {
    "kind": ("white-led", {"options": {"chart": "classic24:ohta"}}, ""),
    "twelve": ("D55", {"options": {"basis": "gaussian", "fit": [*range(7, 19)], "l2": 0.01}}, ""),
    "tolerance": ("D55", {"options": {"lamp_tolerance": "300K,1%", "gamma": 0.5, "white_reflectance": 0.9}}, ""),
    # the light's modes stand on the pose, whose last bits are each language's own
    "no frames": ("D55", BARE | {"options": {"basis": "phones"}}, ""),
    "no chart there": ("D55", BARE, "chart_not_found"),
    "a camera in an unnamed light": ("auto", {}, "lamp_unfit"),
}


@pytest.mark.parametrize("name", CAPTURES)
def test_the_document_is_python_s(photos: Photographed, tmp_path: Path, kotlin: Kotlin, name: str) -> None:
    (shots, corners), (lamp, more, code) = photos, CAPTURES[name]
    if name == "no chart there":
        corners = (corners - corners.mean(axis=0)) / 5 + 150
    case = Case(shots[:1], [corners], [lamp], **more)
    ours, theirs = python(case), kotlin(case, tmp_path / "result.json")
    assert not code or [reason["code"] for reason in theirs["verdict"]["reasons"]] == [code]
    check(ours, theirs)


def test_two_shots_of_which_one_is_a_formula(photos: Photographed, tmp_path: Path, kotlin: Kotlin) -> None:
    """And `camssf parity` agrees in every field."""
    shots, corners = photos
    case = Case(shots, [corners, np.roll(corners, 2, axis=0)], ["D55", "2856K"])
    ours, theirs = python(case), kotlin(case, tmp_path / "result.json")
    assert len(ours["answer"]["choice"]) == len(theirs["answer"]["choice"]) == 12  # two lamps a shot, three bases
    check(ours, theirs)
    chart, white, dark = ([getattr(shot, role) for shot in shots] for role in ("chart", "white", "dark"))
    findings = parity(Result.load(tmp_path / "result.json"), chart, white=white, dark=dark)
    assert first(findings) is None, first(findings)
    assert tuple(finding.stage for finding in findings) == STAGES


def test_parity_of_refusals(photos: Photographed, phone: Photographed, tmp_path: Path, kotlin: Kotlin) -> None:
    """A verdict's with its checks, and a stage's with its words, which name a file: in every field."""
    shots, corners = photos
    exchanged = replace(shots[0], white=shots[0].dark, dark=shots[0].white)
    foreign = replace(shots[0], white=phone[0][0].white)
    for shot, lamp, stages in ((exchanged, "D55", 6), (foreign, "D55", 3)):
        case = Case([shot], [corners], [lamp])
        theirs = kotlin(case, tmp_path / "result.json")
        assert theirs["verdict"]["status"] == "refused"
        check(python(case), theirs)
        result = Result.load(tmp_path / "result.json")
        findings = parity(result, shot.chart, white=[shot.white], dark=[shot.dark])
        assert (first(findings), len(findings)) == (None, stages)


@pytest.mark.parametrize("lamps", [["D55", "auto"], ["auto", "auto"]], ids=["one-of-two", "two"])
def test_a_light_that_nobody_named(phone: Photographed, tmp_path: Path, lamps: list[str], kotlin: Kotlin) -> None:
    shots, corners = phone
    case = Case(shots[: len(lamps)], [corners] * len(lamps), lamps)
    ours, theirs = python(case), kotlin(case, tmp_path / "result.json")
    assert theirs["verdict"]["status"] == "accepted"
    assert all(light is not None for light in theirs["answer"]["lights"])  # one that was called by a name, too
    check(ours, theirs)


@pytest.mark.parametrize(("change", "frames"), [(0, False), (16, True)], ids=["same", "changed"])
def test_a_previous_result(phone: Photographed, tmp_path: Path, kotlin: Kotlin, frames: bool, change: int) -> None:
    """Named and framed before, unnamed now; a phone whose blue curve has moved by 8 nm is answered alone."""
    shots, corners = phone
    first = tmp_path / "first.json"
    assert kotlin(Case(shots[:1], [corners], ["D55"]), first)["verdict"]["status"] == "accepted"
    if not change:
        Result.load(first).save(first)  # in Python's spelling
    new = shots[1:]
    if change:
        curves = resolve(PHONE).copy()
        curves[:, 2] = np.roll(curves[:, 2], change)
        moved = CameraCurves("phone", curves, "bells")
        new, corners = of_apple(simulate(moved, "D65", tmp_path, seed=4, scene=Scene(size=(1200, 900))))
    case = Case(new, [corners], ["auto"], white=frames, dark=frames, options={"previous": first})
    ours, theirs = python(case), kotlin(case, tmp_path / "result.json")
    expected = ("doubtful", 1) if change else ("accepted", 2)
    assert (theirs["verdict"]["status"], len(theirs["capture"]["shots"])) == expected
    check(ours, theirs)


@pytest.mark.parametrize("lamps", [["D55", "A"], ["auto"]], ids=["two shots", "unnamed light"])
def test_a_phone_measures_and_a_desktop_solves(
    phone: Photographed, tmp_path: Path, kotlin: Kotlin, lamps: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    """The same curves to the bit as from Python's own measurement, from the document as it is."""
    shots, corners = phone
    case = Case(shots[: len(lamps)], [corners] * len(lamps), lamps, options={"write": "capture"})
    place = tmp_path / "capture.json"
    kotlin.run(case, place)
    theirs = read(place.read_bytes(), Document, place.name, ADVICE).capture
    taken = zip(case.shots, lamps, strict=True)
    ours = measure([Shot(s.chart, lamp, corners=corners, white=s.white, dark=s.dark) for s, lamp in taken])
    assert all(unit.serial == "" for unit in (shot.photo.unit for shot in theirs.shots))
    answers = [solve(capture) for capture in (ours, theirs)]
    for name in ("curves", "std"):
        np.testing.assert_array_equal(getattr(answers[0], name), getattr(answers[1], name))
    assert answers[0].verdict == answers[1].verdict
    assert answers[0].verdict.status == "accepted"
    assert main(["solve", str(place)]) == 0
    solved = read(capsys.readouterr().out.encode(), Document, "solved", ADVICE)
    np.testing.assert_array_equal(answer_in(solved).curves.values, answers[0].curves)


def codes_of(files: Iterable[tuple[str, Path]]) -> list[list[str]]:
    """What Kotlin reads of each file, by its kind, or the error's code and words."""
    lines = "\n".join(json.dumps({"read": kind, "file": str(path)}) for kind, path in files)
    command = ("-Dstdout.encoding=UTF-8", "org.camssf.golden.Calibrate")
    done = subprocess.run(**java(*command, input=lines, encoding="utf-8", timeout=120), capture_output=True)
    return [line.split("\t")[1:] for line in done.stdout.splitlines()]


@pytest.mark.requirement("R-HOSTILE")
def test_damaged_photos_get_the_same_code(tmp_path: Path) -> None:
    """Both read the same samples and levels, or refuse with the same code."""
    paths = [tmp_path / f"{seed}.dng" for seed in range(400)]
    for seed, path in enumerate(paths):
        path.write_bytes(damaged("dng", seed)[1])
    theirs = codes_of(("dng", path) for path in paths)
    apart = []
    for path, (code, *said) in zip(paths, theirs, strict=True):
        try:
            mosaic = read_dng(path)
        except CalibrationError as error:
            if error.code != code:
                apart.append((path.name, error.code, error.message, code, said))
            continue
        samples = hashlib.sha256(mosaic.samples.astype("<u2").tobytes()).hexdigest()
        levels = [mosaic.white, *mosaic.black.ravel()]
        if [code, *said[:2]] != ["read", samples, mosaic.cfa] or not np.allclose(
            levels, [float(v) for v in said[2:]], rtol=1e-12, atol=0
        ):
            apart.append((path.name, "read", samples, code, said))
    assert apart == []
    assert {code for code, *_ in theirs} >= {"read", "unreadable_raw", "unsupported_raw"}


def test_text_tables_get_the_same_code_and_words(tmp_path: Path) -> None:
    files: list[tuple[str, Path]] = []
    expected: list[tuple[str, Any]] = []
    for i, table in enumerate(TABLES.values()):
        path = tmp_path / f"{i}.csv"
        path.write_bytes(table.text.encode())
        files.append((table.kind, path))
        try:
            values = (read_lamp if table.kind == "lamp" else read_chart)(str(path)).values
        except CalibrationError as error:
            expected.append((error.code, error.message.replace(f"{tmp_path}/", "").replace("\t", " ")))
        else:
            expected.append(("read", float(np.mean(values**2))))
    theirs = codes_of(files)
    for name, (code, said), (their_code, their_words) in zip(TABLES, expected, theirs, strict=True):
        if code == "read" == their_code:
            assert float(their_words) == pytest.approx(said, rel=1e-9), name
        else:
            assert (name, their_code, their_words) == (name, code, said)
