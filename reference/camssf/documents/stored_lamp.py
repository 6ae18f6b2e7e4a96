"""The light of a result's shot as a lamp: as it was named, or as it was estimated."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from camssf.documents.document import Document
from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery.covariance import LAMP_CORRELATION, smooth_errors
from camssf.spectra import Called, Lamp, read_lamp


def lamp_of(document: Document, shot: int) -> Lamp | None:
    """The lamp of a shot (from 0), its power of mean 1; None if it was not named and the result was refused.

    The modes of an estimated light give its standard deviation at each wavelength, for errors that are smooth over
    LAMP_CORRELATION.
    """
    assert document.capture is not None
    lamp = document.capture.shots[shot].lamp
    if isinstance(lamp, Lamp):
        return replace(lamp, values=lamp.values / lamp.values.mean())
    light = document.answer.lights[shot] if document.answer is not None and document.answer.lights else None
    if light is None:
        return read_lamp(lamp.name) if isinstance(lamp, Called) else None
    return estimated_lamp(lamp.name, light.power, light.std)


def estimated_lamp(name: str, power: Floats, std: Floats) -> Lamp:
    """A light with power (681,) and its standard deviation (681,) as a lamp."""
    modes = std * unit_errors(LAMP_CORRELATION).T / power
    return Lamp(name, power, 0.0, modes, "estimated from the photo")


@cache
def unit_errors(length: float) -> Floats:
    """(681, p) errors smooth over a length in nm, of variance 1 at every wavelength."""
    smooth = smooth_errors(length, WAVELENGTHS)
    return np.asarray(smooth / np.linalg.norm(smooth, axis=1, keepdims=True))
