"""Computes curves from a monochromator sweep with lines of known power P: S(λ) = I(λ) / P(λ)."""

from __future__ import annotations

import numpy as np

from camssf.errors import InvalidArgument
from camssf.grid import CHANNELS, WAVELENGTHS
from camssf.messages import fail
from camssf_lab.direct.columns import PathLike, read_columns
from camssf_lab.direct.result import FIRST, LAST, Direct, checked, identified

LARGEST_STEP = 20.0
"""Largest wavelength step of a sweep, nm."""


def sweep(path: PathLike) -> Direct:
    """The curves of a monochromator sweep, interpolated linearly between its wavelengths.

    Args:
        path: CSV wavelength_nm,red,green,blue,power, one spectral line a row, dark subtracted; from 400 to 700 nm in
            steps of 20 nm at most.

    Raises:
        InvalidArgument: another file, wavelengths that do not increase, or gaps.
        Underexposed: a row without reference power, or a channel without signal.
    """
    nm, *columns = read_columns(path, ("wavelength_nm", *CHANNELS, "power"))
    if nm[0] > FIRST or nm[-1] < LAST or np.diff(nm).max() > LARGEST_STEP:
        raise InvalidArgument(
            f"{path} covers {nm[0]:g} to {nm[-1]:g} nm in steps of up to {np.diff(nm).max():g} nm.",
            f"Sweep {FIRST:g} to {LAST:g} nm in steps of {LARGEST_STEP:g} nm at most; 5 nm is usual.",
        )
    power = columns[3]
    if power.min() <= 0:
        raise fail(
            "underexposed.no_reference_power",
            value=float(power.min()),
            threshold=0.0,
            file=path,
            wavelength=nm[np.argmin(power)],
        )
    with np.errstate(over="ignore"):
        shares = [column / power for column in columns[:3]]
    if not np.isfinite(shares).all():
        raise InvalidArgument(f"{path} has signals too large for their power.", "Check the units of its columns.")
    values = np.stack([np.interp(WAVELENGTHS, nm, share, 0.0, 0.0) for share in shares], axis=1)
    covered = (max(float(nm[0]), 380.0), min(float(nm[-1]), 720.0))
    assumptions = (("reference_power", "the reference power is in proportion to what reached the camera's sensor."),)
    return checked(Direct(values, None, covered, ("", ""), {}, {}, assumptions, identified({"sweep": path})))
