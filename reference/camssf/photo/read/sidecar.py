"""Treats a picture of the mosaic and its sidecar file as one photo with one hash."""

from __future__ import annotations

import hashlib
from pathlib import Path

from camssf.places import PICTURES

PIECE = 1 << 20
"""Bytes read at a time."""


def sidecar_of(path: Path) -> Path | None:
    """The sidecar with pattern and levels of a picture; None if there is none, or `path` is no picture."""
    if path.suffix.casefold() not in PICTURES:
        return None
    sidecar = path.with_name(f"{path.name}.json")
    return sidecar if sidecar.is_file() else None


def photo_hash(path: Path | str) -> str:
    """SHA-256 of a photo: of its file, or of a picture followed by its sidecar (`cat photo.png photo.png.json`)."""
    found, sidecar = hashlib.sha256(), sidecar_of(Path(path))
    for each in (Path(path), *(() if sidecar is None else (sidecar,))):
        with each.open("rb") as stream:
            while piece := stream.read(PIECE):
                found.update(piece)
    return found.hexdigest()
