"""Photos of two physical cameras or lenses are refused, as far as their files say."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from camssf.errors import InvalidArgument, UnitDiffers
from camssf.photo.capture import Capture, check_alike, measure
from camssf.photo.patches import measure_patches
from camssf.photo.read.dng import read_dng
from camssf.photo.read.unit import Unit, check_unit
from tests.support.captures import capture_in, document_of, photos, shot

WIDE = Unit("Maker", "Phone", "0", "S1", "12ab", "Phone wide 6.8 mm", 6.81, 1.85)
AREA = (0, 0, 3000, 4000)


@pytest.mark.parametrize(("change", "words"), [
    ({"camera_id": "2"}, "camera '2' against '0'"), ({"serial": "S2"}, "another serial number"),
    ({"serial": "", "serial_check": "12ac"}, "another serial number"),
    ({"lens": "Phone tele"}, "lens 'Phone tele' against 'Phone wide 6.8 mm'"),
    ({"focal_length": 19.0}, "focal length 19 mm against 6.81 mm"),
    ({"aperture": 2.8}, "aperture f/2.8 against f/1.85"),
])  # fmt: skip
def test_what_differs_is_named(change: dict[str, Any], words: str) -> None:
    with pytest.raises(UnitDiffers, match=words) as refusal:
        check_unit("a.dng", (WIDE, AREA), "b.dng", (replace(WIDE, **change), AREA))
    assert (refusal.value.code, refusal.value.exit_status) == ("unit_differs", 5)
    assert refusal.value.message.startswith("b.dng was taken by another camera or lens than a.dng: ")
    assert "S2" not in refusal.value.message
    assert "one physical camera" in refusal.value.advice
    silent = dict.fromkeys(change, None if isinstance(next(iter(change.values())), float) else "")
    check_unit("a.dng", (WIDE, AREA), "b.dng", (replace(WIDE, **silent), AREA))
    check_unit("a.dng", (replace(WIDE, **silent), None), "b.dng", (replace(WIDE, **change), AREA))


def test_the_active_area_and_what_files_round() -> None:
    with pytest.raises(UnitDiffers, match="active area 8, 8, 3008, 4008 against 0, 0, 3000, 4000"):
        check_unit("a.dng", (WIDE, AREA), "b.dng", (WIDE, (8, 8, 3008, 4008)))
    check_unit("a.dng", (WIDE, AREA), "b.dng", (replace(WIDE, aperture=1.86, focal_length=6.8), AREA))


@pytest.fixture(scope="module")
def found() -> Capture:
    return measure([shot("D55"), shot("A")])


def test_shots_and_frames_are_held_to_it(found: Capture) -> None:
    one, two = found.shots
    check_alike([one, two])
    other = replace(two, photo=replace(two.photo, unit=replace(two.photo.unit, camera_id="3", focal_length=9.0)))
    check_alike([one, other])  # the first says nothing of either
    with pytest.raises(UnitDiffers, match=r"camera '3' against '1'"):
        check_alike([replace(one, photo=replace(one.photo, unit=Unit(camera_id="1"))), other])
    photo = read_dng(photos("D55").shots[0].chart)
    assert photo.active_area == (0, 0, *photo.samples.shape)
    tele = replace(photo, path="w.dng", unit=Unit(lens="tele"))
    words = r"The white frame w\.dng was taken by another camera or lens than the chart"
    with pytest.raises(UnitDiffers, match=words):
        measure_patches(replace(photo, unit=Unit(lens="wide")), one.pose, white=tele)


def test_the_document_keeps_it_but_for_the_serial_number(found: Capture) -> None:
    one, two = found.shots
    shots = (replace(one, photo=replace(one.photo, unit=replace(WIDE, make="", model=""))), two)
    document = document_of(replace(found, shots=shots))
    again = capture_in(document)
    assert again.shots[0].photo.unit == replace(WIDE, make="", model="", serial="")
    assert again.shots[0].photo.active_area == one.photo.active_area
    assert "S1" not in json.dumps(document)
    photo = document["capture"]["shots"][1]["photo"]
    photo["unit"] = {"camera_id": "2"}
    with pytest.raises(InvalidArgument, match=r"camera '2' against '0'"):
        capture_in(document)
    for broken in ({"camera_id": 2}, {"focal_length": -1}, {"serial_check": "S1"}, {"other": ""}, "unit"):
        photo["unit"] = broken
        with pytest.raises(InvalidArgument, match=r"capture\.shots\[1\]\.photo\.unit"):
            capture_in(document)
    photo.pop("unit"), photo.pop("active_area")  # of a file that names neither
    assert np.array_equal(capture_in(document).shots[1].means.chart.mean, two.means.chart.mean)
