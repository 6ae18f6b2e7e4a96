"""Layouts of the user's own: the file, the table that belongs to it, and such a chart in a photo."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camssf.errors import ChartNotFound, InvalidArgument
from camssf.grid import WAVELENGTHS
from camssf.photo.capture import measure
from camssf.photo.find.geometry import block_corners, homography, map_points
from camssf.photo.find.pose import Pose, find_chart
from camssf.photo.read.dng import read_dng
from camssf.spectra import ChartTable, read_chart
from camssf.spectra.layouts import layout_from, read_layout
from camssf_lab.simulation.frames import simulate
from camssf_lab.simulation.scene import Scene, true_pose
from tests.spectra.test_spectra import columns
from tests.support.captures import capture_in, document_of

CARD: dict[str, Any] = {
    "format": "camssf-layout/1", "name": "garden card", "columns": 7, "rows": 5, "patch": [18, 12], "gap": [3, 2],
    "white": "p19", "fiducials": [[-9, -9], [153, -9], [153, 77], [-9, 77]],
}  # fmt: skip


def table_text(count: int) -> str:
    """Reflectances of patches mixed from the 24 of a ColorChecker, as a CSV file."""
    i, nodes = np.arange(count), np.arange(400, 701, 20)
    share, known = 37 * i[:, None] % 100 / 100, read_chart("classic24").values[:, np.isin(WAVELENGTHS, nodes)]
    mixed = (1 - share) * known[i % 24] + share * known[(7 * i + 5) % 24]
    return columns([f"p{number + 1}" for number in i], mixed.round(4), nodes)


def write_card(folder: Path, **fields: Any) -> str:
    """A layout file and its table in `folder`, as a chart's specification."""
    document = {key: value for key, value in (CARD | fields).items() if value is not None}
    (folder / "card.json").write_text(json.dumps(document))
    (folder / "mine.csv").write_text(table_text(35))
    return f"{folder / 'card.json'}:{folder / 'mine.csv'}"


def photographed(folder: Path, chart: str, **scene: Any) -> tuple[ChartTable, Scene]:
    table = read_chart(chart)
    drawn = Scene(size=(1500, 1100), fill=0.5, **scene)
    simulate("Canon EOS 600D", "D55", folder, chart=table, scene=drawn)
    return table, replace(drawn, layout=table.layout)


def worst(found: Pose, true: Pose) -> float:
    """Largest distance of a patch's corner from the truth, in widths of the first patch."""
    width = np.linalg.norm(true.patches[0][1] - true.patches[0][0])
    return float(np.linalg.norm(found.patches - true.patches, axis=2).max() / width)


def test_a_layout_file() -> None:
    layout = layout_from(CARD, "card.json")
    assert (layout.name, layout.columns, layout.rows, layout.white) == ("garden card", 7, 5, "p19")
    assert layout.side == pytest.approx((18 / 21, 12 / 14))
    assert layout.fiducials[0] == pytest.approx((-18 / 21, -15 / 14))
    again = layout_from(layout.document(), "again")
    assert again.side == pytest.approx(layout.side)
    np.testing.assert_allclose(again.fiducials, layout.fiducials)
    assert layout_from(CARD | {"patch": 5, "gap": 0}, "card.json").side == (1, 1)


DAMAGED: dict[str, tuple[dict[str, Any], str]] = {
    "another format": ({"format": "camssf-layout/2"}, '"format"'),
    "a field too many": ({"colums": 6}, 'no field "colums"'),
    "a name of ours": ({"name": "SG140"}, "shipped layout"),
    "a name that is a path": ({"name": "../card"}, '"name"'),
    "half a column": ({"columns": 6.5}, '"columns"'),
    "one row": ({"rows": 1}, '"rows"'),
    "too few patches": ({"columns": 3, "rows": 3}, "9 patches"),
    "a patch of no size": ({"patch": [18, 0]}, '"patch"'),
    "a gap below nothing": ({"gap": -1}, '"gap"'),
    "wide gaps": ({"gap": 20}, "too wide"),
    "a white patch by number": ({"white": 19}, '"white"'),
    "fiducials the other way round": ({"fiducials": CARD["fiducials"][::-1]}, '"fiducials"'),
    "fiducials inside": ({"fiducials": [[9, 9], [90, 9], [90, 50], [9, 50]]}, '"fiducials"'),
}


@pytest.mark.parametrize(("fields", "match"), DAMAGED.values(), ids=DAMAGED)
def test_damaged_layouts(fields: dict[str, Any], match: str, tmp_path: Path) -> None:
    write_card(tmp_path, **fields)
    with pytest.raises(InvalidArgument, match=match) as error:
        read_layout(tmp_path / "card.json")
    assert "card.json: " in error.value.message
    assert "docs/tables.md" in error.value.advice


@pytest.mark.parametrize("text", ["", "[", "[]", "7", "null", '{"rows": NaN}', '{"rows": 4, "rows": 5}', "[" * 5000])
def test_files_that_are_no_layout(text: str, tmp_path: Path) -> None:
    path = tmp_path / "card.json"
    path.write_text(text)
    with pytest.raises(InvalidArgument, match=r"card\.json"):
        read_layout(path)
    with pytest.raises(InvalidArgument, match="There is no file"):
        read_layout(tmp_path / "other.json")


def test_a_table_for_the_layout(tmp_path: Path) -> None:
    chart = read_chart(write_card(tmp_path))
    assert (len(chart.patches), chart.white, chart.patches[18]) == (35, 18, "p19")
    assert chart.tolerance[0] == 0.01
    brightest = read_chart(write_card(tmp_path, white=None))
    assert brightest.white != 18
    spec = write_card(tmp_path, white="E5")
    with pytest.raises(InvalidArgument, match="no patch 'E5'"):
        read_chart(spec)
    (tmp_path / "mine.csv").write_text(table_text(24))
    with pytest.raises(InvalidArgument, match="holds 24 patches, garden card has 35"):
        read_chart(spec)
    with pytest.raises(InvalidArgument, match="holds a layout") as error:
        read_chart(tmp_path / "card.json")
    assert "card.json:mine.csv" in error.value.advice


@pytest.fixture(scope="module")
def card(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str, ChartTable, Scene]:
    folder = tmp_path_factory.mktemp("card")
    spec = write_card(folder)
    return folder, spec, *photographed(folder, spec, rotation=110, tilt=20)


@pytest.mark.parametrize("first", [0, 3])
def test_such_a_chart_is_found_and_corners_by_hand_may_be_the_fiducials(
    card: tuple[Path, str, ChartTable, Scene], first: int
) -> None:
    folder, _, table, scene = card
    true = true_pose(scene)
    photo = read_dng(folder / "chart.dng")
    found = find_chart(photo, table)
    assert worst(found, true) < 0.02
    assert (found.layout, found.quarter_turns, found.method) == ("garden card", 1, "detected")
    block = block_corners(table.layout, table.layout.side)
    places = map_points(homography(block, true.corners), np.array(table.layout.fiducials))
    marks = np.roll(places, -first, axis=0)
    for corners in (marks + 2.0, marks[::-1] - 2.0, np.roll(true.corners, first, axis=0)):
        pose = find_chart(photo, table, corners=corners)
        assert worst(pose, true) < 0.02
        assert not pose.notes


def test_patches_without_gaps_need_corners(tmp_path: Path) -> None:
    table, scene = photographed(tmp_path, write_card(tmp_path, gap=0, fiducials=None))
    photo, true = read_dng(tmp_path / "chart.dng"), true_pose(scene)
    with pytest.raises(ChartNotFound, match="no chart"):
        find_chart(photo, table)
    assert worst(find_chart(photo, table, corners=true.corners + 3), true) < 0.05


def test_the_document_keeps_the_layout(card: tuple[Path, str, ChartTable, Scene]) -> None:
    folder, spec, table, _ = card
    capture = measure(folder / "chart.dng", "D55", chart=spec)
    document = document_of(capture)
    layout = document["capture"]["chart"]["layout"]
    assert layout["name"] == "garden card"
    again = capture_in(document)
    assert again.chart.layout == table.layout
    assert document_of(again) == document
    for damage in ({"columns": 5}, {"name": "other"}, {"format": "x"}):
        document["capture"]["chart"]["layout"] = layout | damage
        with pytest.raises(InvalidArgument):
            capture_in(document)
