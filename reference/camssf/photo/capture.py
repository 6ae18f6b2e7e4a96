"""Photos and lamps → capture: the measured shots of one chart with one camera, and their documents."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from numbers import Real
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camssf import __version__
from camssf.errors import CalibrationError, FramesDiffer, InvalidArgument
from camssf.evidence.scores import reflectance_srgb
from camssf.evidence.verdict import Reason, Verdict
from camssf.grid import WAVELENGTHS, Floats
from camssf.photo.mosaic import Mosaic, read_dng
from camssf.photo.patches import LENS_SHADING, FrameMeans, PatchMeans, measure_patches
from camssf.photo.pose import LAYOUTS, Pose, find_chart
from camssf.photo.signals import Assumption, normalise
from camssf.spectra import ChartTable, Lamp, read_chart, read_lamp, with_tolerance

MOST_SHOTS, MOST_PATCHES = 64, 1000
LIGHT_SOURCES = {17: "A", 18: "B", 19: "C", 20: "D55", 21: "D65", 22: "D75", 23: "D50"}
"""CIE illuminants by Exif's LightSource codes, as DNG's colour matrices name them."""
PREVIEW = 1200
"""Longest side of a preview, px."""

Json: TypeAlias = dict[str, Any]
Progress: TypeAlias = Callable[[str, float], None]
PathLike: TypeAlias = str | Path


@dataclass(frozen=True)
class Photo:
    """What a frame's file says, without its samples.

    `neutrals`: the camera's white (R, G, B) under the CIE illuminant of each of the file's colour matrices.
    """

    name: str
    width: int
    height: int
    orientation: int
    exposure: float | None
    iso: float | None
    gain_map: bool
    make: str
    model: str
    sha256: str
    neutrals: tuple[tuple[str, tuple[float, ...]], ...] = ()


@dataclass(frozen=True)
class Shot:
    """One measured shot: the chart photo under one lamp, with its frames.

    Attributes:
        lamp: its light.
        photo, white, dark: what the files say; None where there is no frame.
        pose: where the chart lies in the photo.
        means: the patch statistics of all frames.
        thumbnail: (h, w, 3) DN, a sparse sample of the active area for the report; None where it did not travel.
        lens_shading: what was done about the shading that the file describes, of `camssf.photo.patches.LENS_SHADING`.
    """

    lamp: Lamp
    photo: Photo
    white: Photo | None
    dark: Photo | None
    pose: Pose
    means: PatchMeans
    thumbnail: NDArray[np.uint16] | None
    lens_shading: str = "as-stored"


@dataclass
class Begun:
    """What is known so far, for the evidence of a refusal: finished shots, and the one that was in work."""

    shots: list[Shot] = field(default_factory=list)
    table: ChartTable | None = None
    chart: str = ""
    lamp: Lamp | None = None
    photo: Photo | None = None
    saturation: float = 0.0
    pose: Pose | None = None
    picture: bytes | None = None
    files: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Capture:
    """k measured shots of one chart with one camera: what `solve` needs.

    Attributes:
        shots: k of them.
        chart: the chart's table.
        white_reflectance: of the white frame's card, one number; None for a perfect diffuser.
        files: SHA-256 of the lamp and chart files, by role and name; empty where both go by name.
    """

    shots: tuple[Shot, ...]
    chart: ChartTable
    white_reflectance: float | None
    files: dict[str, str] = field(default_factory=dict)

    def document(self) -> Json:
        """The capture as plain data, "camssf-patches/1"; it needs no other file to be solved."""
        return {
            "format": "camssf-patches/1",
            "generator": {"name": "camssf", "version": __version__},
            "chart": _plain(vars(self.chart)),
            "white_reflectance": self.white_reflectance,
            "files": self.files,
            "shots": [
                {
                    "lamp": _plain(vars(shot.lamp)),
                    "photo": vars(shot.photo),
                    "white": vars(shot.white) if shot.white else None,
                    "dark": vars(shot.dark) if shot.dark else None,
                    "pose": _plain(vars(shot.pose)),
                    "lens_shading": shot.lens_shading,
                    "saturation": shot.means.saturation,
                    "black": shot.means.black.tolist(),
                    "means": {
                        frame: _plain(vars(means)) if (means := getattr(shot.means, frame)) else None
                        for frame in ("chart", "white", "dark")
                    },
                }
                for shot in self.shots
            ],
        }

    @staticmethod
    def from_document(document: Json) -> Capture:
        """The capture of a "camssf-patches/1" document.

        Raises:
            InvalidArgument: another format, or a field that is missing or of the wrong kind.
        """
        if not isinstance(document, dict) or document.get("format") != "camssf-patches/1":
            raise InvalidArgument("this is not a camssf-patches/1 document.", "Make one with `camssf patches`.")
        try:
            table = _table_from(document["chart"])
            shots = tuple(_shot_from(entry, len(table.patches)) for entry in document["shots"])
            _need(0 < len(shots) <= MOST_SHOTS, "shots", f"must hold 1 to {MOST_SHOTS}")
            files = {_text(key, "files"): _text(value, "files") for key, value in document["files"].items()}
            _agree(shots)
            return Capture(shots, table, _card(document["white_reflectance"], shots[0].white is not None), files)
        except KeyError as error:
            raise InvalidArgument(
                f"the camssf-patches/1 document lacks {error}.", "Make it anew with `camssf patches`."
            ) from error
        except (TypeError, ValueError, AttributeError, OverflowError) as error:
            raise InvalidArgument(
                f"the camssf-patches/1 document is damaged: {error}.", "Make it anew with `camssf patches`."
            ) from error


def measure(
    photos: PathLike | Sequence[PathLike],
    lamps: str | Lamp | Sequence[str | Lamp],
    *,
    white: PathLike | Sequence[PathLike | None] | None = None,
    dark: PathLike | Sequence[PathLike | None] | None = None,
    chart: str | ChartTable = "classic24",
    corners: Sequence[ArrayLike | None] | None = None,
    white_reflectance: float | None = None,
    lamp_tolerance: str | Sequence[str | None] | None = None,
    lens_shading: str = "as-stored",
    progress: Progress | None = None,
) -> Capture:
    """Read the photos, find the chart and measure its patches; arguments as in `calibrate`."""
    tell = progress or (lambda stage, part: None)
    files = listed("photos", photos)
    if not files:
        raise InvalidArgument("there is no photo.", "Give the DNG of at least one photo of the chart.")
    names = listed("lamps", lamps)
    k = len(files)
    if len(names) != k:
        read_lamp("") if not names else None  # explains why a lamp must be named
        raise InvalidArgument(
            f"{k} photo(s) but {len(names)} lamp(s).", "Give one --lamp a photo, in the same order."
        )
    _need(k <= MOST_SHOTS, "photos", f"must be at most {MOST_SHOTS}")
    whites, darks = _frames("white", white, k), _frames("dark", dark, k)
    places = listed("corners", corners) or [None] * k
    if len(places) != k:
        raise InvalidArgument(f"{k} photo(s) but {len(places)} set(s) of corners.", "Give one set a photo.")
    if len({w is None for w in whites}) > 1:
        raise InvalidArgument(
            "some shots have a white frame and some have none.", "Give a white frame for all shots, or for none."
        )
    known = listed("lamp_tolerance", lamp_tolerance) or [None] * k
    if len(known) != k:
        raise InvalidArgument(f"{k} photo(s) but {len(known)} lamp tolerance(s).", "Give one a photo, or none.")
    card = _card(white_reflectance, whites[0] is not None)
    begun = Begun(chart=chart.name if isinstance(chart, ChartTable) else str(chart))
    with evidence(begun):
        for role, spec in [("chart table", chart), *((f"shot {j + 1}, lamp", lamp) for j, lamp in enumerate(names))]:
            begun.files |= _file(role, spec)
        lights = [lamp if isinstance(lamp, Lamp) else read_lamp(lamp) for lamp in names]
        lights = [with_tolerance(lamp, text) if text else lamp for lamp, text in zip(lights, known, strict=True)]
        begun.table = table = chart if isinstance(chart, ChartTable) else read_chart(chart)
        for j in range(k):
            at = f" {j + 1} of {k}" if k > 1 else ""
            tell(f"reading photo{at}", j / k)
            begun.lamp, begun.photo, begun.pose = lights[j], None, None
            photo = read_dng(files[j])
            begun.photo, begun.saturation = photo_of(photo), photo.white
            tell(f"looking for the chart{at}", (j + 0.4) / k)
            try:
                begun.pose = pose = find_chart(photo, table, corners=places[j])
                tell(f"measuring the patches{at}", (j + 0.7) / k)
                white_file, dark_file = whites[j], darks[j]
                white_frame = None if white_file is None else read_dng(white_file)
                dark_frame = None if dark_file is None else read_dng(dark_file)
                means = measure_patches(photo, pose, white=white_frame, dark=dark_frame, lens_shading=lens_shading)
            except CalibrationError:
                begun.picture = preview(photo)
                raise
            begun.shots.append(
                Shot(
                    lights[j],
                    begun.photo,
                    photo_of(white_frame) if white_frame else None,
                    photo_of(dark_frame) if dark_frame else None,
                    pose,
                    means,
                    _thumbnail(photo),
                    lens_shading,
                )
            )
            begun.lamp = begun.photo = None
        _agree(begun.shots)
    return Capture(tuple(begun.shots), table, card, begun.files)


@contextmanager
def evidence(begun: Begun) -> Iterator[None]:
    """Attach a refused result document, with what was learned until then, to a refusal on its way out."""
    try:
        yield
    except CalibrationError as error:
        if error.evidence is None and not isinstance(error, InvalidArgument):
            reasons = error.reasons or (
                Reason(error.code, error.message, error.advice, error.value, error.threshold),
            )
            error.evidence = head_document(begun, Verdict("refused", reasons), ()) | {
                "basis": "none",
                "engine": "none",
            }
            error.previews = tuple(shot_picture(shot) for shot in begun.shots)
            if begun.photo is not None:
                error.previews += (begun.picture,)
        raise


def head_document(begun: Begun, verdict: Verdict, assumptions: tuple[Assumption, ...]) -> Json:
    """The part of a result document that needs no curves."""
    table = begun.table
    facts = [shot.photo for shot in begun.shots] + ([begun.photo] if begun.photo else [])
    inputs = dict(begun.files)
    for j, photo in enumerate(facts):
        inputs[f"shot {j + 1}, chart: {photo.name}"] = photo.sha256
    for j, shot in enumerate(begun.shots):
        for role, frame in (("white", shot.white), ("dark", shot.dark)):
            if frame is not None:
                inputs[f"shot {j + 1}, {role}: {frame.name}"] = frame.sha256
    shots = [_shot_document(shot, table) for shot in begun.shots] if table else []
    if begun.photo and begun.lamp:
        shots.append(_begun_document(begun, begun.photo, begun.lamp))
    return {
        "format": "camssf-result/1",
        "generator": {"name": "camssf", "version": __version__},
        "camera": {"make": facts[0].make if facts else "", "model": facts[0].model if facts else ""},
        "chart": {
            "name": begun.chart,
            "table": table.table if table else "",
            "layout": table.layout if table else "",
            "source": table.source if table else "",
        },
        "shots": shots,
        "verdict": {"status": verdict.status, "reasons": [vars(reason) for reason in verdict.reasons]},
        "assumptions": [vars(assumption) for assumption in assumptions],
        "hashes": {"inputs": inputs, "model": None},
    }


def _begun_document(begun: Begun, photo: Photo, lamp: Lamp) -> Json:
    """A shot that was not measured to its end."""
    return {
        "lamp": {"name": lamp.name, "tolerance": lamp.tolerance, "source": lamp.source},
        "white_reference": "white patch",
        "dark_reference": "black level",
        "photo": _photo_document(photo),
        "white": None,
        "dark": None,
        "pose": _plain(vars(begun.pose)) if begun.pose else None,
        "saturation": begun.saturation,
        "patches": [],
    }


def _photo_document(photo: Photo) -> Json:
    facts = {key: value for key, value in vars(photo).items() if key not in ("make", "model", "neutrals")}
    return facts | {"camera": " ".join(filter(None, (photo.make, photo.model)))}


def _shot_document(shot: Shot, table: ChartTable) -> Json:
    """One shot without predictions; signals where they can be formed."""
    colours = reflectance_srgb(table)
    means = shot.means
    try:
        signals = normalise([means], table)
        y, error, white, dark = signals.values[0], signals.standard_error[0], signals.white[0], signals.dark[0]
    except CalibrationError:  # the refusal is on its way; show what was measured all the same
        y = error = np.zeros_like(means.chart.mean)
        white = means.white.mean if means.white else np.tile(means.chart.mean[table.white], (len(y), 1))
        dark = means.dark.mean if means.dark else np.tile(means.black, (len(y), 1))
    return {
        "lamp": {"name": shot.lamp.name, "tolerance": shot.lamp.tolerance, "source": shot.lamp.source},
        "white_reference": "white frame" if means.white else "white patch",
        "dark_reference": "dark frame" if means.dark else "black level",
        "photo": _photo_document(shot.photo),
        "white": {"name": shot.white.name, "sha256": shot.white.sha256} if shot.white else None,
        "dark": {"name": shot.dark.name, "sha256": shot.dark.sha256} if shot.dark else None,
        "lens_shading": shot.lens_shading,
        "pose": _plain(vars(shot.pose)),
        "saturation": means.saturation,
        "patches": [
            {
                "name": name,
                "used": False,
                "reflectance_srgb": colours[i].tolist(),
                "measured_srgb": None,
                "synthetic_srgb": None,
                "signal": y[i].tolist(),
                "predicted": None,
                "unseen": None,
                "standard_error": error[i].tolist(),
                "clipped": means.chart.clipped[i].tolist(),
                "dead": means.chart.dead[i].tolist(),
                "gradient": means.chart.gradient[i].tolist(),
                "chart": means.chart.mean[i].tolist(),
                "white": white[i].tolist(),
                "dark": dark[i].tolist(),
            }
            for i, name in enumerate(table.patches)
        ],
    }


def _shot_from(entry: Mapping[str, Any], n: int) -> Shot:
    """One shot of a patches document about n patches."""
    frames = {name: _means_from(entry["means"][name], name, n) for name in ("chart", "white", "dark")}
    photos = {role: _photo_from(entry[role], role) for role in ("photo", "white", "dark")}
    pose, lamp = entry["pose"], entry["lamp"]
    chart, photo = frames["chart"], photos["photo"]
    if chart is None or photo is None:
        raise ValueError("a shot has no chart photo")
    for role in ("white", "dark"):
        _need((frames[role] is None) == (photos[role] is None), role, "must be there as a photo and as means, or not")
    _need(pose["layout"] in LAYOUTS, "pose.layout", "is no layout that camssf knows")
    black, saturation = (
        _numbers(entry["black"], "black", (3,)),
        float(_numbers(entry["saturation"], "saturation", ())),
    )
    _need(bool((saturation > black).all()), "saturation", "must lie above black")
    values = _numbers(lamp["values"], "lamp.values", (WAVELENGTHS.size,))
    modes = np.asarray(lamp["modes"], float).reshape(-1, WAVELENGTHS.size)
    light = Lamp(
        _text(lamp["name"], "lamp.name"),
        values,
        float(_numbers(lamp["tolerance"], "lamp.tolerance", (), least=0.0)),
        _numbers(modes, "lamp.modes", modes.shape),
        _text(lamp["source"], "lamp.source"),
    )
    place = Pose(
        pose["layout"],
        _numbers(pose["corners"], "pose.corners", (4, 2)),
        _numbers(pose["patches"], "pose.patches", (n, 4, 2)),
        int(pose["quarter_turns"]) % 4,
        _text(pose["method"], "pose.method"),
        float(_numbers(pose["score"], "pose.score", ())),
        tuple(_text(note, "pose.notes") for note in pose["notes"]),
    )
    means = PatchMeans(chart, frames["white"], frames["dark"], black, saturation)
    shading = entry.get("lens_shading", LENS_SHADING[0])
    _need(shading in LENS_SHADING, "lens_shading", f"must be {' or '.join(LENS_SHADING)}")
    return Shot(light, photo, photos["white"], photos["dark"], place, means, None, shading)


def _table_from(plain: Mapping[str, Any]) -> ChartTable:
    """The chart table of a patches document."""
    patches = tuple(_text(name, "chart.patches") for name in plain["patches"])
    n = len(patches)
    _need(0 < n <= MOST_PATCHES, "chart.patches", f"must hold 1 to {MOST_PATCHES}")
    white = plain["white"]
    layout = _text(plain["layout"], "chart.layout")
    _need(layout in LAYOUTS, "chart.layout", "is no layout that camssf knows")
    _need(isinstance(white, int) and 0 <= white < n, "chart.white", f"must be a number from 0 to {n - 1}")
    return ChartTable(
        _text(plain["name"], "chart.name"),
        _text(plain["table"], "chart.table"),
        layout,
        patches,
        _numbers(plain["values"], "chart.values", (n, WAVELENGTHS.size), least=0.0, most=2.0),
        _numbers(plain["tolerance"], "chart.tolerance", (n,), least=0.0),
        white,
        _text(plain["source"], "chart.source"),
    )


def _means_from(plain: Mapping[str, Any] | None, name: str, n: int) -> FrameMeans | None:
    if plain is None:
        return None
    least = {"standard_error": 0.0, "count": 1.0, "clipped": 0.0, "dead": 0.0}
    most = {"count": 1e15, "clipped": 1.0, "dead": 1.0}
    fields: dict[str, Any] = {
        key: _numbers(
            plain[key],
            f"{name} {key}",
            (n, 2 if key == "greens" else 3),
            least=least.get(key, -np.inf),
            most=most.get(key, np.inf),
        )
        for key in FrameMeans.__annotations__
    }
    fields["count"] = fields["count"].astype(np.int64)
    return FrameMeans(**fields)


def _photo_from(plain: Mapping[str, Any] | None, role: str) -> Photo | None:
    if plain is None:
        return None
    texts = {key: _text(plain[key], f"{role}.{key}") for key in ("name", "make", "model", "sha256")}
    _need(re.fullmatch("[0-9a-f]{64}", texts["sha256"]) is not None, f"{role}.sha256", "must be 64 hex digits")
    for key in ("width", "height", "orientation"):
        _need(isinstance(plain[key], int) and plain[key] > 0, f"{role}.{key}", "must be a whole number above 0")
    exposure, iso = (
        None if plain[key] is None else float(_numbers(plain[key], f"{role}.{key}", (), least=0.0))
        for key in ("exposure", "iso")
    )
    return Photo(
        width=plain["width"],
        height=plain["height"],
        orientation=plain["orientation"],
        gain_map=bool(plain["gain_map"]),
        neutrals=tuple(
            (_light_source(name), tuple(_numbers(white, f"{role}.neutrals", (3,), least=1e-6).tolist()))
            for name, white in plain.get("neutrals", ())
        ),
        exposure=exposure,
        iso=iso,
        **texts,
    )


def _light_source(name: Any) -> str:
    _need(name in LIGHT_SOURCES.values(), "neutrals", f"must be of one of {', '.join(LIGHT_SOURCES.values())}")
    return str(name)


def _numbers(
    value: Any, name: str, shape: tuple[int, ...], *, least: float = -np.inf, most: float = np.inf
) -> Floats:
    array = np.asarray(value, dtype=np.float64)
    _need(array.shape == shape, name, f"has shape {array.shape}, not {shape}")
    _need(bool(np.isfinite(array).all()), name, "is not finite")
    _need(bool((array >= least).all() and (array <= most).all()), name, f"must lie between {least:g} and {most:g}")
    return array


def _text(value: Any, name: str) -> str:
    _need(isinstance(value, str) and len(value) <= 4096, name, "must be a short text")
    return str(value)


def _need(right: bool, name: str, what: str) -> None:
    if not right:
        raise InvalidArgument(f"{name} {what}.", "Correct it, or make the document anew with `camssf patches`.")


def _plain(fields: Mapping[str, Any]) -> Json:
    return {
        key: value.tolist() if isinstance(value, np.ndarray) else list(value) if isinstance(value, tuple) else value
        for key, value in fields.items()
    }


def photo_of(mosaic: Mosaic) -> Photo:
    """What the file of a photo says, without its samples."""
    height, width = mosaic.samples.shape
    return Photo(
        Path(mosaic.path).name, width, height, mosaic.orientation, mosaic.exposure, mosaic.iso, mosaic.gain_map,
        mosaic.make, mosaic.model, mosaic.sha256,
        tuple((LIGHT_SOURCES[code], tuple(white.tolist())) for code, white in mosaic.neutrals),
    )  # fmt: skip


def _thumbnail(mosaic: Mosaic) -> NDArray[np.uint16]:
    """Every so many cells of the mosaic as (h, w, 3) DN: cheap now, a picture when somebody asks."""
    height, width = mosaic.samples.shape
    step = 2 * max(1, -(-max(height, width) // (2 * PREVIEW)))
    rows, columns = (height - 1) // step, (width - 1) // step
    picture = np.empty((rows, columns, 3), np.uint16)
    for position in range(4):
        y, x = divmod(position, 2)  # of the two greens the lower one stays
        picture[:, :, "RGB".index(mosaic.cfa[position])] = mosaic.samples[y::step, x::step][:rows, :columns]
    return picture


def preview(mosaic: Mosaic) -> bytes | None:
    """A JPEG of a photo's active area for the report, as the sensor saw it."""
    cells = [mosaic.black[divmod(mosaic.cfa.index(colour), 2)] for colour in "RGB"]
    return _encode(_thumbnail(mosaic), np.array(cells), mosaic.white)


def shot_picture(shot: Shot) -> bytes | None:
    """A JPEG of the shot's photo for the report; None where its samples did not travel."""
    return None if shot.thumbnail is None else _encode(shot.thumbnail, shot.means.black, shot.means.saturation)


def _encode(thumbnail: NDArray[np.uint16], black: Floats, saturation: float) -> bytes | None:
    """A display-like picture, white-balanced on its brightest parts."""
    import cv2

    picture = np.maximum(thumbnail - black, 0.0) / (saturation - black)
    top = np.maximum(np.percentile(picture[::2, ::2], 99, axis=(0, 1)), 1e-6)
    display = (255.0 * np.clip(picture / top, 0.0, 1.0) ** (1 / 2.2) + 0.5).astype(np.uint8)
    done, data = cv2.imencode(".jpg", display[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 85])
    return bytes(data) if done else None


def listed(name: str, value: Any) -> list[Any]:
    """One value or a sequence of them, as a list."""
    if isinstance(value, str | Path | Lamp):
        return [value]
    try:
        return [] if value is None else list(value)
    except TypeError as error:
        raise InvalidArgument(f"{name} is {value!r}, no list.", "Give one a shot, in the shots' order.") from error


def _frames(word: str, value: Any, k: int) -> list[PathLike | None]:
    frames = listed(word, value) or [None] * k
    if len(frames) != k:
        raise InvalidArgument(
            f"{k} photo(s) but {len(frames)} {word} frame(s).",
            f"Give one --{word} a photo; write `none` for a photo without.",
        )
    return frames


def _card(share: Any, framed: bool) -> float | None:
    """The white frame's reflectance, checked."""
    if share is None:
        return None
    if isinstance(share, bool) or not isinstance(share, Real) or not 0.05 <= float(share) <= 1.2:
        raise InvalidArgument(f"a white card of reflectance {share} is none.", "Write 95 % as 0.95.")
    if not framed:
        raise InvalidArgument(
            "a white card's reflectance was given, but no white frame.", "Give the white frame, or leave it out."
        )
    return float(share)


def _agree(shots: Sequence[Shot]) -> None:
    """Raise unless one camera took all shots, each another photo, and all or none have a white frame."""
    hashes = [shot.photo.sha256 for shot in shots]
    twice = [shot.photo.name for shot in shots if hashes.count(shot.photo.sha256) > 1]
    if twice:
        raise InvalidArgument(
            f"{twice[0]} was given {len(twice)} times: one photo is one piece of evidence.",
            "Give each photo once; a second shot is another photo, best under another lamp.",
        )
    bodies = {(shot.photo.make, shot.photo.model) for shot in shots}
    if len(bodies) > 1:
        raise FramesDiffer(
            f"the photos come from different cameras: {', '.join(sorted(' '.join(b) for b in bodies))}.",
            "Calibrate one camera at a time; `camssf batch` takes many.",
        )
    _need(len({shot.white is None for shot in shots}) == 1, "white", "must be there for all shots or for none")


def _file(role: str, spec: Any) -> dict[str, str]:
    """SHA-256 of the file behind a lamp or chart spec, if there is one."""
    text = str(spec) if isinstance(spec, str | Path) else ""
    for name in (text, text.partition(":")[2]):
        try:
            if name and Path(name).is_file():
                return {f"{role}: {Path(name).name}": hashlib.sha256(Path(name).read_bytes()).hexdigest()}
        except (OSError, ValueError):
            continue  # whoever reads it says what is wrong
    return {}
