"""Pictures in standard colour: against LibRaw, Pillow and littleCMS, `standard_colour`, and the noise itself."""

import io
import json
from dataclasses import replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rawpy
import tifffile
from PIL import Image, ImageCms, ImageOps

from camssf.colorimetry import delta_e00, lab, signals_of, white_of
from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS, Floats
from camssf.photo.read.colour_matrix import ColourMatrix
from camssf.photo.read.dng import Mosaic
from camssf.recovery.basis import read_basis
from camssf.recovery.onnx_model import onnx_runtime
from camssf.spectra import read_chart, read_lamp
from camssf.spectra.bundled import observer
from camssf_colour import Camera, Reference, View, standard_colour
from camssf_colour.camera import OwnWhite
from camssf_colour.demosaic import demosaic, interleaved, noise_shares
from camssf_colour.picture import (
    SPACES,
    XYZ_ONE,
    StandardPicture,
    WhiteSignal,
    standard_picture,
    upright,
    white_of_region,
)
from camssf_colour.picture_comparison import matrix_of_file
from camssf_colour.picture_file import write_picture
from camssf_colour.picture_strip import PER_UNIT, StripInputs, picture_strip
from camssf_colour.regions import measure_regions
from camssf_colour.standard import of_surfaces
from camssf_lab.simulation.camera import Sensor, count
from tests.support.dngs import Dng
from tests.support.scenes import filtered, mosaic

CHART = read_chart("classic24").values.copy()
CHART[18] = 0.9  # the reference
SENSOR = Sensor(full_well=1e9, read_noise=0.0)
LAMP, SIDE = "D65", 16


@cache
def camera() -> Camera:
    """A phone like the mean of those that the basis knows, with errors of 2 % over 15 nm, calibrated under D55."""
    mean = read_basis("phones").mean.T
    centres = np.arange(400.0, 700.0, 30.0)
    bells = 0.02 * np.exp(-0.5 * ((WAVELENGTHS - centres[:, None]) / 15.0) ** 2)
    modes = (bells[:, None, :, None] * np.eye(3)[:, None, :]).reshape(-1, WAVELENGTHS.size, 3)
    return Camera("phone", mean / mean.max(axis=0), modes, OwnWhite(np.array([0.55, 1.0, 0.7]), read_lamp("D55")))


def scene(
    cfa: str = "RGGB", sensor: Sensor = SENSOR, lamp: str = LAMP, level: float = 0.8, ambient: float = 0.0,
    seed: int = 1, **changes: Any,
) -> Mosaic:  # fmt: skip
    """The 24 patches in rows of six, SIDE pixels each; patch 18 is the white.

    Args:
        level, ambient: largest signal by the lamp, and by a bulb that is lit, too; 1 is saturation.
    """
    own = camera().own
    raw = np.zeros((24, 3))
    for light, part in ((lamp, level), ("A", ambient)):
        by_it = (CHART * read_lamp(light).values) @ camera().values * own.raw / (own.lamp.values @ camera().values)
        raw += part * (sensor.white_level - sensor.black) * by_it / by_it.max()
    light = filtered(raw.reshape(4, 6, 3).repeat(SIDE, axis=0).repeat(SIDE, axis=1), cfa).astype(np.float32)
    return replace(mosaic(count(light, sensor, np.random.default_rng(seed)), replace(sensor, cfa=cfa)), **changes)


def white(photo: Mosaic, dark: Mosaic | None = None) -> WhiteSignal:
    (region,) = measure_regions(photo, [(1.0, 3.0 * SIDE + 1.0, SIDE - 2.0, SIDE - 2.0)], dark=dark)
    return white_of_region(region, 0.9)


def picture_of(photo: Mosaic, lamp: str = LAMP, **more: Any) -> StandardPicture:
    return standard_picture(camera(), lamp, photo, **({"white": white(photo)} | more))


def whole(made: StandardPicture) -> tuple[Floats, Floats]:
    pixels, layer = (np.concatenate(strips) for strips in zip(*made.strips(), strict=True))
    return pixels, layer


def truth(view: str, lamp: str = LAMP) -> Floats:
    """Lab (24, 3) of the patches by `standard_colour`."""
    y = signals_of(CHART, read_lamp(lamp).values, camera().values)
    return standard_colour(camera(), lamp, y, reference=Reference(), view=View(white=view)).lab


def in_gamut(space: str) -> Any:
    """All patches but cyan, which is none of sRGB's colours."""
    return np.arange(24) != (17 if space == "srgb" else -1)


def inner(pixels: Floats) -> Floats:
    """(24, n, 3) the pixels of each patch that no neighbour reaches."""
    side = pixels.shape[0] // 4
    blocks = pixels.reshape(4, side, 6, side, 3)[:, side // 4 : -side // 4, :, side // 4 : -side // 4]
    return blocks.transpose(0, 2, 1, 3, 4).reshape(24, -1, 3)


def test_the_noise_of_colours_is_what_the_filters_make_of_the_samples() -> None:
    samples = np.random.default_rng(2).normal(size=(300, 2, 300, 2)) * np.array([[1.0, 2.0], [2.0, 3.0]])[:, None, :]
    assert np.cov(demosaic(samples).reshape(3, -1)) == pytest.approx(noise_shares() @ (1.0, 4.0, 9.0), rel=0.02)


@pytest.mark.requirement("R-COLOUR")
@pytest.mark.parametrize("space", SPACES)
def test_patches_have_the_colours_of_standard_colour(space: str) -> None:
    """And of the truth, by the curves' own camera."""
    made = picture_of(scene(), space=space)
    numbers, own = inner(whole(made)[0]).mean(axis=1), made.space
    xyz = numbers / XYZ_ONE if own.primaries is None else linear(numbers) @ own.to_xyz.T
    against = white_of(read_lamp(own.white).values) if own.primaries is None else own.to_xyz.sum(axis=1)
    assert delta_e00(lab(xyz, against), truth(own.white))[in_gamut(space)].max() < 0.5


def linear(numbers: Floats) -> Floats:
    """RGB before the curve of sRGB (IEC 61966-2-1)."""
    encoded = numbers / 65535.0
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def test_pixels_scatter_as_their_noise_says() -> None:
    photo = scene(sensor=Sensor())
    sure = replace(camera(), modes=camera().modes[:0])
    made = standard_picture(sure, LAMP, photo, white=white(photo), space="xyz-d65")
    pixels, layer = whole(made)
    scattered = lab(inner(pixels) / XYZ_ONE, white_of(read_lamp("D65").values)).std(axis=1)
    stated = inner(layer).mean(axis=1) / PER_UNIT
    assert (scattered < 1.2 * stated).all()  # the rest of the stated one is the same for all pixels of a patch


def test_a_signal_to_noise_ratio_is_that_of_the_white_surfaces_pixels() -> None:
    torch = {"sensor": Sensor(), "ambient": 0.4}
    pairs = [(scene(level=0.4, seed=i, **torch), scene(level=0.0, seed=i + 9, **torch)) for i in range(8)]
    there = slice(3 * SIDE + 2, 4 * SIDE - 2, 2), slice(3, SIDE - 2, 2)
    greens = [(lit.samples.astype(float) - dark.samples)[there] for lit, dark in pairs]
    ratio = np.mean(greens) / np.std(np.stack(greens) - np.mean(greens))
    stated = white(*pairs[0]).signal_to_noise
    assert stated[1] == pytest.approx(ratio, rel=0.15)


@cache
def straight() -> Floats:
    return whole(picture_of(scene()))[0]


@pytest.mark.parametrize("orientation", range(1, 9))
def test_the_picture_is_upright(orientation: int) -> None:
    """As Pillow turns it."""
    image = Image.fromarray(np.random.default_rng(3).integers(0, 255, (6, 10, 3), dtype=np.uint8))
    image.getexif()[274] = orientation
    theirs = ImageOps.exif_transpose(image)
    assert (upright(np.asarray(image), orientation) == np.asarray(theirs)).all()
    turned = picture_of(replace(scene(), orientation=orientation))
    pixels = whole(turned)[0]
    assert (pixels == upright(straight(), orientation)).all()
    assert pixels.shape[:2] == turned.size


@pytest.mark.parametrize(("space", "title"), [("srgb", "sRGB (IEC 61966-2-1)"), ("display-p3", "Display P3")])
@pytest.mark.parametrize("name", ["picture.png", "picture.tif"])
def test_colour_management_reads_the_colours_that_are_meant(
    name: str, space: str, title: str, tmp_path: Path
) -> None:
    """littleCMS, from the file's own profile to Lab (D50)."""
    made = picture_of(scene(), space=space)
    write_picture(made, tmp_path / name, "{}", 8 if name.endswith("png") else 16)
    image = Image.open(tmp_path / name)
    profile = ImageCms.ImageCmsProfile(io.BytesIO(image.info["icc_profile"]))
    assert ImageCms.getProfileDescription(profile).strip() == title
    to_lab = ImageCms.buildTransform(profile, ImageCms.createProfile("LAB"), "RGB", "LAB", renderingIntent=1)
    read = inner(np.asarray(ImageCms.applyTransform(image.convert("RGB"), to_lab)).astype(np.uint8))
    numbers = np.stack([read[..., 0] / 2.55, *(read[..., k].astype(np.int8).astype(float) for k in (1, 2))], axis=-1)
    off = delta_e00(numbers.mean(axis=1), truth("D50"))[in_gamut(space)]
    assert np.median(off) < 1.0  # littleCMS's Lab has whole numbers here
    assert off.max() < 2.5


def test_png_and_tiff_hold_the_same_numbers_and_words(tmp_path: Path) -> None:
    import cv2

    made = picture_of(scene())
    pixels, layer = whole(made)
    for name in ("one.png", "two.tif"):
        written = write_picture(made, tmp_path / name, json.dumps({"camera": "é"}))
        for path, numbers in ((written.picture, pixels), (written.uncertainty, layer)):
            assert (cv2.cvtColor(cv2.imread(str(path), cv2.IMREAD_UNCHANGED), cv2.COLOR_BGR2RGB) == numbers).all()
    with tifffile.TiffFile(tmp_path / "two.tif") as tiff:
        assert json.loads(tiff.pages[0].description) == {"camera": "é"}
    assert json.loads(Image.open(tmp_path / "one.png").text["Description"]) == {"camera": "é"}
    assert "no surface" in Image.open(tmp_path / "one.uncertainty.png").text["Description"]


@pytest.mark.parametrize(
    ("name", "space", "bits"),
    [("picture.jpg", "srgb", 8), ("picture.tif", "srgb", 8), ("picture.png", "xyz-d50", 8),
     ("picture.png", "srgb", 12), ("nowhere/picture.png", "srgb", 16)],
)  # fmt: skip
def test_what_cannot_be_written_leaves_nothing(name: str, space: str, bits: int, tmp_path: Path) -> None:
    made = replace(picture_of(scene()), space=SPACES[space])
    with pytest.raises(InvalidArgument):
        write_picture(made, tmp_path / name, "{}", bits)
    assert not list(tmp_path.iterdir())


def test_a_file_s_matrices_give_the_colours_of_its_camera() -> None:
    """If the camera is an observer, and the matrix is its own."""
    seen = observer("1931")
    photo = replace(scene(), colour_matrices=(ColourMatrix("D65", tuple(np.eye(3).ravel())),))
    y = signals_of(CHART, read_lamp("D65").values, seen)
    white_xyz = white_of(read_lamp("D65").values)
    relative = y @ matrix_of_file(photo, white_xyz).T
    assert lab(relative, np.ones(3)) == pytest.approx(
        of_surfaces(CHART, read_lamp("D65").values, View())[1], abs=0.05
    )
    with pytest.raises(InvalidArgument, match="colour matrix"):
        matrix_of_file(scene(), white_xyz)


def test_the_model_computes_the_same_strip() -> None:
    photo = scene(sensor=Sensor())
    made = picture_of(photo)
    rng = np.random.default_rng(4)
    strip = StripInputs(
        rng.uniform(-0.01, 1.1, (5, 2, 7, 2)), (rng.uniform(size=(5, 2, 7, 2)) > 0.95).astype(float),
        rng.uniform(0.0, 1.0, (5, 2, 7, 2)), rng.uniform(1.0, 2.0, (5, 2, 7, 2)), np.full(3, 1e-3),
        made.matrix, np.array(1.0),
    )  # fmt: skip
    session = onnx_runtime().InferenceSession(files("camssf").joinpath("data", "surfaces-picture.onnx").read_bytes())
    theirs = session.run(["picture", "uncertainty"], vars(strip) | vars(made.table))
    for ours, other in zip(picture_strip(strip, made.table), theirs, strict=True):
        assert np.abs(ours - other).max() < 1e-6


def test_a_smooth_picture_is_demosaiced_as_libraw_does_it() -> None:
    """By bilinear interpolation, with which the filters agree where nothing is sharp."""
    y, x = np.mgrid[0:64, 0:96]
    colours = 3000.0 + np.stack([20 * x + 10 * y, 15 * y + 5 * x, 1500 - 12 * x + 0 * y], axis=-1)
    samples = filtered(colours).astype(np.uint16)
    with rawpy.imread(io.BytesIO(Dng(samples).encode())) as raw:
        theirs = raw.postprocess(
            demosaic_algorithm=rawpy.DemosaicAlgorithm.LINEAR, output_color=rawpy.ColorSpace.raw, gamma=(1, 1),
            no_auto_bright=True, no_auto_scale=True, user_wb=[1, 1, 1, 1], output_bps=16,
        )  # fmt: skip
    ours = interleaved(demosaic(samples.astype(float).reshape(32, 2, 48, 2))).reshape(3, 60, 92).transpose(1, 2, 0)
    assert np.abs(ours - theirs[2:-2, 2:-2]).max() < 12  # LibRaw's whole numbers, and its plain means of a slope


@pytest.mark.full
def test_the_uncertainty_is_that_of_standard_colour_with_the_noise_of_a_pixel() -> None:
    photo = scene(sensor=Sensor())
    signal = white(photo)
    layer = inner(whole(picture_of(photo))[1]).mean(axis=1) / PER_UNIT
    y = signals_of(CHART, read_lamp(LAMP).values, camera().values)
    noise = np.sqrt(signal.photon_noise * y * np.diagonal(noise_shares().sum(axis=2)))
    theirs = standard_colour(camera(), LAMP, y, noise, reference=signal.reference, view=View(white="D65"))
    ratio = layer / np.sqrt(np.diagonal(theirs.lab_covariance, axis1=1, axis2=2))
    assert np.abs(np.log(np.median(ratio, axis=0))).max() < 0.25
    assert ratio.min() > 0.5
    assert ratio.max() < 2.5
