"""The chart finder on rendered scenes, real photos, and what its benchmark draws beside OpenCV's."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import camssf.photo.find.search as search
from benchmarks.claims.finder_drawings import DRAWINGS, EMPTY, Drawing, as_mosaic, as_preview, truth
from camssf.errors import Blurred, ChartNotFound, InvalidArgument
from camssf.grid import Floats
from camssf.photo.find.candidates import FoundCharts, find_candidates
from camssf.photo.find.chart_colours import chart_colours
from camssf.photo.find.picture import codes_of_bytes, codes_of_mosaic
from camssf.photo.find.pose import Pose, find_chart
from camssf.photo.find.search import OPENCV, OWN, Detector
from camssf.photo.patches import measure_patches
from camssf.photo.read.dng import Mosaic, read_dng
from camssf.photo.read.raw import read_raw
from camssf.spectra import read_camera, read_lamp
from camssf.spectra.layouts import LAYOUTS
from camssf_lab.simulation.camera import Sensor
from camssf_lab.simulation.scene import Scene
from camssf_lab.simulation.shot import Frames, photograph
from tests.support.scenes import SIZE, mosaic, shoot, table
from tools import chart_colours as tool

DNG = Path(__file__).parents[2] / "data" / "dng"

# Read off an enlarged picture of the photo by eye: outer corners of the classic page's block of patches.
BY_EYE = np.array([[672, 586], [1297, 571], [1303, 963], [655, 976]], dtype=float)

BULB = Sensor(gains=(1, 0.6, 0.15))
TURNED = {f"rotated {angle}": Scene(fill=0.5, rotation=angle) for angle in (30, 45, 90)}
TILTED = {f"tilted {angle}": Scene(tilt=angle) for angle in (30, 45, 55)}
NEUTRAL = TURNED | TILTED | {
    "frontal": Scene(), "25 % of the width": Scene(fill=0.25), "12 % of the width": Scene(fill=0.12),
    "rotated 180": Scene(rotation=180), "50 % vignetting": Scene(fill=0.8, vignetting=0.5),
    "white surround": Scene(surround="white"), "black surround": Scene(surround="black"),
}  # fmt: skip
SCENES: dict[str, tuple[Scene, Sensor, str]] = {name: (scene, Sensor(), "D55") for name, scene in NEUTRAL.items()} | {
    "orange cast": (Scene(), BULB, "A"),
    "blue cast": (Scene(), Sensor(gains=(0.15, 0.5, 1)), "D75"),
    "-3 EV": (Scene(), Sensor(exposure=0.1), "D55"),
    "3 % noise": (Scene(), Sensor(full_well=1100), "D55"),
    "rotated, tilted, cast": (Scene(fill=0.5, rotation=200, tilt=35, surround="white"), BULB, "A"),
}
SMALL = (900, 675)


def photo_of(
    scene: Scene, sensor: Sensor | None = None, lamp: str = "D55", size: tuple[int, int] = SIZE
) -> tuple[Frames, Mosaic]:
    frames = shoot(replace(scene, size=size), sensor or Sensor(), lamp)
    return frames, mosaic(frames.chart, sensor)


def edge(pose: Pose) -> float:
    """Shortest patch edge, px."""
    return float(np.linalg.norm(pose.patches - np.roll(pose.patches, -1, axis=1), axis=2).min())


def worst(pose: Pose, truth: Pose) -> float:
    """Largest distance of a patch centre from the truth, in patch edges."""
    off = pose.patches.mean(axis=1) - truth.patches.mean(axis=1)
    return float(np.linalg.norm(off, axis=1).max()) / edge(truth)


@pytest.fixture(scope="module")
def real() -> Mosaic:
    return read_dng(DNG / "colorchart.dng")


@pytest.fixture(scope="module")
def real_pose(real: Mosaic) -> Pose:
    return find_chart(real, table("passport24"))


def test_real_photo_lies_where_the_eye_sees_it(real_pose: Pose) -> None:
    assert np.abs(real_pose.corners - BY_EYE).max() < 4  # of 88 px a patch; the eye is good to 2 px
    assert (real_pose.quarter_turns, real_pose.method) == (0, "detected")
    assert real_pose.score > 0.9


@pytest.mark.full
@pytest.mark.requirement("R-FINDER")
@pytest.mark.parametrize("name", SCENES)
def test_a_rendered_chart_is_found(name: str) -> None:
    """By camssf's own finder within a tenth of a patch; once refined within 3 %, and the right way up."""
    scene, sensor, lamp = SCENES[name]
    frames, photo = photo_of(scene, sensor, lamp, SMALL if scene.fill > 0.2 else SIZE)
    candidates = find_candidates(codes_of_mosaic(photo))
    assert candidates.findings == ()
    apart = candidates.candidates[0].patches - frames.pose.patches.mean(axis=1)
    assert np.linalg.norm(apart, axis=1).max() < 0.1 * edge(frames.pose)
    pose = find_chart(photo, table())
    assert worst(pose, frames.pose) < 0.03
    assert pose.quarter_turns == frames.pose.quarter_turns or name == "rotated 45"  # which rounds either way


@pytest.mark.parametrize("chart", ["nano24", "mini24", "passport24"])
def test_small_charts(chart: str) -> None:
    frames = shoot(Scene(layout=LAYOUTS[chart], size=SMALL, fill=0.4, rotation=-20), None, "D55", chart)
    assert worst(find_chart(mosaic(frames.chart), table(chart)), frames.pose) < 0.03


def test_a_photo_too_blurred_to_search_is_called_blurred() -> None:
    _, photo = photo_of(Scene(fill=0.25, rotation=30, tilt=20, blur=10.0), size=SMALL)
    with pytest.raises(Blurred, match="sharpest edges are"):
        find_chart(photo, table())


def test_of_two_charts_the_one_that_agrees() -> None:
    """Left a chart in another order, right the real one; each is found by its own table."""
    scene = Scene(size=(450, 675), fill=0.7)
    mixed = table().with_values(table().values[np.random.default_rng(3).permutation(24)])
    camera, lamp = read_camera("Nikon 5100 (NPL)"), read_lamp("D55")
    left, right = (photograph(camera, lamp, t, scene, Sensor()) for t in (mixed, table()))
    photo = mosaic(np.hstack([left.chart, right.chart]))
    pose = find_chart(photo, table())
    assert worst(replace(pose, patches=pose.patches - np.array([450, 0])), right.pose) < 0.02
    assert pose.notes == ()
    pose = find_chart(photo, mixed)  # the finder knows the real chart only
    assert worst(pose, left.pose) < 0.02
    other, detector = pose.notes
    assert "second grid of patches was in view, about (675, 337) px" in other
    assert "OpenCV's detector found the chart" in detector


def test_table_of_another_layout() -> None:
    _, photo = photo_of(Scene(), size=SMALL)
    with pytest.raises(InvalidArgument, match="does not fit the layout sg140"):
        find_chart(photo, replace(table(), layout=LAYOUTS["sg140"]))


def test_real_photo_gives_the_means_of_hand_picked_corners(real: Mosaic, real_pose: Pose) -> None:
    """Bilinear places between four corners read by eye, plain means of 36 × 32 px boxes, LibRaw's samples."""
    import rawpy

    with rawpy.imread(str(DNG / "colorchart.dng")) as raw:
        above_black = raw.raw_image_visible.astype(float) - raw.black_level_per_channel[0]
    means = measure_patches(real, real_pose)
    side = 12.4 / 15
    for number in range(24):
        column, row = number % 6, number // 6
        s, t = (column + side / 2) / (5 + side), (row + side / 2) / (3 + side)
        corner = [(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t]
        x, y = np.rint(np.array(corner) @ BY_EYE / 2).astype(int) * 2
        box = above_black[y - 16 : y + 16, x - 18 : x + 18]
        green = (box[::2, 1::2].mean() + box[1::2, ::2].mean()) / 2
        theirs = [box[::2, ::2].mean(), green, box[1::2, 1::2].mean()]
        np.testing.assert_allclose(means.chart.mean[number] - means.black, theirs, rtol=0.03)


# -- as the benchmark draws it --------------------------------------------------------------------------------------


def off(found: Floats, centres: Floats) -> float:
    assert found.shape == centres.shape
    pitch = np.linalg.norm(centres[1:] - centres[:-1], axis=1).min()
    return float(np.linalg.norm(found - centres, axis=1).max() / pitch)


def small(drawing: Drawing, size: tuple[int, int] = SMALL) -> Drawing:
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
def test_the_real_photo(real: Mosaic, real_pose: Pose) -> None:
    """Before it is refined within a twentieth of a patch of where the refined pose lies."""
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
        monkeypatch.setattr(search, "find_candidates", lambda *_: FoundCharts((), ("none",)))
    if OPENCV in detectors:
        monkeypatch.setattr(search, "_quads", lambda *_: [])


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
