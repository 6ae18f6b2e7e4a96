"""The chart finder on what its benchmark draws; `python -m benchmarks finder` sets OpenCV's beside it."""

from dataclasses import replace

import numpy as np
import pytest

import camssf.photo.find.search as opencv
import camssf.photo.find.search as searching
from benchmarks.claims.finder_drawings import DRAWINGS, EMPTY, Drawing, as_mosaic, as_preview, truth
from camssf.errors import ChartNotFound
from camssf.grid import Floats
from camssf.photo.find.candidates import FoundCharts, find_candidates
from camssf.photo.find.chart_colours import chart_colours
from camssf.photo.find.picture import codes_of_bytes, codes_of_mosaic
from camssf.photo.find.pose import find_chart
from camssf.photo.find.search import OPENCV, OWN, Detector
from camssf.photo.read.dng import read_dng
from camssf.photo.read.raw import read_raw
from tests.photo.test_chart import DNG, SCENES, SMALL, edge, photo_of
from tests.support.scenes import table
from tools import chart_colours as tool


def off(found: Floats, centres: Floats) -> float:
    """Largest distance in pitches."""
    assert found.shape == centres.shape
    pitch = np.linalg.norm(centres[1:] - centres[:-1], axis=1).min()
    return float(np.linalg.norm(found - centres, axis=1).max() / pitch)


def small(drawing: Drawing, size: tuple[int, int] = SMALL) -> Drawing:
    """The same drawing of fewer pixels."""
    return replace(drawing, size=size, blur=drawing.blur * size[0] / drawing.size[0])


def preview(drawing: Drawing) -> FoundCharts:
    return find_candidates(codes_of_bytes(as_preview(small(drawing, (640, 480)))))


@pytest.mark.full
@pytest.mark.parametrize("drawing", DRAWINGS[::3], ids=lambda d: d.name)
def test_drawings_are_found_as_previews(drawing: Drawing) -> None:
    found = preview(drawing)
    centres = truth(replace(drawing, size=(640, 480)))[1]
    assert off(found.candidates[0].patches, centres) < 0.25
    assert found.findings == (("mirrored",) if drawing.mirrored else ())


@pytest.mark.parametrize(
    "drawing",
    [*EMPTY[-1:], *(pytest.param(drawing, marks=pytest.mark.full) for drawing in EMPTY[:-1])],
    ids=lambda d: f"{d.name} {d.seed}",
)
def test_without_a_whole_chart_there_is_none(drawing: Drawing) -> None:
    assert preview(drawing) == FoundCharts((), ("none",))


@pytest.mark.requirement("R-FINDER")
def test_the_real_photo() -> None:
    """Before it is refined within a twentieth of a patch of where the refined pose lies."""
    real = read_dng(DNG / "colorchart.dng")
    real_pose = find_chart(real, table("passport24"))
    found = find_candidates(codes_of_mosaic(real))
    assert len(found.candidates) == 1
    assert off(found.candidates[0].patches, real_pose.patches.mean(axis=1)) < 0.05
    assert find_candidates(codes_of_mosaic(read_dng(DNG / "blackmagic_ljpeg.dng"))).candidates == ()


@pytest.mark.requirement("R-FINDER")
def test_the_real_photo_of_a_whole_chart() -> None:
    """The four corner patches within a twentieth of a pitch of where a person marked their middles."""
    real = read_raw(DNG.parent / "llanos" / "capture.png")
    marked = np.array([[60.0, 58.0], [351.0, 58.2], [74.0, 218.0], [338.5, 223.0]])
    pitch = 56.0
    corners = [0, 5, 18, 23]
    found = find_candidates(codes_of_mosaic(real))
    (candidate,) = found.candidates
    assert candidate.kind == "classic24"
    for centres in (candidate.patches, find_chart(real, table("classic24")).patches.mean(axis=1)):
        assert np.linalg.norm(centres[corners] - marked, axis=1).max() < pitch / 20


@pytest.mark.repository
def test_the_stored_colours_are_what_their_sources_give(capsys: pytest.CaptureFixture[str]) -> None:
    assert tool.main(["--check"]) == 0, capsys.readouterr()
    assert [len(kind.colours) for kind in chart_colours()] == [24, 140]


def find_nothing(monkeypatch: pytest.MonkeyPatch, *detectors: Detector) -> None:
    if OWN in detectors:
        monkeypatch.setattr(searching, "find_candidates", lambda *_: FoundCharts((), ("none",)))
    if OPENCV in detectors:
        monkeypatch.setattr(opencv, "_quads", lambda *_: [])


@pytest.mark.parametrize("blind", [OWN, OPENCV], ids=lambda d: d.name)
def test_where_one_finds_nothing_the_other_does(blind: Detector, monkeypatch: pytest.MonkeyPatch) -> None:
    frames, photo = photo_of(*SCENES["rotated, tilted, cast"], size=SMALL)
    both = find_chart(photo, table())
    find_nothing(monkeypatch, blind)
    pose = find_chart(photo, table())
    assert ["own finder did not" in note for note in pose.notes] == ([True] if blind is OWN else [])
    assert np.abs(pose.patches - both.patches).max() < 0.001 * edge(frames.pose)


@pytest.mark.parametrize("blind", [OWN, OPENCV], ids=lambda d: d.name)
def test_a_mirrored_chart_that_only_one_finds_is_refused_as_mirrored(
    blind: Detector, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawing = small(next(d for d in DRAWINGS if d.mirrored))
    find_nothing(monkeypatch, blind)
    with pytest.raises(ChartNotFound, match="mirrored"):
        find_chart(as_mosaic(drawing), table())
