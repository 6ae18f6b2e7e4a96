"""The picture of a RAW photo in standard colour, strip by strip, with its uncertainty.

Each pixel is demosaiced (`demosaic`), divided by the signal of a perfect white diffuser, and turned into XYZ by the
posterior over reflectance under the light of the photo (`pixel_table`).
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from camssf.colorimetry import D65_XY
from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS, Floats
from camssf.photo.patches import check_alike
from camssf.photo.read.dng import Mosaic, shading_of_samples
from camssf.recovery.covariance import CHART_CORRELATION, smooth_errors
from camssf.spectra import LampLike
from camssf_colour.camera import Camera, ColourCamera, as_camera
from camssf_colour.demosaic import CELL
from camssf_colour.light import OWN_WHITE, lamp_modes
from camssf_colour.picture_strip import FULL, StripInputs, picture_strip
from camssf_colour.pixel_table import PixelTable, tabulate
from camssf_colour.regions import Region, check_reference, reference_of
from camssf_colour.spread import Reference
from camssf_colour.standard import PRIOR, evidence_weights, lamps_of, lights, no_colour
from camssf_colour.view import View

T = TypeVar("T", bound=np.generic)
Samples = NDArray[np.uint16]
SINGLE = np.float32
"""Precision of the pixels: of 24 bits, for steps of 16. NumPy is twice as fast with it."""
Singles = NDArray[np.float32]
XYZ_ONE = 32768
"""Y of a perfect white diffuser in a picture of XYZ, as in ICC profiles (u1Fixed15Number)."""
STRIP = 1 << 16
"""Pixels that are computed at a time."""


@dataclass(frozen=True)
class PictureSpace:
    """The colours that a picture is written in.

    Attributes:
        name: of the space.
        white: that colours are adapted to by CAT16.
        primaries: (3, 2) CIE 1931 xy of red, green, blue; None for XYZ.
    """

    name: str
    white: str
    primaries: tuple[tuple[float, float], ...] | None

    def matrix(self, white: Floats) -> Floats:
        """(3, 3) from XYZ over a white (3,) to linear numbers up to 1: RGB, of which white is 1, 1, 1, or XYZ."""
        if self.primaries is None:
            return np.diag(white * XYZ_ONE / FULL)
        return np.asarray(np.linalg.inv(self.to_xyz)) * _xyz(D65_XY)

    @cached_property
    def to_xyz(self) -> Floats:
        """(3, 3) from linear RGB to XYZ, of white of Y = 1."""
        assert self.primaries is not None
        columns = np.stack([_xyz(primary) for primary in self.primaries], axis=1)
        return np.asarray(columns * np.linalg.solve(columns, _xyz(D65_XY)))


def _xyz(xy: tuple[float, float]) -> Floats:
    x, y = xy
    return np.array([x / y, 1.0, (1.0 - x - y) / y])


SPACES = {
    space.name: space
    for space in (
        PictureSpace("srgb", "D65", ((0.64, 0.33), (0.30, 0.60), (0.15, 0.06))),
        PictureSpace("display-p3", "D65", ((0.680, 0.320), (0.265, 0.690), (0.150, 0.060))),
        PictureSpace("xyz-d65", "D65", None),
        PictureSpace("xyz-d50", "D50", None),
    )
}
"""sRGB (IEC 61966-2-1), Display P3 (SMPTE EG 432-1 with the curve of sRGB), and linear XYZ."""


@dataclass(frozen=True)
class WhiteSignal:
    """What a pixel's raw signals are divided by, and what the light is known from.

    Attributes:
        raw: (3,) raw signal of a perfect white diffuser in this photo, DN above black.
        from_reference: whether a white or grey surface in the picture was measured. Else `raw` has the ratios that
            the calibration gives for the lamp, and a level at which the first channel saturates.
        reference: the errors of `raw`, and the raw signals that tell the light.
        photon_noise: (3,) variance of a sample over its signal, relative to `raw`; None if it is not known.
        signal_to_noise: (3,) of a pixel of the white surface, after the subtraction; None without one.
        dark_share: (3,) part of the light on it that was subtracted, 0 to 1; None without a dark photo.
    """

    raw: Floats
    from_reference: bool
    reference: Reference
    photon_noise: Floats | None
    signal_to_noise: Floats | None = None
    dark_share: Floats | None = None


def white_of_region(white: Region, reflectance: float) -> WhiteSignal:
    """The white signal by a white or grey surface in the picture.

    Raises:
        InvalidArgument: a reference that is too dark, or a reflectance outside 0.02 to 1.2.
    """
    check_reference(white, reflectance)
    raw, light = white.raw / reflectance, white.raw + white.dark
    noise = white.deviation**2 / light
    return WhiteSignal(
        raw, True, reference_of(white), noise / raw, white.raw / np.sqrt(noise * (light + white.dark)),
        white.dark / light if white.dark.any() else None,
    )  # fmt: skip


def white_of_camera(camera: Camera, lamp: LampLike, photo: Mosaic) -> WhiteSignal:
    """The white signal without a reference: the ratios by the calibration, the level where the photo saturates.

    The errors of the lamp and of the calibration's own white are then errors of the white signal, too.

    Raises:
        InvalidArgument: a light that is not named, or a result without the light of its first photo.
    """
    if camera.own is None:
        raise InvalidArgument(
            "This result does not hold the light of its first photo, so the white balance of a photo without a "
            "reference is unknown.",
            "Measure a white or grey surface in the photo, or take the whole result.json.",
        )
    (light,), own = lamps_of(lamp, None), camera.own
    ratios = own.raw * (light.values @ camera.values) / (own.lamp.values @ camera.values)
    room = photo.white - _by_colour(photo.black, photo.cfa)
    smooth = OWN_WHITE * smooth_errors(CHART_CORRELATION, WAVELENGTHS).T
    modes = np.concatenate([lamp_modes(light), lamp_modes(own.lamp), smooth])
    reference = Reference(OWN_WHITE, modes=modes / OWN_WHITE)
    return WhiteSignal(ratios * (room / ratios).min(), False, reference, None)


def _by_colour(values: Floats, cfa: str) -> Floats:
    """(3,) means of the values (2, 2) of the cell over the places of each colour."""
    flat = values.ravel()
    return np.array([np.mean([flat[i] for i in range(4) if cfa[i] == colour]) for colour in "RGB"])


@dataclass(frozen=True)
class StandardPicture:
    """A photo as a picture in standard colour; `strips` computes its pixels.

    Attributes:
        photo: the RAW photo.
        dark: the photo that is subtracted from it; None for the black level.
        white: what its signals are divided by.
        space: of the picture's numbers.
        lens_shading: "as-stored" or "apply", as for `measure_patches`.
        table: colours of the light.
        matrix: (3, 3) from XYZ over white to linear numbers of the space.
        lamps: names of the lamps that were compared, and their weights.
        chi_squared: χ² of the reference's ratios under the likeliest lamp; None if they were not used.
    """

    photo: Mosaic
    dark: Mosaic | None
    white: WhiteSignal
    space: PictureSpace
    lens_shading: str
    table: PixelTable
    matrix: Floats
    lamps: tuple[tuple[str, float], ...]
    chi_squared: float | None

    @property
    def size(self) -> tuple[int, int]:
        """Height and width of the upright picture."""
        height, width = self.photo.samples.shape
        return (height, width) if self.photo.orientation < 5 else (width, height)

    @cached_property
    def _single_table(self) -> PixelTable:
        table = self.table
        return PixelTable(*(values.astype(SINGLE) for values in (table.roots, table.covariance, table.distance)))

    def strips(self) -> Iterator[tuple[Samples, Samples]]:
        """The upright picture from its top, (n, width, 3), and its uncertainty, (n / 2, width / 2, 3).

        The uncertainty (`picture_strip`) is that of a pixel, for blocks of 2 × 2. CLIPPED, and white in the picture,
        is what a clipped sample has reached; OUT_OF_REACH is a colour that no surface has under this light.
        """
        height, width = self.photo.samples.shape
        turned, backwards = self.photo.orientation > 4, self.photo.orientation in (3, 4, 7, 8)
        length, across = (width, height) if turned else (height, width)
        step = max(2, STRIP // across // 2 * 2)
        starts = range(0, length, step)

        def strip(start: int) -> tuple[Samples, Samples]:
            part, whole = slice(start, min(start + step, length)), slice(0, across)
            pixels, layer = self._block(whole, part) if turned else self._block(part, whole)
            return upright(pixels, self.photo.orientation), upright(layer, self.photo.orientation)

        workers = os.cpu_count() or 1
        with ThreadPoolExecutor(workers) as pool:
            waiting: deque[Future[tuple[Samples, Samples]]] = deque()
            try:
                for start in reversed(starts) if backwards else starts:
                    waiting.append(pool.submit(strip, start))
                    if len(waiting) > 2 * workers:
                        yield waiting.popleft().result()
                while waiting:
                    yield waiting.popleft().result()
            finally:
                for future in waiting:
                    future.cancel()

    def _block(self, rows: slice, columns: slice) -> tuple[Samples, Samples]:
        """A rectangle from an even row and column, in the sensor's orientation, and its uncertainty."""
        photo, (row, column) = self.photo, divmod(self.photo.cfa.index("R"), 2)
        height, width = rows.stop - rows.start, columns.stop - columns.start
        # Cells in which red is not first are mirrored: the filters are the same.
        down = _with_margin(rows, photo.samples.shape[0])[:: 1 - 2 * row]
        right = _with_margin(columns, photo.samples.shape[1])[:: 1 - 2 * column]
        shape = len(down) // 2, 2, len(right) // 2, 2
        # NumPy is fastest along whole rows.
        pairs_of_rows = (*shape[:2], len(right))

        def of_frame(frame: Mosaic) -> NDArray[np.uint16]:
            return np.asarray(frame.samples[down][:, right].reshape(pairs_of_rows))

        def of_cell(values: Floats) -> Singles:
            """A cell's values (2, 2) for two rows."""
            return np.tile(values.astype(SINGLE), (1, shape[2]))

        black = of_cell(photo.black[:: 1 - 2 * row, :: 1 - 2 * column])
        white, gains = of_cell(self.white.raw[np.array(CELL)]), np.ones(pairs_of_rows, SINGLE)
        if self.lens_shading == "apply":
            gains = shading_of_samples(photo, down, right).astype(SINGLE).reshape(pairs_of_rows)
        samples = of_frame(photo)
        light, clipped = samples.astype(SINGLE) - black, samples >= photo.white
        dark = np.zeros_like(light)
        if self.dark is not None:
            subtracted = of_frame(self.dark)
            dark = subtracted.astype(SINGLE) - black
            light, dark = light - dark, dark * gains / white
            clipped |= subtracted >= photo.white
        noise = np.zeros(3) if self.white.photon_noise is None else self.white.photon_noise
        strip = StripInputs(
            mosaic=(light * gains / white).reshape(shape),
            clipped=clipped.astype(SINGLE).reshape(shape),
            dark=dark.reshape(shape),
            gains=gains.reshape(shape),
            photon_noise=noise.astype(SINGLE),
            matrix=self.matrix.astype(SINGLE),
            curved=np.array(self.space.primaries is not None, SINGLE),
        )
        picture, uncertainty = (np.rint(values) for values in picture_strip(strip, self._single_table))
        cells = np.empty((*picture.shape[1:], 3), np.uint16)
        for channel, i, j in np.ndindex(3, 2, 2):
            cells[:, i, :, j, channel] = picture[channel, :, i, :, j]
        pixels, layer = (
            cells.reshape(len(down) - 4, len(right) - 4, 3),
            np.moveaxis(uncertainty.astype(np.uint16), 0, 2),
        )
        pixels, layer = (values[:: 1 - 2 * row, :: 1 - 2 * column] for values in (pixels, layer))
        return pixels[:height, :width], layer[: height // 2, : width // 2]


def _with_margin(part: slice, size: int) -> NDArray[np.int64]:
    """Indices of the cells that hold a part of an axis, with one cell more on each side.

    Beyond the edge they are those of the samples mirrored at it, which have the same colours.
    """
    at = np.abs(np.arange(part.start - 2, part.stop + part.stop % 2 + 2)) % (2 * size - 2)
    return np.asarray(np.minimum(at, 2 * size - 2 - at))


def upright(pixels: NDArray[T], orientation: int) -> NDArray[T]:
    """Pixels (h, w, ...) in the sensor's orientation, turned by the TIFF orientation."""
    turned = pixels.swapaxes(0, 1) if orientation > 4 else pixels
    down, right = {1: (1, 1), 2: (1, -1), 3: (-1, -1), 4: (-1, 1), 5: (1, 1), 6: (1, -1), 7: (-1, -1), 8: (-1, 1)}[
        orientation
    ]
    return turned[::down, ::right]


def standard_picture(
    camera: ColourCamera,
    lamp: LampLike,
    photo: Mosaic,
    *,
    dark: Mosaic | None = None,
    white: WhiteSignal | None = None,
    space: str = "srgb",
    lens_shading: str = "as-stored",
) -> StandardPicture:
    """The picture of a RAW photo in standard colour.

    Args:
        camera: a result, the excerpt of one, or a Camera.
        lamp: as for `standard_colour`.
        photo: the RAW photo, by the same camera.
        dark: the same view with the same settings, and the torch off: the picture is that in the torch's light alone.
            Nothing may move between the two.
        white: by `white_of_region`, of a region that was measured with `dark`, too; unless given, by
            `white_of_camera`, which needs a named lamp.
        space: one of SPACES.
        lens_shading: "apply" multiplies the samples by the file's gain maps.

    Raises:
        InvalidArgument: an unknown space; no lamp and nothing that tells it; curves from which no colour can be
            computed.
        LampUnfit: the reference's raw ratios contradict the lamp.
        FramesDiffer, UnitDiffers: a dark photo by another camera, or with other settings.
        UnsupportedRaw: gain maps that cannot be applied.
    """
    if space not in SPACES:
        raise InvalidArgument(f"There is no space {space!r} for a picture.", f"Take one of {', '.join(SPACES)}.")
    if dark is not None:
        check_alike(photo, dark, "dark")
    camera, target = as_camera(camera), SPACES[space]
    signal = white or white_of_camera(camera, lamp, photo)
    try:
        with np.errstate(all="ignore"):  # the table is checked below
            seen = lights(camera, lamp, signal.reference)
            weights = evidence_weights(seen)
            table, xyz = tabulate(seen, weights, signal.reference, View("1931", target.white), PRIOR)
    except np.linalg.LinAlgError as fault:
        raise no_colour() from fault
    if not (np.isfinite(table.roots).all() and np.isfinite(table.covariance).all()):
        raise no_colour()
    lamps = tuple((light.name, float(weight)) for light, weight in zip(seen, weights, strict=True))
    chi_squared = seen[int(weights.argmax())].chi_squared
    return StandardPicture(photo, dark, signal, target, lens_shading, table, target.matrix(xyz), lamps, chi_squared)
