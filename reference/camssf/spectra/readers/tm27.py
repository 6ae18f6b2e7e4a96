"""Reads IES TM-27 (`.spdx`): XML with one spectrum, one `<SpectralData wavelength="380">` per sample."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from camssf.errors import InvalidArgument
from camssf.grid import Floats

SURFACES = ("absorptance", "reflectance", "transmittance", "r-factor", "t-factor")
"""Quantities of the format that describe surfaces, not light."""


def claims(text: str) -> bool:
    """Whether the text looks like XML."""
    return text.lstrip().startswith("<")


def read(text: str, path: Path) -> tuple[Floats, Floats]:
    """Wavelengths and power, (w,) each.

    Raises:
        InvalidArgument: other XML, no spectrum or several, or the spectrum of a surface.
    """
    if re.search(r"<!(DOCTYPE|ENTITY)", text):
        raise _none(path)  # the format has none, and expanded entities can be huge
    try:
        root = ElementTree.fromstring(text.strip())
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise _none(path) from error
    spectra = [element for element in root if _name(element) == "SpectralDistribution"]
    if not _name(root).startswith("IESTM27"):
        raise _none(path, f": its root element is {_name(root)[:40]}")
    if len(spectra) != 1:
        raise _none(path, f": it has {len(spectra)}")
    quantity = next(
        (element.text or "" for element in spectra[0] if _name(element) == "SpectralQuantity"), ""
    ).strip()
    if quantity.casefold() in SURFACES:
        raise InvalidArgument(f"{path} holds {quantity}, not light.", "Give the lamp's own spectrum.")
    samples = [element for element in spectra[0] if _name(element) == "SpectralData"]
    try:
        pairs = np.array([(float(sample.attrib["wavelength"]), float(sample.text or "")) for sample in samples])
    except (KeyError, ValueError) as error:
        raise InvalidArgument(f"{path} has a sample that is not a number.", "Export it again.") from error
    if not len(pairs):
        raise _none(path)
    return pairs[:, 0], pairs[:, 1]


def _name(node: ElementTree.Element) -> str:
    """The tag without its namespace, which differs between editions."""
    return node.tag.rpartition("}")[2] if isinstance(node.tag, str) else ""


def _none(path: Path, why: str = "") -> InvalidArgument:
    return InvalidArgument(
        f"{path} is not a TM-27 file with one spectrum{why}.", "Export a lamp as .spdx, or as two columns: nm, power."
    )
