"""Reads and checks arguments of the command line, standard input and files."""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Sequence
from datetime import datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

from camssf.errors import CalibrationError, InvalidArgument
from camssf.files import PHOTO, check_local, error_in_words, local, read_advice
from camssf.places import check_place, is_remote, place, reached

if TYPE_CHECKING:
    from camssf.documents.document import Document
    from camssf.documents.excerpt import Excerpt
    from camssf.options import Options
    from camssf.photo.shot import Shot
    from camssf.result import Result
    from camssf.spectra import ChartTable

CORNERS = "camssf-corners/1"
LARGEST_CORNERS = 1 << 20
"""Bytes; enough for four points in each of thousands of photos."""


def given_paths(paths: list[str], *, remote: bool = False) -> list[str]:
    """The paths, checked not to be URLs, if `remote` but those of object stores."""
    for path in paths:
        (check_place if remote else check_local)(path)
    return paths


def spare(out: Path, *sources: str | Path) -> Path:
    """The file to write, checked not to overwrite an input, a photo, or a file of a result in its folder.

    Raises:
        InvalidArgument: it would overwrite one.
    """
    from camssf.report.build import NAMES

    if out.name in NAMES and (out.parent / NAMES[0]).is_file():
        raise InvalidArgument(f"{out} belongs to the result in {out.parent}.", "Name another file.")
    for source in sources:
        try:
            same = str(source) != "-" and out.samefile(source)
        except OSError:  # one of the two does not exist
            same = False
        if same:
            raise InvalidArgument(
                f"{out} is an input of this command and would be overwritten.", "Name another file."
            )
    if os.path.isfile(out):
        with open(out, "rb") as stream:
            photo = stream.read(4) in PHOTO
        if photo:
            raise InvalidArgument(f"{out} is a photo (DNG or TIFF) and would be overwritten.", "Name another file.")
    return out


def given_frames(paths: list[str] | None) -> list[str | None]:
    """The paths, with None for the word `none`."""
    return [None if path.casefold() == "none" else path for path in given_paths(paths or [])]


def parse_shots(
    photos: list[str],
    lamps: list[str] | None,
    white: list[str] | None,
    dark: list[str] | None,
    *,
    corners: list[str] | None,
    lamp_tolerance: list[str] | None,
    lens_shading: str,
) -> list[Shot]:
    """One shot for each photo, from options that are repeated in the photos' order.

    Raises:
        InvalidArgument: another number of values than of photos.
    """
    from camssf.photo.shot import Shot
    from camssf.spectra.lamps import AUTO

    k = len(given_paths(photos))
    if lamps and len(lamps) != k:
        raise InvalidArgument(
            f"{k} photo(s) ({', '.join(photos)}) but {len(lamps)} lamp(s) ({', '.join(lamps)}).",
            "Give one --lamp a photo, in the same order, or none at all; quote a name with spaces.",
        )
    whites, darks = _frames("white", white, k), _frames("dark", dark, k)
    places = _parse_corners(corners, photos)
    if len(places) != k:
        raise InvalidArgument(f"{k} photo(s) but {len(places)} set(s) of corners.", "Give one set a photo.")
    tolerances: Sequence[str | None] = lamp_tolerance or [None] * k
    if len(tolerances) != k:
        raise InvalidArgument(f"{k} photo(s) but {len(tolerances)} lamp tolerance(s).", "Give one a photo, or none.")
    return [
        Shot(photo, lamp, whites[j], darks[j], places[j], tolerances[j], lens_shading)
        for j, (photo, lamp) in enumerate(zip(photos, lamps or [AUTO] * k, strict=True))
    ]


def parse_chart(chart: str, tolerance: str | None) -> str | ChartTable:
    """The chart as given, or its table with `--chart-tolerance`.

    Raises:
        CalibrationError: as `read_chart` and `ChartTable.with_tolerance`.
    """
    from camssf.spectra import read_chart

    given = parse_percent("--chart-tolerance", tolerance)
    return chart if given is None else read_chart(chart).with_tolerance(given)


def parse_options(
    *,
    white_reflectance: str | None = None,
    fit: str | None = None,
    signed: bool = False,
    light_per_patch: str | None = None,
    **others: Any,
) -> Options:
    """The options of a calibration; `others` are fields of `Options` that are no texts to be parsed.

    Raises:
        InvalidArgument: a text is not a share, a list of patches or a percentage.
    """
    from camssf.options import Options

    return Options(
        white_reflectance=parse_share(white_reflectance),
        fit=parse_patches(fit),
        nonnegative=False if signed else None,
        light_per_patch=parse_percent("--light-per-patch", light_per_patch),
        **others,
    )


def _frames(word: str, paths: list[str] | None, k: int) -> list[str | None]:
    """The paths of k frames, None where there is none."""
    frames = given_frames(paths)
    if frames and len(frames) != k:
        raise InvalidArgument(
            f"{k} photo(s) but {len(frames)} {word} frame(s).",
            f"Give one --{word} a photo; write `none` for a photo without.",
        )
    return frames or [None] * k


def _parse_corners(texts: list[str] | None, photos: list[str]) -> list[Any]:
    """(4, 2) corners for each photo, None for the word `none`; a single .json file applies to all photos."""
    if not texts:
        return [None] * len(photos)
    if len(texts) == 1 and _names_a_file(texts[0]):
        texts = texts * len(photos)
    named = [*photos, *[""] * len(texts)]  # too many corners are reported by `parse_shots`
    return [_corners(text, photo) for text, photo in zip(texts, named, strict=False)]


def _names_a_file(text: str) -> bool:
    return text.casefold().endswith(".json")


def _corners(text: str, photo: str) -> Any:
    if text.casefold() == "none":
        return None
    return _stored(text, Path(photo).name) if _names_a_file(text) else _four(text)


def _stored(path: str, photo: str) -> list[list[float]]:
    """The corners of a photo from a file in the format CORNERS, as `simulate` writes it."""
    try:
        with open(local(path), "rb") as stream:
            content = stream.read(LARGEST_CORNERS + 1)
    except OSError as error:
        raise InvalidArgument(
            f"Cannot read the corners in {path}: {error.strerror or error}.",
            "Give four points, or the corners.json of `camssf simulate`.",
        ) from error
    try:
        if len(content) > LARGEST_CORNERS:
            raise ValueError
        document = json.loads(content)
        if document["format"] != CORNERS:
            raise ValueError
        known = document["photos"].get(photo)
        points = known and [[float(number) for number in point] for point in known["corners"]]
        if points is not None and [len(point) for point in points] != [2] * 4:
            raise ValueError
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise InvalidArgument(
            f"{path} holds no corners of the form {CORNERS}.",
            "Give four points, or the corners.json of `camssf simulate`.",
        ) from error
    if points is None:
        raise InvalidArgument(
            f"{path} names no photo {photo}.",
            "Photos are identified by their file names. Give the file that belongs to this photo.",
        )
    return points


def _four(text: str) -> list[list[float]]:
    try:
        points = [[float(number) for number in point.split(",")] for point in text.split()]
    except ValueError:
        points = []
    if len(points) != 4 or any(len(point) != 2 for point in points):
        raise InvalidArgument(
            f"--corners {text!r} is not four points.",
            "Write the chart's top left, top right, bottom right, bottom left, as in "
            '--corners "10,20 300,22 298,210 12,208".',
        )
    return points


def parse_patches(text: str | None) -> tuple[int, ...] | None:
    """Patch numbers (from 1) from `7-18` or `1,4,7-18`."""
    if text is None:
        return None
    numbers: dict[int, None] = {}
    for part in text.split(","):
        match = re.fullmatch(r"\s*(\d{1,3})\s*(?:-\s*(\d{1,3})\s*)?", part)  # no chart has 1000 patches
        first, last = (int(match[1]), int(match[2] or match[1])) if match else (1, 0)
        if first > last:
            shown = text if len(text) <= 40 else f"{text[:40]}..."
            raise InvalidArgument(f"--fit {shown!r} is not a list of patches.", "Write 7-18, or 1,4,7-18.")
        numbers.update(dict.fromkeys(range(first, last + 1)))
    return tuple(numbers)


def parse_share(text: str | None) -> float | None:
    """A reflectance as a number; its range is checked later."""
    if text is None:
        return None
    try:
        return float(text)
    except ValueError:
        raise InvalidArgument(
            f"--white-reflectance {text!r} is not a number.",
            "Write the target's reflectance, for example 0.95.",
        ) from None


def parse_percent(option: str, text: str | None) -> float | None:
    """0.08 from `8%` or `0.08`; the range is checked later."""
    if text is None:
        return None
    try:
        return float(text.removesuffix("%")) / (100.0 if text.endswith("%") else 1.0)
    except ValueError:
        raise InvalidArgument(f"{option} {text!r} is not a share.", "Write 8 % as 8%.") from None


def parse_rectangle(option: str, text: str) -> tuple[float, float, float, float]:
    """A rectangle from `x,y,w,h`, px."""
    try:
        x, y, w, h = (float(number) for number in text.split(","))
    except ValueError:
        raise InvalidArgument(
            f"{option} {text!r} is not a rectangle.", "Write x,y,width,height in pixels, as in 640,480,40,40."
        ) from None
    return x, y, w, h


def parse_size(text: str) -> tuple[int, int]:
    """Width and height, px, from `4000x3000`."""
    match = re.fullmatch(r"(\d{1,9})x(\d{1,9})", text.casefold())
    if not match:
        raise InvalidArgument(f"--size {text!r} is not a size.", "Write width x height, for example 4000x3000.")
    return int(match[1]), int(match[2])


def read_bytes(source: str, most: int, fault: type[CalibrationError] = InvalidArgument) -> bytes:
    """The bytes of a file or of stdin; raises `fault` if they are empty or more than `most`."""
    name = name_of(source)
    try:
        if source == "-":
            if sys.stdin is None:
                raise InvalidArgument(
                    "Standard input is closed.", "Name a file, or pipe the output of another camssf command."
                )
            data = sys.stdin.buffer.read(most + 1)
        elif is_remote(source):
            with reached(place(source), "read"), place(source).open("rb") as file:
                data = file.read(most + 1)
        else:
            with open(local(source), "rb") as file:
                data = file.read(most + 1)
    except IsADirectoryError:
        raise InvalidArgument(f"{name} is a folder, not a file.", "Name the files in it, as folder/*.json.") from None
    except (OSError, ValueError) as error:  # ValueError: a path with a zero byte
        raise InvalidArgument(f"Cannot read {name}: {error_in_words(error)}.", read_advice(error)) from None
    if len(data) > most:
        raise fault(f"{name} is larger than {most} bytes.", "Give what camssf wrote.")
    if not data.strip():
        raise fault(f"{name} is empty.", "See what the command before the pipe said.")
    return data


def read_document(source: str) -> Document:
    """A document in a file or on stdin: a `Result` if it has a verdict, else a capture."""
    from camssf.documents.document import ADVICE, Document
    from camssf.documents.forms import from_plain
    from camssf.result import Result

    plain, name = _plain(source), name_of(source)
    return from_plain(plain, Result if isinstance(plain, dict) and "verdict" in plain else Document, name, ADVICE)


def read_result(source: str) -> Result:
    """A result in a file or on stdin."""
    return read_result_bytes(source)[0]


def read_result_bytes(source: str) -> tuple[Result, bytes]:
    """A result in a file or on stdin, and its bytes."""
    from camssf.documents.forms import LARGEST

    data = read_bytes(source, LARGEST)
    return result_of(_parsed(data, source), name_of(source)), data


def read_signed(source: str) -> Result | Excerpt:
    """A result, or the excerpt that `camssf passport verify` printed."""
    from camssf.documents.excerpt import holds_excerpt
    from camssf.libraries import RESULTS, extension

    plain = _plain(source)
    if holds_excerpt(plain):
        excerpt: Excerpt = extension(RESULTS, "passport").read_excerpt(plain, name_of(source))
        return excerpt
    return result_of(plain, name_of(source))


def _plain(source: str) -> Any:
    from camssf.documents.forms import LARGEST

    return _parsed(read_bytes(source, LARGEST), source)


def _parsed(data: bytes, source: str) -> Any:
    from camssf.documents.document import ADVICE
    from camssf.documents.forms import parse_json

    name = name_of(source)
    if data.count(b".") == 2 and re.fullmatch(rb"[\w.-]+", data):
        advice = "Give what `camssf passport verify` printed; it holds the passport, too."
        raise InvalidArgument(f"{name} is a passport, not a result.", advice)
    return parse_json(data, name, ADVICE)


def result_of(plain: Any, name: str) -> Result:
    """A parsed result.

    Raises:
        InvalidArgument: no result; of a passport's excerpt and of a capture it is said what they are.
    """
    from camssf.documents.document import ADVICE, FORMAT
    from camssf.documents.excerpt import check_whole
    from camssf.documents.forms import from_plain
    from camssf.result import Result

    check_whole(plain, name)
    if isinstance(plain, dict) and plain.get("format") == FORMAT and "verdict" not in plain:
        raise InvalidArgument(f"{name} is a capture that was not solved.", "Solve it first: `camssf solve`.")
    return from_plain(plain, Result, name, ADVICE)


def name_of(source: str) -> str:
    """The name of a file, or of standard input, for messages."""
    return "standard input" if source == "-" else source


def parse_time(text: str | None) -> datetime | None:
    """A time from ISO 8601; without an offset it is local time."""
    if text is None:
        return None
    try:
        return datetime.fromisoformat(text).astimezone()
    except (ValueError, OverflowError):
        raise InvalidArgument(f"{text!r} is not a time.", "Write ISO 8601, as 2026-11-22T10:30:00+01:00.") from None


def check_captured(text: str) -> None:
    """Check that a time is not in the future, with a tolerance of one day for time zones and clocks; "" passes.

    Raises:
        InvalidArgument: the text is not a time, or it is in the future.
    """
    time = parse_time(text or None)
    if time is not None and time > datetime.now().astimezone() + timedelta(days=1):
        raise InvalidArgument(f"The photo's time {text} lies in the future.", "Give the time at which it was taken.")


def read_previews(result: Result, photos: list[str]) -> list[bytes | None]:
    """Previews of the shots from the photos; each must be the file that the result was made from."""
    from camssf.photo.read.raw import read_raw
    from camssf.report.previews import photo_preview

    known, previews = () if result.capture is None else result.capture.photos, []
    if len(photos) > len(known):
        raise InvalidArgument(
            f"{len(photos)} photos for {len(known)} shots.", "Give --photo once a shot, in the shots' order."
        )
    for path, photo in zip(given_paths(photos), known, strict=False):
        mosaic = read_raw(path)
        if mosaic.sha256 != photo.sha256:
            raise InvalidArgument(
                f"{path} is not the photo that this result was made from ({photo.name}).",
                "Give the same file, or leave --photo out.",
            )
        previews.append(photo_preview(mosaic))
    return previews
