"""Converts XYZ to Lab and to sRGB under D65, and computes CIEDE2000.

The published formulas are implemented here, so that a calibration loads no library for them;
tests/test_appearance.py compares each with colour-science.
"""

from __future__ import annotations

import numpy as np

from camssf.grid import Floats

D65_XY = (0.3127, 0.3290)
"""CIE 1931 chromaticity of D65, as sRGB rounds it (IEC 61966-2-1)."""
D65: Floats = np.array([D65_XY[0] / D65_XY[1], 1.0, (1.0 - sum(D65_XY)) / D65_XY[1]])
CAT02: Floats = np.array([[0.7328, 0.4296, -0.1624], [-0.7036, 1.6975, 0.0061], [0.0030, 0.0136, 0.9834]])
"""XYZ to the cone signals of CIECAM02 (CIE 159:2004)."""
SRGB: Floats = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])
"""XYZ under D65 to linear sRGB (IEC 61966-2-1)."""
for _table in (D65, CAT02, SRGB):
    _table.setflags(write=False)
BEND, SLOPE = 216.0 / 24389.0, 24389.0 / 27.0
"""Lab's transition from cube root to straight line, and the slope of that line (CIE 15)."""


def lab(xyz: Floats, white: Floats) -> Floats:
    """CIE 1976 L*a*b* (..., 3) of XYZ (..., 3) seen under a white (..., 3): CIE 15."""
    t = np.asarray(xyz) / white
    f = np.where(t > BEND, np.cbrt(np.maximum(t, BEND)), (SLOPE * t + 16.0) / 116.0)
    x, y, z = np.moveaxis(f, -1, 0)
    return np.stack([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)], axis=-1)


def under_d65(xyz: Floats, white: Floats) -> Floats:
    """Adapt XYZ (..., 3) from a white (3,) to D65: von Kries with CAT02, complete adaptation."""
    scale = (CAT02 @ D65) / (CAT02 @ white)
    return np.asarray(xyz @ (np.linalg.inv(CAT02) @ (scale[:, None] * CAT02)).T)


def srgb(xyz: Floats) -> Floats:
    """sRGB (..., 3) of XYZ (..., 3) under D65; 0 to 1 inside the display's gamut."""
    linear = np.asarray(xyz) @ SRGB.T
    curved = 1.055 * np.maximum(linear, 0.0031308) ** (1.0 / 2.4) - 0.055
    return np.where(linear <= 0.0031308, 12.92 * linear, curved)


def delta_e00(one: Floats, other: Floats) -> Floats:
    """CIEDE2000 (...) of Lab (..., 3) and Lab (..., 3): CIE 142, in the form of Sharma, Wu and Dalal (2005)."""
    (l1, a1, b1), (l2, a2, b2) = (np.moveaxis(np.asarray(each, dtype=np.float64), -1, 0) for each in (one, other))
    mean_c7 = ((np.hypot(a1, b1) + np.hypot(a2, b2)) / 2.0) ** 7
    g = 0.5 * (1.0 - np.sqrt(mean_c7 / (mean_c7 + 25.0**7)))
    a1, a2 = (1.0 + g) * a1, (1.0 + g) * a2
    c1, c2 = np.hypot(a1, b1), np.hypot(a2, b2)
    h1, h2 = (np.degrees(np.arctan2(b, a)) % 360.0 for a, b in ((a1, b1), (a2, b2)))
    grey = c1 * c2 == 0.0
    turn = np.where(grey, 0.0, (h2 - h1 + 180.0) % 360.0 - 180.0)
    turn = np.where(turn == -180.0, np.where(h2 > h1, 180.0, -180.0), turn)
    big = 2.0 * np.sqrt(c1 * c2) * np.sin(np.radians(turn) / 2.0)
    mean_l, mean_c = (l1 + l2) / 2.0, (c1 + c2) / 2.0
    apart, total = np.abs(h1 - h2) > 180.0, h1 + h2
    mean_h = np.where(apart, np.where(total < 360.0, total + 360.0, total - 360.0), total) / 2.0
    mean_h = np.where(grey, total, mean_h)
    t = (
        1.0
        - 0.17 * np.cos(np.radians(mean_h - 30.0))
        + 0.24 * np.cos(np.radians(2.0 * mean_h))
        + 0.32 * np.cos(np.radians(3.0 * mean_h + 6.0))
        - 0.20 * np.cos(np.radians(4.0 * mean_h - 63.0))
    )
    rotation = 30.0 * np.exp(-(((mean_h - 275.0) / 25.0) ** 2))
    rc = 2.0 * np.sqrt(mean_c**7 / (mean_c**7 + 25.0**7))
    far = (mean_l - 50.0) ** 2
    light = (l2 - l1) / (1.0 + 0.015 * far / np.sqrt(20.0 + far))
    chroma = (c2 - c1) / (1.0 + 0.045 * mean_c)
    hue = big / (1.0 + 0.015 * mean_c * t)
    square = light**2 + chroma**2 + hue**2 - np.sin(np.radians(2.0 * rotation)) * rc * chroma * hue
    return np.asarray(np.sqrt(np.maximum(square, 0.0)))
