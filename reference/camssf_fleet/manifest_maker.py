"""Writes the manifest of a folder of photos that are named by camera and lamp: UNIT_LAMP.dng, UNIT_LAMP_2.dng ..."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from pathlib import Path

from camssf.errors import InvalidArgument
from camssf.files import error_in_words, local_folder, read_advice, readable, write_file
from camssf.photo.read.unit import sidecar_of
from camssf.spectra.lamps import is_lamp_name
from camssf_fleet.manifest import COLUMNS

MANIFEST = "manifest.csv"
ENDINGS = (".dng", ".nef", ".cr2", ".cr3", ".arw", ".raf", ".orf", ".rw2", ".pef")
"""Of RAW photos (docs/raw.md); a picture counts if it has a sidecar."""
FRAMES = ("white", "dark")
"""Last parts of the names of frames."""
MOST_FAULTS = 10
"""Largest number of photos that an error names."""


@dataclass(frozen=True)
class _Photo:
    """What the name of a photo says; `frame` is "chart", or one of FRAMES."""

    name: str
    unit: str
    lamp: str
    frame: str

    @property
    def place(self) -> tuple[str, str]:
        """What a frame has in common with its chart photos."""
        return self.unit, self.lamp.casefold()


def make_manifest(folder: Path | str) -> int:
    """Write FOLDER/manifest.csv; its photos are those in the folder itself. Returns the number of rows.

    A name is UNIT_LAMP, with or without `_` and any text behind. LAMP is a known name, or X where X.csv is in the
    folder; of several places where it may stand the last one counts. UNIT_LAMP_white and UNIT_LAMP_dark are the
    frames of that lamp. UNIT is the camera's name and serial number; its photos are the shots of one name.

    Raises:
        InvalidArgument: the folder cannot be read, has a manifest, or has a photo with another name.
    """
    folder = local_folder(folder)
    path = folder / MANIFEST
    if path.exists():
        raise InvalidArgument(f"{path} exists; it was not changed.", "Move it away, or name it to `camssf batch`.")
    try:
        files = sorted(file for file in folder.iterdir() if file.is_file())
    except OSError as error:
        raise InvalidArgument(f"{folder} cannot be read ({error_in_words(error)}).", read_advice(error)) from error
    spectra = {file.stem.casefold(): file.name for file in files if file.suffix.casefold() == ".csv"}
    raw = (file for file in files if file.suffix.casefold() in ENDINGS or sidecar_of(file))
    photos = {file.name: _parsed(file, spectra) for file in raw}
    charts = [photo for photo in photos.values() if photo is not None and photo.frame == "chart"]
    frames: dict[tuple[str, str, str], str] = {}
    faults = [] if charts else [f"{folder} has no photo of a chart"]
    for name, photo in photos.items():
        if photo is None:
            faults.append(f"{name} does not name a lamp, as UNIT_LAMP{Path(name).suffix} does")
        elif photo.frame in FRAMES:
            if frames.setdefault((*photo.place, photo.frame), name) != name:
                faults.append(f"{name} is a second {photo.frame} frame of {photo.unit} under {photo.lamp}")
            if photo.place not in {chart.place for chart in charts}:
                faults.append(f"{name} is a {photo.frame} frame, but {photo.unit} has no photo under {photo.lamp}")
    if faults:
        more = f"; and {len(faults) - MOST_FAULTS} more" if len(faults) > MOST_FAULTS else ""
        raise InvalidArgument(
            f"{'; '.join(faults[:MOST_FAULTS])}{more}. Nothing was written.",
            "Name each photo UNIT_LAMP, as S1_daylight.dng; `camssf lamps` lists the names of lamps.",
        )
    rows = csv.writer(text := io.StringIO(), lineterminator="\n")
    rows.writerow((*COLUMNS, "serial"))
    for photo in sorted(charts, key=lambda photo: (photo.unit, photo.name)):
        white, dark = (frames.get((*photo.place, frame), "") for frame in FRAMES)
        rows.writerow((photo.unit, photo.name, photo.lamp, white, dark, "", photo.unit))
    write_file(path, text.getvalue())
    return len(charts)


def _parsed(file: Path, spectra: dict[str, str]) -> _Photo | None:
    """The parts of a name; None without a lamp.

    Args:
        file: the photo.
        spectra: names of the folder's spectrum files, by their names without ending in lower case.
    """
    parts = file.stem.split("_")
    frame = parts.pop().casefold() if parts[-1].casefold() in FRAMES else "chart"
    for at in range(len(parts) - 1, 0, -1):
        unit, lamp = "_".join(parts[:at]), parts[at]
        if not is_lamp_name(lamp):
            rest = ("_".join(parts[at:end]).casefold() for end in range(len(parts), at, -1))
            lamp = next((spectra[stem] for stem in rest if stem in spectra), "")
        if unit and lamp and readable(file.name) == file.name:
            return _Photo(file.name, unit, lamp, frame)
    return None
