"""Cameras by formulas, and a result of two lamps, that the tests of colour share."""

import pickle
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from camssf import Options, Result, calibrate
from camssf.documents.document import document_bytes
from camssf.grid import WAVELENGTHS, Floats
from camssf.spectra import Lamp, read_lamp
from camssf_colour import Camera, picture
from camssf_colour.camera import OwnWhite
from tests.support.captures import shot
from tests.support.problems import bell, toy_camera


def power(name: str = "D55") -> Floats:
    return read_lamp(name).values


def known(name: str = "D55") -> Lamp:
    """The lamp without a tolerance."""
    return replace(read_lamp(name), tolerance=0.0)


def exact(curves: Floats | None = None) -> Camera:
    curves = toy_camera() if curves is None else curves
    return Camera("toy", curves / curves.max(axis=0), np.zeros((0, *curves.shape)))


def blurred(curves: Floats | None = None, size: float = 0.02) -> Camera:
    """With two errors of its curves: red too far right, green too wide."""
    one = exact(curves)
    modes = np.zeros((2, *one.values.shape))
    modes[0, :, 0] = size * np.gradient(one.values[:, 0], WAVELENGTHS) * 40
    modes[1, :, 1] = size * bell(500, 15)
    return replace(one, modes=modes)


def owned(camera: Camera, name: str = "D55") -> Camera:
    """Calibrated under this lamp."""
    raw = power(name) @ camera.values
    return replace(camera, own=OwnWhite(raw / raw[1], read_lamp(name)))


def place(document: Result, patch: int) -> str:
    """A region within a patch, for the command line."""
    outline = document.capture.shots[0].pose.patches[patch]
    x, y = outline.min(axis=0) + 12
    return f"{x:.0f},{y:.0f},56,56"


@pytest.fixture(scope="session")
def of_two_lamps(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    """A folder with result.json, and the result, of the photos under D55 and A."""
    made = calibrate([shot("D55"), shot("A")], options=Options(engine="reference"))
    folder = tmp_path_factory.mktemp("colour")
    (folder / "result.json").write_bytes(document_bytes(made))
    return folder, made


@pytest.fixture(scope="session", autouse=True)
def tables_once() -> Iterator[None]:
    """A picture's table of colours takes most of its time, and most pictures here are in one light."""
    tabulate = picture.tabulate
    by_content = cache(lambda content: tabulate(*pickle.loads(content)))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(picture, "tabulate", lambda *arguments: by_content(pickle.dumps(arguments)))
        yield
