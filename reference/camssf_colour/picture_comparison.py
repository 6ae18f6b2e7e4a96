"""One scene by two cameras, as their files' own colour matrices have it and through their curves."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from camssf.colorimetry import adaptation, delta_e00, lab, white_and_matrix, white_of
from camssf.errors import InvalidArgument
from camssf.grid import BAND, Floats
from camssf.photo.read.dng import Mosaic
from camssf.report.page import render, style
from camssf.report.sections.photos import upright
from camssf.spectra import LampLike, read_lamp
from camssf_colour.camera import ColourCamera
from camssf_colour.picture import StandardPicture, standard_picture, white_of_region
from camssf_colour.pixel_table import COVARIANCE_NODES, PAIRS, RATIO_NODES, PixelTable, node_signals
from camssf_colour.regions import Rectangle, against, measure_regions
from camssf_colour.standard import standard_colour
from camssf_colour.view import View

VIEW = View("1931", "D65")
LONGEST = 900
"""Pixels of the longer side of a picture on the page."""


@dataclass(frozen=True)
class ScenePhoto:
    """One camera's photo of the scene.

    Attributes:
        name: of the camera.
        camera: its calibration.
        photo: the RAW photo.
        lamp: as for `standard_colour`.
        regions: surfaces, in the same order for both cameras.
        white: the white or grey surface, and its reflectance.
        lens_shading: as for `measure_patches`.
    """

    name: str
    camera: ColourCamera
    photo: Mosaic
    lamp: LampLike
    regions: Sequence[Rectangle]
    white: tuple[Rectangle, float]
    lens_shading: str = "as-stored"


@dataclass(frozen=True)
class SceneColours:
    """A camera's pictures of the scene, and the regions' Lab (m, 3) under D65.

    Attributes:
        matrix, curves: the pictures by the file's colour matrix and through the curves.
        lab_by_matrix, lab_by_curves: (m, 3).
        deviation: (m, 3) standard deviations of the latter.
    """

    matrix: StandardPicture
    curves: StandardPicture
    lab_by_matrix: Floats
    lab_by_curves: Floats
    deviation: Floats


def scene_colours(scene: ScenePhoto) -> SceneColours:
    """The pictures and colours of one camera's photo.

    Raises:
        InvalidArgument: a file without a colour matrix, or as `measure_regions` and `standard_picture`.
        LampUnfit: the reference's raw ratios contradict the lamp.
    """
    place, reflectance = scene.white
    *measured, white = measure_regions(scene.photo, [*scene.regions, place], lens_shading=scene.lens_shading)
    signals, errors = against(measured, white, reflectance)
    signal = white_of_region(white, reflectance)
    through = standard_picture(scene.camera, scene.lamp, scene.photo, white=signal, lens_shading=scene.lens_shading)
    colours = standard_colour(scene.camera, scene.lamp, signals, errors, reference=signal.reference, view=VIEW)
    to_relative = matrix_of_file(scene.photo, signal.raw)
    roots = np.cbrt(node_signals(RATIO_NODES) @ to_relative.T)
    table = PixelTable(roots, np.zeros((COVARIANCE_NODES**2, len(PAIRS))), np.zeros(COVARIANCE_NODES**2))
    return SceneColours(
        replace(through, table=table), through, lab(signals @ to_relative.T, np.ones(3)), colours.lab,
        np.sqrt(np.diagonal(colours.lab_covariance, axis1=1, axis2=2)),
    )  # fmt: skip


def matrix_of_file(photo: Mosaic, white: Floats) -> Floats:
    """(3, 3) from signals over white to XYZ over white under D65, by the file's matrices, used as DNG readers do.

    Raises:
        InvalidArgument: the file has none, or they give no colour of this white.
    """
    matrices = sorted(((matrix.kelvin, matrix.to_raw) for matrix in photo.colour_matrices), key=lambda pair: pair[0])
    balanced = white_and_matrix(white / white[1], matrices)
    if balanced is None:
        raise InvalidArgument(
            f"{photo.path} holds no colour matrix that gives its white a colour: its maker's picture is not known.",
            "Take the DNG as the phone wrote it.",
        )
    xyz, matrix = balanced
    own, aim = xyz / xyz[1], white_of(read_lamp(VIEW.white).values)
    to_xyz = np.linalg.inv(matrix) * (matrix @ own)
    return np.asarray((adaptation(own, aim) @ to_xyz) / aim[:, None])


def comparison_page(first: ScenePhoto, second: ScenePhoto) -> str:
    """The page (HTML) that shows both cameras' pictures, and ΔE00 between them in each region.

    Raises:
        InvalidArgument: unequal numbers of regions, or as `scene_colours`.
        LampUnfit: as `scene_colours`.
    """
    if len(first.regions) != len(second.regions) or not first.regions:
        raise InvalidArgument(
            f"The scene has {len(first.regions)} regions in one photo and {len(second.regions)} in the other.",
            "Give the same surfaces in both, in the same order.",
        )
    scenes, colours = (first, second), [scene_colours(scene) for scene in (first, second)]
    by_matrix, by_curves = (
        delta_e00(*(getattr(one, name) for one in colours)) for name in ("lab_by_matrix", "lab_by_curves")
    )
    rows = [
        [str(i + 1), f"{by_matrix[i]:.1f}", f"{by_curves[i]:.1f}", *(_lab(one, i) for one in colours)]
        for i in range(len(first.regions))
    ]
    pictures = {
        way: [
            (scene.name, _picture(getattr(one, way)), *_frame(scene))
            for scene, one in zip(scenes, colours, strict=True)
        ]
        for way in ("matrix", "curves")
    }
    return render(
        "pictures.html.jinja",
        {
            "title": "One scene, two cameras", "style": style(), "pictures": pictures, "rows": rows,
            "head": ["Region", "By matrix", "Through the curves", *(f"L*, a*, b*, {scene.name}" for scene in scenes)],
            "median": [f"{float(np.median(values)):.1f}" for values in (by_matrix, by_curves)],
        },
    )  # fmt: skip


def _lab(colours: SceneColours, i: int) -> str:
    pairs = zip(colours.lab_by_curves[i], BAND * colours.deviation[i], strict=True)
    return ", ".join(f"{value:.1f} ± {half:.1f}".replace("-", "\u2212") for value, half in pairs)


def _picture(made: StandardPicture) -> str:
    """The picture as the address of a JPEG."""
    import cv2

    pixels = np.concatenate([strip for strip, _ in made.strips()])
    scale = min(1.0, LONGEST / max(pixels.shape[:2]))
    small = cv2.resize(pixels, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    _, data = cv2.imencode(
        ".jpg", np.rint(small[:, :, ::-1] / 257.0).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, 92]
    )
    return "data:image/jpeg;base64," + base64.b64encode(data.tobytes()).decode()


def _frame(scene: ScenePhoto) -> tuple[int, int, list[tuple[int, float, float, float, float]]]:
    """Width and height of the upright picture, and each region's number, x, y, width and height in it."""
    height, width = scene.photo.samples.shape
    marks = []
    for number, (x, y, w, h) in enumerate(scene.regions, 1):
        corners = np.array([[x, y], [x + w, y + h]]) - 0.5  # pixel borders lie half a pixel outside the centres
        ends = upright(corners, width, height, scene.photo.orientation)
        marks.append((number, *ends.min(axis=0).tolist(), *np.ptp(ends, axis=0).tolist()))
    turned = scene.photo.orientation > 4
    return (height, width, marks) if turned else (width, height, marks)
