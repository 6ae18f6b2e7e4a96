"""A strip of a picture in standard colour, and of its uncertainty, from the samples of a mosaic."""

from __future__ import annotations

from dataclasses import dataclass

from camssf.colorimetry import encoded
from camssf.recovery.arrays import Array, constant, namespace
from camssf_colour.demosaic import PLACES, demosaic, interleaved, noise_shares
from camssf_colour.pixel_table import PAIRS, PixelTable, lab_variances, out_of_reach, places_of, xyz_of

FULL = 65535.0
CLIPPED, OUT_OF_REACH = FULL, FULL - 1.0
"""In the layer of uncertainty: a clipped sample, and a colour that no surface has under this light."""
PER_UNIT = 100.0
"""Steps of the layer of uncertainty in one unit of L*, a* or b*."""


@dataclass(frozen=True)
class StripInputs:
    """A strip of a mosaic, with a margin of one cell.

    Attributes:
        mosaic: (h, 2, w, 2) samples of cells red, green / green, blue, relative to those of a perfect white diffuser.
        clipped: (h, 2, w, 2), 1 for clipped samples, else 0.
        dark: (h, 2, w, 2) what was subtracted from the samples besides black, in the same units; its noise remains.
        gains: (h, 2, w, 2) what the samples were multiplied by to correct lens shading.
        photon_noise: (3,) variance of a sample over its signal.
        matrix: (3, 3) from XYZ over white to linear numbers, of which 1 is the largest.
        curved: 1 for the curve of sRGB, 0 for linear numbers.
    """

    mosaic: Array
    clipped: Array
    dark: Array
    gains: Array
    photon_noise: Array
    matrix: Array
    curved: Array


def picture_strip(inputs: StripInputs, table: PixelTable) -> tuple[Array, Array]:
    """The picture (3, h - 2, 2, w - 2, 2) and its uncertainty (3, h - 2, w - 2), both from 0 to FULL.

    The uncertainty is the standard deviation of L*, a* and b* of a pixel, in 1 / PER_UNIT, the mean of a cell.
    """
    xp, (h, _, w, _) = namespace(inputs.mosaic), inputs.mosaic.shape
    h, w = h - 2, w - 2
    signals = demosaic(inputs.mosaic)
    reached = xp.reshape(xp.permute_dims(_reached(inputs.clipped), (1, 3, 0, 2)), (4, h * w))
    xyz = xyz_of(table, places_of(xp.reshape(signals, (3, 4 * h * w))))
    numbers = FULL * _curved(_mixed(inputs.matrix, xyz), inputs.curved)
    numbers = xp.where(xp.reshape(reached, (4 * h * w,)) > 0.5, FULL, numbers)

    cells = 0.25 * sum(xp.reshape(signals[:, place, :, :], (3, h * w)) for place in range(4))
    gains, dark = (
        0.25 * sum(xp.reshape(values[1 : h + 1, i, 1 : w + 1, j], (h * w,)) for i, j in PLACES)
        for values in (inputs.gains, inputs.dark)
    )
    # Of the light of both photos: the photo's own is the difference and the dark photo's once more.
    variance = inputs.photon_noise[:, None] * xp.maximum(cells + 2.0 * dark, 0.0) * gains
    shares = xp.astype(constant(xp, [noise_shares()[i, j] for i, j in PAIRS]), variance.dtype)
    noise = _mixed(shares, variance)
    places = places_of(cells)
    layer = xp.minimum(PER_UNIT * xp.sqrt(lab_variances(table, places, noise)), OUT_OF_REACH - 1.0)
    layer = xp.where(out_of_reach(table, places, noise), OUT_OF_REACH, layer)
    clipped = sum(reached[place, :] for place in range(4)) > 0.5
    layer = xp.where(clipped, CLIPPED, layer)
    return interleaved(xp.reshape(numbers, (3, 4, h, w))), xp.reshape(layer, (3, h, w))


def _mixed(matrix: Array, values: Array) -> Array:
    """matrix (k, 3) @ values (3, n), without the linear algebra's own threads: they would wait beside the strips'."""
    rows = (sum(matrix[i, c] * values[c, :] for c in range(3)) for i in range(matrix.shape[0]))
    return namespace(values).stack(list(rows), axis=0)


def _curved(linear: Array, curved: Array) -> Array:
    """Numbers from 0 to 1, by the curve of sRGB if `curved` is 1; what is beyond is cut off."""
    xp = namespace(linear)
    linear = xp.minimum(xp.maximum(linear, 0.0), 1.0)
    return xp.where(curved > 0.5, encoded(linear, xp), linear)


def _reached(clipped: Array) -> Array:
    """(h - 2, 2, w - 2, 2), 1 where one of the 5 × 5 samples around, of which a colour is made, is clipped."""
    xp, (h, _, w, _) = namespace(clipped), clipped.shape
    rows, columns = 2 * (h - 2), 2 * (w - 2)
    flat = xp.reshape(clipped, (2 * h, 2 * w))
    across = flat[:, 0:columns]
    for right in range(1, 5):
        across = xp.maximum(across, flat[:, right : columns + right])
    down = across[0:rows, :]
    for step in range(1, 5):
        down = xp.maximum(down, across[step : rows + step, :])
    return xp.reshape(down, (h - 2, 2, w - 2, 2))
