"""Files of golden/, and the input forms of a case as arrays (format.md)."""

from __future__ import annotations

import hashlib
import json
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.polynomial.polynomial import polyval

from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery.basis import interpolate

Json: TypeAlias = dict[str, Any]
ROOT = Path(__file__).parent
NIKON: Json = {"camera": "Nikon D5100"}
"""The camera of the base cases."""
PENDING: dict[str, bytes] = {}
"""Cases that the generator has made but not yet written; it writes only after all checks have passed."""


class GoldenError(ValueError):
    """A golden file violates the format."""


def digest(content: bytes) -> str:
    """SHA-256, hex."""
    return hashlib.sha256(content).hexdigest()


def spectra(name: str) -> Json:
    """The content of golden/spectra/<name>.json."""
    return parsed((ROOT / "spectra" / f"{name}.json").read_bytes())


@lru_cache(maxsize=32)
def parsed(text: bytes) -> Json:
    """A file of JSON."""
    parsed: Json = json.loads(text)
    return parsed


def sibling(name: str) -> Json:
    """Another case by its name, from the generator's memory or from the file."""
    path = f"cases/{name}.json"
    return parsed(PENDING[path] if path in PENDING else (ROOT / path).read_bytes())


def chart(name: str) -> Floats:
    """(24, 681) reflectance."""
    return np.array(spectra("charts")["values"][name], float)


def lamp(name: str) -> Floats:
    """(681,) relative power."""
    return np.ones(WAVELENGTHS.size) if name == "equal-energy" else np.array(spectra("lamps")["values"][name], float)


def modes(names: list[str | None]) -> Floats:
    """(k, q, 681) modes of each shot's kind of lamp, zeros if it has none; linear between the 5-nm nodes."""
    known = [np.array(spectra("modes")["values"][name], float) if name else np.zeros((0, 69)) for name in names]
    found = np.zeros((len(names), max(map(len, known)), WAVELENGTHS.size))
    for shot, own in zip(found, known, strict=True):
        shot[: len(own)] = interpolate(own.T).T
    return found


def camera(name: str) -> Floats:
    """(681, 3) curves, linear between the 5-nm nodes."""
    return np.asarray(interpolate(np.array(spectra("cameras")["values"][name], float)))


def resolve(value: Any) -> Any:
    """The value of an input form (format.md, Input forms)."""
    if isinstance(value, dict):
        return _form(value)
    return np.array(_numbers(value), float) if isinstance(value, list) else value


def _form(form: Json) -> Any:
    kind = frozenset(form)
    if kind == {"chart", "patches"}:
        return chart(form["chart"])[np.array(form["patches"], int) - 1]
    if kind == {"lamps"}:
        return np.stack([lamp(name) for name in form["lamps"]])
    if kind == {"constant", "shape"}:
        return np.full(form["shape"], _numbers(form["constant"]), float)
    if kind == {"polynomials"}:
        u, shots = (WAVELENGTHS - 550.0) / 170.0, form["polynomials"]
        powers = [[polyval(u, mode) for mode in shot] for shot in shots]
        return np.array(powers, float).reshape(len(shots), -1, WAVELENGTHS.size)
    if kind == {"modes"}:
        return modes(form["modes"])
    if kind == {"camera"}:
        return camera(form["camera"])
    if kind == {"bells"}:
        return np.stack(
            [sum(h * np.exp(-0.5 * ((WAVELENGTHS - m) / s) ** 2) for h, m, s in c) for c in form["bells"]], axis=1
        )
    raise GoldenError(f"there is no input form with the keys {sorted(form)}")


def _numbers(value: Any) -> Any:
    """The numbers with "NaN" and "Infinity" as floats; JSON has no such numbers."""
    if isinstance(value, list):
        return [_numbers(v) for v in value]
    if isinstance(value, str):
        need(value in ("NaN", "Infinity", "-Infinity"), f"{value!r} is no number")
        return float(value.replace("Infinity", "inf"))
    return value


def need(holds: bool, message: str) -> None:
    """Raise GoldenError with the message unless it holds."""
    if not holds:
        raise GoldenError(message)
