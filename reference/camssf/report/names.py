"""Names of a result's camera and lamps, on one line and shortened, because they come from files."""

from __future__ import annotations

from camssf.documents.document import Document
from camssf.documents.unnamed_light import lamp_name

LONGEST = 60
"""Largest number of characters of a name."""


def camera_of(document: Document) -> str:
    """Make and model; the make is not repeated. "camera" if the files state neither."""
    photos = () if document.capture is None else document.capture.photos
    make, model = (photos[0].make, photos[0].model) if photos else ("", "")
    words = model if model.casefold().startswith(make.casefold()) else f"{make} {model}"
    return short(words) or "camera"


def lamps_of(document: Document) -> str:
    """Names of the shots' lamps."""
    lights = () if document.capture is None else document.capture.lights
    names = [short(lamp_name(light)) for light in lights]
    return " + ".join(names[:4]) + (f" + {len(names) - 4} more" if len(names) > 4 else "") or "no photo"


def short(text: str) -> str:
    """The text on one line and shortened."""
    words = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    return words if len(words) <= LONGEST else f"{words[: LONGEST - 3]}..."
