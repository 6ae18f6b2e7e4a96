"""Which known camera a result is most like: distances by hand, and what is refused."""

import copy
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from documents import document, refused

from camssf import cli
from camssf.documents.result_json import document_bytes
from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS, Floats
from camssf.report.nearest import TABLE, likenesses, nearest
from camssf.spectra import camera_names, read_camera, shipped_cameras
from camssf.spectra.cameras import DEMO_PHONE

NAMES = ("red", "green", "blue")


def result(values: Floats, std: Floats) -> dict[str, Any]:
    given = copy.deepcopy(document("D55"))
    for key, table in (("ssf", values), ("ssf_std", std)):
        given[key] |= {name: table[:, c].tolist() for c, name in enumerate(NAMES)}
    return given


def on_grid(nodes: Floats) -> Floats:
    return np.stack([np.interp(WAVELENGTHS, WAVELENGTHS[::10], nodes[:, c]) for c in range(3)], axis=1)


def test_a_known_camera_is_nearest_to_itself() -> None:
    for name in ("Canon EOS 5D", "Nikon D850", "Hasselblad L1D-20c"):
        values = on_grid(shipped_cameras()[name])
        first, *others = nearest(result(values, np.full(values.shape, 0.01)))
        assert (first.name, first.maker) == (name, name.split()[0])
        assert (first.distance, first.rms) == (0.0, 0.0)
        assert len(others) == 51
        distances = [each.distance for each in others]
        assert distances == sorted(distances)
        assert distances[0] > 0.2


def test_a_distance_is_that_of_the_docstring() -> None:
    """A curve .05 off everywhere, with a band of .03 in red, .01 in green, none in blue."""
    nodes = shipped_cameras()["Canon EOS 5D"]
    values = on_grid(nodes) + 0.05
    std = np.broadcast_to([0.03, 0.01, 0.0], values.shape)
    found = {each.name: each for each in likenesses(values, std, None)}["Canon EOS 5D"]
    expected = np.sqrt(np.mean([0.05**2 / (band**2 + TABLE**2) for band in (0.03, 0.01, 0.0)]))
    assert found.distance == pytest.approx(expected, rel=1e-12)
    assert found.rms == pytest.approx(0.05, rel=1e-12)
    assert found.whole is None


def test_the_whole_covariance_forgives_what_it_knows_of() -> None:
    """Of one mode, by Sherman and Morrison: along the very difference, and across it."""
    nodes = shipped_cameras()["Nikon D70"]
    off = 0.03 * np.sin(WAVELENGTHS / 30.0)[:, None] * np.array([1.0, 0.0, -1.0])
    values = on_grid(nodes) + off
    for mode in (2.0 * off, np.gradient(off, axis=0)):
        along = float(np.sum(mode[::10] * off[::10]) / np.sqrt(np.sum(mode[::10] ** 2) * np.sum(off[::10] ** 2)))
        d, length = np.sum(off[::10] ** 2), np.sum(mode[::10] ** 2)
        left = d / TABLE**2 * (1 - along**2 * length / (TABLE**2 + length))
        found = {each.name: each for each in likenesses(values, np.zeros(values.shape), mode[None])}["Nikon D70"]
        assert found.whole == pytest.approx(np.sqrt(left / 207), rel=1e-9)


def test_modes_that_are_independent_are_bands() -> None:
    rng = np.random.default_rng(1)
    values = on_grid(shipped_cameras()["Nikon D70"])
    std = 0.01 + 0.03 * rng.random(values.shape)
    modes = np.zeros((207, 681, 3))
    for i, (node, channel) in enumerate(np.ndindex(69, 3)):
        modes[i, 10 * node, channel] = std[10 * node, channel]
    for each in likenesses(values, std, modes):
        assert each.whole == pytest.approx(each.distance, rel=1e-9, abs=1e-12)


def test_a_refused_result_and_one_without_bands_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(InvalidArgument, match="refused"):
        nearest(refused(shots=True))
    with pytest.raises(InvalidArgument, match="no bands"):
        nearest(document("D55") | {"ssf_std": None})
    path = tmp_path / "refused.json"
    path.write_bytes(document_bytes(refused()))
    assert cli.main(["cameras", "--nearest", str(path)]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert "was refused" in said.err


def test_the_command_lists_names_makers_and_sources(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["cameras"]) == 0
    rows = [line.split("\t") for line in capsys.readouterr().out.splitlines()]
    assert [row[0] for row in rows] == list(camera_names())
    assert len([row for row in rows if row[2] == "rawtoaces-data 1.1.0, Apache-2.0"]) == 52
    assert rows[-2] == ["Sigma SDMerill (NPL)", "Sigma", "colour-science"]
    assert rows[-1] == [DEMO_PHONE, "Demo", "a draw from the basis phones, no known phone"]
    for name, maker, source in rows:
        assert name.startswith(maker)
        assert source in read_camera(name).source


def test_the_command_says_which_is_nearest(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = result(on_grid(shipped_cameras()["Sony ILCE-9"]), np.full((681, 3), 0.02))
    path = tmp_path / "result.json"
    path.write_bytes(document_bytes(given))
    assert cli.main(["cameras", "--nearest", str(path), "--count", "2"]) == 0
    said = capsys.readouterr()
    found = json.loads(said.out)
    assert found["format"] == "camssf-nearest/1"
    assert found["result"]["verdict"] == given["verdict"]["status"]
    assert found["cameras"][0]["name"] == "Sony ILCE-9"
    assert len(found["cameras"]) == 2
    assert found["cameras"][0]["whole"] is None
    assert set(found["cameras"][0]) == {"name", "maker", "source", "distance", "whole", "rms"}
    assert "Sony ILCE-9: RMS difference 0.0 % of the peak, 0.00 times the uncertainty" in said.err
