"""The chart finder on what its benchmark draws; `python -m benchmarks finder` sets OpenCV's beside it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

import camssf.photo.find.search as opencv
import camssf.photo.find.search as searching
from benchmarks.claims.finder_drawings import DRAWINGS, EMPTY, Drawing, as_mosaic, as_preview, truth
from camssf.errors import ChartNotFound, InvalidArgument
from camssf.grid import Floats
from camssf.photo.find.candidates import FoundCharts, find_candidates
from camssf.photo.find.chart_colours import chart_colours
from camssf.photo.find.lattices import fitted, inverse, mapped
from camssf.photo.find.picture import Thumbnail, codes_of_bytes, codes_of_light, codes_of_mosaic, rgb_of_yuv
from camssf.photo.find.pose import find_chart
from camssf.photo.find.search import OPENCV, OWN, SURE, Detector, matches_in, plain_signals
from camssf.photo.read.dng import Mosaic, read_dng
from camssf.photo.read.raw import read_raw
from camssf.spectra.layouts import LAYOUTS, ChartLayout
from camssf_lab.simulation.camera import Sensor
from golden.drawing import draw, turned
from golden.stages.finder import keys_beside
from tests.photo.test_chart import DNG, SCENES, SMALL, edge, photo_of
from tests.support.scenes import mosaic, table
from tools import chart_colours as tool

GOLDEN = Sensor(black=256, white_level=15000)
"""Of the golden drawings."""


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


@pytest.mark.parametrize("drawing", EMPTY, ids=lambda d: f"{d.name} {d.seed}")
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


def test_two_charts_are_said_to_be_two() -> None:
    left = as_preview(Drawing("left", fill=0.8, size=(320, 480), blur=0.4))
    right = as_preview(Drawing("right", fill=0.7, size=(320, 480), turn=180, blur=0.4))
    found = find_candidates(codes_of_bytes(np.hstack([left, right])))
    assert found.findings == ("two_charts",)
    assert len(found.candidates) == 2


def test_two_charts_in_one_raster_are_two() -> None:
    """Each keeps its own patches: the larger of the two is not taken twice, and the other not lost."""
    row = np.concatenate([draw(turned(24, 0, margin=36)) for _ in range(2)], axis=1)
    found = find_candidates(codes_of_mosaic(mosaic(row, GOLDEN)))
    assert found.findings == ("two_charts",)


def test_a_keyboard_that_reaches_the_board_does_not_hide_the_chart() -> None:
    """Growth runs from a key into the patches; those that the keys' lattice then leaves out are free again."""
    found = find_candidates(codes_of_mosaic(mosaic(keys_beside(), GOLDEN)))
    assert [(candidate.kind, candidate.blobs > 20) for candidate in found.candidates] == [("classic24", True)]


def test_a_chart_of_other_colours_is_none() -> None:
    mixed = np.random.default_rng(3).permutation(24)
    shown = as_preview(Drawing("mixed", fill=0.5, size=(640, 480), blur=0.4))
    corners = truth(Drawing("mixed", fill=0.5, size=(640, 480)))[1].round().astype(int)
    patch = shown[corners[:, 1], corners[:, 0]]
    for place, other in enumerate(mixed):
        x, y = corners[place]
        shown[y - 20 : y + 21, x - 20 : x + 21] = patch[other]
    assert find_candidates(codes_of_bytes(shown)).findings == ("none",)


def test_forms_of_one_picture_agree() -> None:
    drawing = Drawing("forms", fill=0.5, turn=20, size=(640, 480), blur=0.4)
    shown = as_preview(drawing)
    red, green, blue = (shown[..., c].astype(np.float64) for c in range(3))
    y = 0.299 * red + 0.587 * green + 0.114 * blue
    u, v = (np.rint(128 + part)[::2, ::2].astype(np.uint8) for part in ((blue - y) / 1.772, (red - y) / 1.402))
    back = rgb_of_yuv(np.rint(y).astype(np.uint8), u, v)
    assert np.median(np.abs(back.astype(int) - shown)) <= 4  # chroma of every second pixel, and its noise
    centres = truth(drawing)[1]
    light = (shown / 255.0) ** 2.2
    for codes in (codes_of_bytes(back), codes_of_light(light), codes_of_light(light[..., 1]), codes_of_bytes(shown)):
        assert off(find_candidates(codes).candidates[0].patches, centres) < 0.05


def test_a_larger_picture_is_reduced_and_its_points_are_its_own() -> None:
    drawing = Drawing("large", fill=0.4, turn=70, size=(1300, 800))
    codes = codes_of_bytes(as_preview(drawing))
    assert codes.step == 2
    assert max(codes.values.shape) == 650
    assert off(find_candidates(codes).candidates[0].patches, truth(drawing)[1]) < 0.02


@pytest.mark.parametrize("shape", [(31, 100), (100, 100, 2), (100,)])
def test_what_is_no_picture(shape: tuple[int, ...]) -> None:
    with pytest.raises(InvalidArgument, match="picture"):
        codes_of_bytes(np.zeros(shape, np.uint8))


def test_a_black_picture_and_one_that_is_not_finite() -> None:
    assert find_candidates(codes_of_light(np.zeros((64, 64, 3)))).findings == ("none",)
    assert find_candidates(codes_of_light(np.full((64, 64), np.nan))).findings == ("none",)


def test_a_fitted_homography_gives_its_points_back() -> None:
    h = (40.0, 3.0, 100.0, -2.0, 38.0, 80.0, 0.01, -0.02, 1.0)
    pairs = [(float(u), float(v), *mapped(h, u, v)) for u in range(6) for v in range(4)]
    again = fitted(pairs)
    assert again is not None
    for u, v, x, y in pairs:
        np.testing.assert_allclose(mapped(again, u, v), (x, y), atol=1e-9)
        np.testing.assert_allclose(mapped(inverse(again), x, y), (u, v), atol=1e-9)
    assert fitted([(float(u), 0.0, 10.0 * u, 5.0) for u in range(9)]) is None  # a line fixes none


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


def test_where_neither_finds_one_it_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    _, photo = photo_of(*SCENES["frontal"], size=SMALL)
    find_nothing(monkeypatch, OWN, OPENCV)
    with pytest.raises(ChartNotFound, match="no chart"):
        find_chart(photo, table())


@pytest.mark.parametrize(("agrees", "attempts"), [(True, 0), (False, 1)])
def test_opencv_proposes_only_where_the_finder_is_not_sure(agrees: bool, attempts: int) -> None:
    """In its first attempt it finds the same chart, which ends the search."""
    drawing = next(d for d in DRAWINGS if d.name == ("40 % wide, checks" if agrees else "shade 0.25, plain"))
    made = []

    def counted(photo: Mosaic, layout: ChartLayout, expected: Floats) -> Iterator[tuple[Thumbnail, list[Floats]]]:
        for attempt in OPENCV.proposals(photo, layout, expected):
            made.append(attempt)
            yield attempt

    detectors = (OWN, replace(OPENCV, proposals=counted))
    matches = matches_in(as_mosaic(small(drawing)), LAYOUTS["classic24"], plain_signals(table()), detectors)
    assert len(made) == attempts
    assert (matches[0].score >= SURE) == agrees
    for match in matches:
        np.testing.assert_allclose(match.corners, matches[0].corners, atol=0.01)


def test_a_second_chart_is_noted() -> None:
    row = np.concatenate([draw(turned(24, turns, margin=36)) for turns in (0, 2)], axis=1)
    pose = find_chart(mosaic(row, GOLDEN), table())
    assert [note.partition(",")[0] for note in pose.notes] == ["A second grid of patches was in view"]
