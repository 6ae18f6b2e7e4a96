"""Direct measurement (the paper's Sec. 4): no chart, no prior, but a spectrograph or a monochromator.

**Spectrograph.** The colour camera and a mono camera of known response photograph the same spectrum of sunlight in
turn. Each frame is calibrated in wavelength by the Fraunhofer lines in it (`camssf.dispersion`); then the light, the
grating and the lens cancel, Eq. (12):

    S(λ) = S_mono(λ) · [I(λ) / |dλ/dx|] / [I_mono(λ) / |dλ/dx|_mono]

The brackets turn signal a pixel into signal a nanometre: the two cameras need not have the same pixels.

**Monochromator.** A sweep of lines of known power P needs no more than S(λ) = I(λ) / P(λ).
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from camssf import __version__
from camssf.dispersion import Dispersion, disperse, fine_structure
from camssf.errors import FramesDiffer, InvalidArgument, Overexposed, Underexposed, UnreadableRaw
from camssf.files import write_files
from camssf.grid import WAVELENGTHS, Floats
from camssf.mosaic import Mosaic, read_dng

PathLike: TypeAlias = str | Path
Progress: TypeAlias = Callable[[str, float], None]
Json: TypeAlias = dict[str, Any]

CHANNELS = ("red", "green", "blue")
FIRST, LAST = 400.0, 700.0
"""Both frames, or a sweep, must cover these, nm."""
FAINTEST = 0.004
"""Where the mono camera's signal a nm falls below this share of its largest, there is no light to divide by."""
LARGEST_STEP = 20.0
"""Of a sweep, nm."""
_CLIPPED = 0.002
_LEAST_CONTRAST = 20.0
_LEAN = 0.15
_LARGEST = 64 * 2**20
_DENSEST = 2000
"""Bytes that a byte of a TIFF may stand for; deflate reaches 1032, LZW 1365."""


@dataclass(frozen=True)
class Spectrum:
    """What one camera recorded of the spectrum, channel by channel.

    Attributes:
        name: of the file.
        pixel: (c) positions along the spectrum, (w,) each, px.
        signal: (c) mean signals there, (w,) each, DN.
        error: (c) their standard errors; None of a table.
        tilt: of the spectral lines against the columns, degrees.
        black: in words, what was taken for no light.
    """

    name: str
    pixel: tuple[Floats, ...]
    signal: tuple[Floats, ...]
    error: tuple[Floats, ...] | None
    tilt: float
    black: str


@dataclass(frozen=True)
class Direct:
    """The measured curves. Columns are R, G, B.

    Attributes:
        values: (681, 3) response, relative, one scale for the three channels; 0 where nothing was measured.
        std: (681, 3) its standard error from the scatter of the pixels; None of a sweep or a table.
        covered: (first, last) wavelength that was measured, nm.
        camera: (make, model), empty where the file is silent.
        dispersions: by role, "rgb" and "mono"; empty of a sweep.
        tilts: of the lines, degrees, by role.
        assumptions: (code, message) of all that was taken for granted.
        files: name and SHA-256 of each, by role.
    """

    values: Floats
    std: Floats | None
    covered: tuple[float, float]
    camera: tuple[str, str]
    dispersions: dict[str, Dispersion]
    tilts: dict[str, float]
    assumptions: tuple[tuple[str, str], ...]
    files: dict[str, tuple[str, str]]

    def document(self) -> Json:
        """As plain data, "camssf-direct/1": `ssf` and `ssf_std` as in camssf-result/1, peak 1."""
        peak = self.values.max(axis=0)
        return {
            "format": "camssf-direct/1",
            "generator": {"name": "camssf", "version": __version__},
            "camera": dict(zip(("make", "model"), self.camera, strict=True)),
            "covered_nm": list(self.covered),
            "ssf": _curves(self.values / peak),
            "ssf_std": None if self.std is None else _curves(self.std / peak),
            "channel_gain": (peak / peak[1]).tolist(),
            "wavelengths": {
                role: {
                    "residual_nm": found.residual,
                    "likeness": found.likeness,
                    "tilt_degrees": self.tilts[role],
                    "polynomial": {
                        "middle_px": found.middle,
                        "half_px": found.half,
                        "coefficients_nm": found.coefficients.tolist(),
                    },
                    "lines": [
                        {
                            "name": line.name,
                            "table_nm": line.nm,
                            "pixel": line.pixel,
                            "fitted_nm": line.fitted,
                            "residual_nm": line.residual,
                        }
                        for line in found.lines
                    ],
                }
                for role, found in self.dispersions.items()
            },
            "assumptions": [{"code": code, "message": message} for code, message in self.assumptions],
            "files": {role: {"name": name, "sha256": sha256} for role, (name, sha256) in self.files.items()},
        }

    def save(self, folder: PathLike) -> list[Path]:
        """Leave direct.json and ssf.csv (as `camssf calibrate` writes it) in `folder`, both or none.

        Raises:
            InvalidArgument: the folder cannot be written to.
        """
        document = self.document()
        columns = [WAVELENGTHS, *(np.array(document["ssf"][c]) for c in CHANNELS)]
        head = ["wavelength_nm", *CHANNELS]
        if document["ssf_std"]:
            columns += [np.array(document["ssf_std"][c]) for c in CHANNELS]
            head += [f"{c}_std" for c in CHANNELS]
        rows = [",".join([f"{row[0]:.1f}", *(f"{v:.9f}" for v in row[1:])]) for row in zip(*columns, strict=True)]
        texts = {
            "direct.json": json.dumps(document, ensure_ascii=False, allow_nan=False) + "\n",
            "ssf.csv": "\n".join([",".join(head), *rows, ""]),
        }
        return write_files(folder, texts)


def divide(
    rgb: PathLike,
    mono: PathLike,
    *,
    dark: PathLike | None = None,
    mono_dark: PathLike | None = None,
    response: PathLike | None = None,
    progress: Progress | None = None,
) -> Direct:
    """Eq. (12): the colour camera's frame of the spectrum by the mono camera's.

    The spectrum lies along the rows, either way round; the slit's image may lean a few degrees.

    Args:
        rgb: DNG of the colour camera, or a CSV pixel,red,green,blue of a spectrum already extracted.
        mono: of the mono camera: a grey TIFF (8 or 16 bits), a DNG whose samples are all alike, or a CSV
            pixel,signal.
        dark, mono_dark: frames without light, same exposure; without, the file's black level or the rows beside the
            spectrum.
        response: CSV wavelength_nm,response of the mono camera (with its lens and grating, if those differ between
            the cameras), any scale; None takes it for flat.
        progress: told (stage, share).

    Raises:
        LampUnfit: a frame with too few Fraunhofer lines.
        Overexposed, Underexposed: a frame.
        FramesDiffer: a dark frame of another size or brighter than its frame, or frames of different wavelengths.
        UnreadableRaw, UnsupportedRaw, NotSensorRaw, InvalidArgument: a file.
    """
    tell = progress or (lambda stage, part: None)
    tell("reading the frames", 0.0)
    colour, camera = _read(rgb, dark, 3)
    grey, _ = _read(mono, mono_dark, 1)
    known: tuple[Floats, Floats] | None = None
    if response is not None:
        table, level = _read_columns(response, ("wavelength_nm", "response"))
        if level.min() <= 0:
            raise InvalidArgument(
                f"{response} has a response of 0 or less, at {table[np.argmin(level)]:g} nm.",
                "Leave out the wavelengths that the mono camera does not see.",
            )
        known = (table, level)
    found = {}
    for part, (role, spectrum) in zip((0.3, 0.6), (("rgb", colour), ("mono", grey)), strict=True):
        tell(f"looking for lines in {spectrum.name}", part)
        found[role] = disperse(*_together(spectrum), name=spectrum.name)
    tell("dividing", 0.9)
    signals, errors, ends = [], [], []
    for spectrum, dispersion in ((colour, found["rgb"]), (grey, found["mono"])):
        density = [_per_nanometre(spectrum, c, dispersion) for c in range(len(spectrum.pixel))]
        signals.append(np.stack([value for value, _, _ in density], axis=1))
        errors.append(np.stack([error for _, error, _ in density], axis=1))
        ends.append((max(e[0] for _, _, e in density), min(e[1] for _, _, e in density)))
    light, light_error = signals[1][:, :1], errors[1][:, :1]
    top = int(np.argmax(light))
    faint = np.flatnonzero(light[:, 0] <= FAINTEST * light[top])
    below, above = faint[faint < top], faint[faint > top]
    first = max(ends[0][0], ends[1][0], float(WAVELENGTHS[below[-1] + 1]) if below.size else 0.0)
    last = min(ends[0][1], ends[1][1], float(WAVELENGTHS[above[0] - 1]) if above.size else np.inf)
    if known is not None:
        first, last = max(first, known[0][0]), min(last, known[0][-1])
    if first > FIRST or last < LAST:
        raise FramesDiffer(
            f"{colour.name}, {grey.name} and the mono camera's response share only {first:.0f} to {last:.0f} nm."
            if first < last
            else f"{colour.name} and {grey.name} share no wavelengths.",
            f"All must cover {FIRST:g} to {LAST:g} nm: turn both cameras to the same part of the spectrum.",
            value=max(0.0, last - first),
            threshold=LAST - FIRST,
        )
    inside = ((first <= WAVELENGTHS) & (last >= WAVELENGTHS))[:, None]
    light = np.where(inside, light, 1.0)
    weight = 1.0 if known is None else np.interp(WAVELENGTHS, *known)[:, None]
    ratio = np.where(inside, signals[0], 0.0) / light * weight
    std: Floats | None = None
    if colour.error is not None and grey.error is not None:
        relative = np.hypot(errors[0], ratio / weight * light_error) / light
        std = np.where(inside, relative * weight, 0.0)
    assumptions = [
        ("mono_response", "the mono camera's response is taken for flat." if known is None else f"the mono camera's "
         f"response is {Path(str(response)).name}."),
        ("same_light", "both cameras saw the same light through the same slit, grating and order; scattered light "
         "and second order are not removed."),
        ("black", f"{colour.name}: {colour.black}; {grey.name}: {grey.black}."),
    ]  # fmt: skip
    paths = {"rgb": rgb, "mono": mono, "dark": dark, "mono_dark": mono_dark, "response": response}
    return _checked(
        ratio, std, (first, last), camera, found, {"rgb": colour.tilt, "mono": grey.tilt}, assumptions, paths
    )


def sweep(path: PathLike) -> Direct:
    """A monochromator's sweep: a CSV wavelength_nm,red,green,blue,power, a line of light a row, dark subtracted.

    Between its wavelengths the curves run straight; it must cover 400 to 700 nm in steps of 20 nm at most.

    Raises:
        InvalidArgument: another file, wavelengths that do not increase or leave gaps.
        Underexposed: a reference without power.
    """
    nm, *columns = _read_columns(path, ("wavelength_nm", *CHANNELS, "power"))
    if nm[0] > FIRST or nm[-1] < LAST or np.diff(nm).max() > LARGEST_STEP:
        raise InvalidArgument(
            f"{path} covers {nm[0]:g} to {nm[-1]:g} nm in steps of up to {np.diff(nm).max():g} nm.",
            f"Sweep {FIRST:g} to {LAST:g} nm in steps of {LARGEST_STEP:g} nm at most; 5 nm is usual.",
        )
    power = columns[3]
    if power.min() <= 0:
        raise Underexposed(
            f"{path} has a line without reference power, at {nm[np.argmin(power)]:g} nm.",
            "Leave out what the lamp does not reach, and subtract the detector's dark signal.",
            value=float(power.min()),
            threshold=0.0,
        )
    with np.errstate(over="ignore"):
        shares = [each / power for each in columns[:3]]
    if not np.isfinite(shares).all():
        raise InvalidArgument(f"{path} has signals too large for their power.", "Check the units of its columns.")
    values = np.stack([np.interp(WAVELENGTHS, nm, each, 0.0, 0.0) for each in shares], axis=1)
    covered = (max(float(nm[0]), 380.0), min(float(nm[-1]), 720.0))
    assumptions = [("reference_power", "the reference power is in proportion to what reached the camera's sensor.")]
    return _checked(values, None, covered, ("", ""), {}, {}, assumptions, {"sweep": path})


def _checked(
    values: Floats,
    std: Floats | None,
    covered: tuple[float, float],
    camera: tuple[str, str],
    found: dict[str, Dispersion],
    tilts: dict[str, float],
    assumptions: list[tuple[str, str]],
    paths: dict[str, PathLike | None],
) -> Direct:
    if not np.isfinite(values).all() or (values.max(axis=0) <= 0).any():
        raise Underexposed("A channel holds no signal.", "Expose the colour camera's frame longer.")
    if covered[0] > WAVELENGTHS[0] or covered[1] < WAVELENGTHS[-1]:
        low, high = (f"{nm:.1f}" for nm in covered)
        assumptions.append(("covered", f"only {low} to {high} nm were measured; beyond, the curves are set to 0."))
    files = {
        role: (Path(path).name, hashlib.sha256(Path(path).read_bytes()).hexdigest())
        for role, path in paths.items()
        if path is not None
    }
    return Direct(values, std, covered, camera, found, tilts, tuple(assumptions), files)


def _curves(values: Floats) -> Json:
    return {"wavelength_nm": WAVELENGTHS.tolist()} | {c: v.tolist() for c, v in zip(CHANNELS, values.T, strict=True)}


def _together(spectrum: Spectrum) -> tuple[Floats, Floats]:
    """The channels on the positions of the widest one: (w,), (w, c)."""
    pixel = max(spectrum.pixel, key=len)
    columns = [np.interp(pixel, x, y) for x, y in zip(spectrum.pixel, spectrum.signal, strict=True)]
    return pixel, np.stack(columns, axis=1)


def _per_nanometre(
    spectrum: Spectrum, channel: int, dispersion: Dispersion
) -> tuple[Floats, Floats, tuple[float, float]]:
    """Signal a nm on the grid and its standard error, (681,), and the first and last wavelength in the frame."""
    from scipy.interpolate import CubicSpline

    x = spectrum.pixel[channel]
    nm, spread = dispersion.wavelength(x), np.abs(dispersion.slope(x))
    order = np.argsort(nm)
    nm, density = nm[order], (spectrum.signal[channel] / spread)[order]
    error = np.zeros_like(nm) if spectrum.error is None else (spectrum.error[channel] / spread)[order]
    value = CubicSpline(nm, density)(np.clip(WAVELENGTHS, nm[0], nm[-1]))
    return value, np.interp(WAVELENGTHS, nm, error), (float(nm[0]), float(nm[-1]))


# frames


def _read(path: PathLike, dark: PathLike | None, channels: int) -> tuple[Spectrum, tuple[str, str]]:
    """The spectrum in a file, and the camera's make and model where it says so."""
    name, kind = Path(path).name, Path(path).suffix.casefold()
    if kind == ".csv":
        if dark is not None:
            raise InvalidArgument(f"{name} is a table; its dark frame has no use.", "Subtract it before extracting.")
        pixel, *columns = _read_columns(path, ("pixel", *(CHANNELS if channels == 3 else ("signal",))))
        positions = (pixel,) * channels
        return Spectrum(name, positions, tuple(columns), None, 0.0, "as in the table"), ("", "")
    mosaic: Mosaic | None = None
    if kind == ".dng":
        mosaic = read_dng(path)
        samples, ceiling = mosaic.samples.astype(np.float64), mosaic.white
    elif kind in (".tif", ".tiff") and channels == 1:
        stored = _read_tiff(path)
        samples, ceiling = stored.astype(np.float64), float(np.iinfo(stored.dtype).max)
    else:
        kinds = (
            "a DNG, or a CSV pixel,red,green,blue" if channels == 3 else "a grey TIFF, a DNG or a CSV pixel,signal"
        )
        raise InvalidArgument(
            f"{name} cannot be the {'colour' if channels == 3 else 'mono'} frame.", f"Give {kinds}."
        )
    _check_ceiling(samples, ceiling, name)
    level, words = _black(samples, mosaic, dark, name)
    cell = np.zeros((2, 2), dtype=np.int64)
    if mosaic is not None and channels == 3:
        cell = np.array(["RGB".index(letter) for letter in mosaic.cfa]).reshape(2, 2)
    camera = ("", "") if mosaic is None else (mosaic.make, mosaic.model)
    return extract(samples - level, cell, name, words), camera


def extract(light: Floats, cell: NDArray[np.int64], name: str, black: str) -> Spectrum:
    """The spectrum along the rows of a frame (h, w), black subtracted, whose 2 × 2 cell holds these channels.

    The rows that the slit lights are found, then how far its lines lean, by where the fine structure of strips of
    rows lies against their mean. Along the lean, samples of a channel are averaged over two columns (one, where there
    is one channel), each row weighed by how brightly the slit lights it.

    Raises:
        Underexposed: no row stands out.
    """
    height, width = (side // 2 * 2 for side in light.shape)
    if height < 8 or width < 200:
        raise Underexposed(f"{name} is only {width} × {height} samples.", "Give at least 200 columns and 8 rows.")
    light = light[:height, :width]
    grey = light.reshape(height // 2, 2, width // 2, 2).sum(axis=(1, 3))
    profile = grey.mean(axis=1)
    noise = float(np.median(np.abs(np.diff(grey, axis=1)))) / np.sqrt(width / 2)
    lit = np.flatnonzero(profile > 0.5 * np.quantile(profile, 0.98))
    if not profile.max() > _LEAST_CONTRAST * max(noise, 1e-9) or len(lit) < 4:
        raise Underexposed(
            f"{name} shows no spectrum: no rows stand out of the noise.",
            "Expose it longer, with the spectrum along the rows.",
            value=float(profile.max()),
            threshold=_LEAST_CONTRAST * noise,
        )
    top, bottom = int(lit[0]), int(lit[-1]) + 1
    middle = float(top + bottom - 1) / 2
    lean = _lean(grey[top:bottom], middle - top)
    rows = np.arange(2 * top, 2 * bottom)
    weight = np.repeat(profile[top:bottom], 2) / profile[top:bottom].mean()
    along = np.arange(width)[None, :] - lean * (rows - (2 * middle + 0.5))[:, None]
    which = np.tile(cell, (bottom - top, width // 2))
    block = light[2 * top : 2 * bottom]
    share = np.broadcast_to(weight[:, None], block.shape)
    bin_width = 2.0 if cell.any() else 1.0
    pixels, signals, errors = [], [], []
    for channel in range(int(cell.max()) + 1):
        mine = which == channel
        x, y, p = along[mine], block[mine], share[mine]
        # A sample covers half a column to either side. Bins begin at such an edge, not at a sample's centre: there
        # the last bit of the lean would choose the bin.
        index = np.floor((x + 0.5) / bin_width).astype(np.int64)
        index -= index.min()
        total = np.bincount(index, p)
        full = total > 0.5 * np.median(total)
        at = np.bincount(index, p * x) / np.maximum(total, 1e-12)
        mean = np.bincount(index, y) / np.maximum(total, 1e-12)
        scatter = np.bincount(index, (y - p * mean[index]) ** 2)
        pixels.append(at[full])
        signals.append(mean[full])
        errors.append((np.sqrt(scatter) / np.maximum(total, 1e-12))[full])
    tilt = float(np.rad2deg(np.arctan(lean)))
    return Spectrum(name, tuple(pixels), tuple(signals), tuple(errors), tilt, black)


def _lean(grey: Floats, middle: float) -> float:
    """Columns a row by which the lines lean, from strips of a grey spectrum (h, w); at most 0.15."""
    from scipy.ndimage import gaussian_filter1d

    count = int(np.clip(len(grey) // 6, 2, 12))
    strips = np.array_split(np.arange(len(grey)), count)
    at = np.array([strip.mean() for strip in strips]) - middle
    shown = [gaussian_filter1d(fine_structure(grey[strip].mean(axis=0)[:, None]), 1.5) for strip in strips]
    columns = np.arange(grey.shape[1], dtype=float)

    def upright(lean: float) -> Floats:
        return np.stack([np.interp(columns + lean * y, columns, each) for y, each in zip(at, shown, strict=True)])

    # Coarse: the lean that makes the strips' mean sharpest. Fine: Gauss-Newton steps on it, since sharpness itself is
    # drawn to no lean at all, where interpolation has not smoothed the noise.
    trial = np.linspace(-_LEAN, _LEAN, 61)
    lean = float(trial[np.argmax([np.sum(upright(each).mean(axis=0) ** 2) for each in trial])])
    for _ in range(20):
        strips_now = upright(lean)
        slope = np.gradient(strips_now.mean(axis=0))
        step = -float(slope @ (at @ strips_now)) / float(np.sum(at**2) * (slope @ slope))
        lean += step
        if abs(step) < 1e-6:
            break
    return lean


def _check_ceiling(samples: Floats, ceiling: float, name: str) -> None:
    """Refuse a frame that reaches the file's ceiling, or piles up at a lower one: noise leaves no such heap."""
    bright = samples[samples > 0.5 * samples.max()]
    levels, counts = np.unique(bright, return_counts=True)
    heap = len(counts) > 4 and counts[-1] > 3 * counts[-5:-1].mean()
    share = float(np.mean(bright >= (levels[-1] if heap else ceiling))) if bright.size else 0.0
    if share > _CLIPPED:
        raise Overexposed(
            f"{name} is clipped: {share:.1%} of its bright samples lie at {levels[-1]:g} DN.",
            "Expose it shorter; no part of the spectrum may reach the sensor's ceiling.",
            value=share,
            threshold=_CLIPPED,
        )


def _black(samples: Floats, mosaic: Mosaic | None, dark: PathLike | None, name: str) -> tuple[Floats | float, str]:
    """What is subtracted, and in words."""
    if dark is not None:
        closed = None if mosaic is None else read_dng(dark)
        other = (_read_tiff(dark) if closed is None else closed.samples).astype(np.float64)
        for word in ("exposure", "iso"):
            ours, theirs = getattr(mosaic, word, None), getattr(closed, word, None)
            if ours is not None and theirs is not None and abs(theirs / ours - 1.0) > 0.01:
                raise FramesDiffer(
                    f"{name} was taken at {word} {ours:g}, its dark frame at {theirs:g}.",
                    "Take both with the same settings.",
                    value=float(theirs),
                    threshold=float(ours),
                )
        if other.shape != samples.shape:
            raise FramesDiffer(
                f"{name} has {samples.shape[1]} × {samples.shape[0]} samples, its dark frame "
                f"{other.shape[1]} × {other.shape[0]}.",
                "Take both with the same camera and settings.",
            )
        if other.mean() >= samples.mean():
            raise FramesDiffer(
                f"The dark frame of {name} is not darker.", "Take it with the slit closed, at the same exposure."
            )
        return float(other.mean()) if mosaic is None else _cell_means(other), "a dark frame"
    if mosaic is not None:
        repeat = (samples.shape[0] // 2 + 1, samples.shape[1] // 2 + 1)
        return np.tile(mosaic.black, repeat)[: samples.shape[0], : samples.shape[1]], "the file's black level"
    rows = samples.mean(axis=1)
    beside = rows <= np.quantile(rows, 0.1)
    return float(np.median(samples[beside])), "the darkest tenth of the rows"


def _cell_means(dark: Floats) -> Floats:
    """(h, w): the mean of the dark frame at each position of the 2 × 2 cell; its noise would only be added."""
    level = np.empty_like(dark)
    for row in (0, 1):
        for column in (0, 1):
            level[row::2, column::2] = dark[row::2, column::2].mean()
    return level


def _read_tiff(path: PathLike) -> NDArray[Any]:
    """(h, w) of a grey TIFF of whole numbers, as stored."""
    import tifffile

    try:
        with tifffile.TiffFile(path) as file:
            size = sum(math.prod(each.shape) * each.dtype.itemsize for each in file.series[:1])
            if size > _DENSEST * file.filehandle.size:
                raise ValueError(f"{file.filehandle.size} bytes cannot hold {size}")
            samples = file.asarray()
    except FileNotFoundError as error:
        raise UnreadableRaw(f"There is no file {path}.", "Check the path.") from error
    except Exception as error:  # tifffile and its codecs raise many kinds
        raise UnreadableRaw(
            f"{path} cannot be read as TIFF ({error}).", "Save it as an uncompressed TIFF."
        ) from error
    if samples.ndim != 2 or samples.dtype.kind != "u" or samples.size == 0:
        raise UnreadableRaw(
            f"{path} holds {samples.dtype} samples of shape {samples.shape}.",
            "Save the mono camera's frame as one grey page of 8 or 16 bits, without processing.",
        )
    return np.asarray(samples)


def _read_columns(path: PathLike, names: tuple[str, ...]) -> tuple[Floats, ...]:
    """The named columns of a CSV, (w,) each; the first must increase.

    Raises:
        InvalidArgument: unreadable, other columns, or values that are not finite.
    """
    wanted = ",".join(names)
    try:
        with open(path, "rb") as stream:
            data = stream.read(_LARGEST + 1)
        if len(data) > _LARGEST:
            raise InvalidArgument(f"{path} is larger than {_LARGEST} bytes.", f"Give a table of {wanted}.")
        lines = [line for line in data.decode("utf-8-sig").splitlines() if line.strip() and line.lstrip()[0] != "#"]
        rows = list(csv.DictReader(io.StringIO("\n".join(lines))))
        table = np.array([[float(row[name]) for name in names] for row in rows], dtype=np.float64)
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not UTF-8"
        raise InvalidArgument(f"{path} cannot be read: {reason}.", "Check the path.") from error
    except (KeyError, TypeError, ValueError, csv.Error) as error:
        raise InvalidArgument(f"{path} is no table of {wanted}.", f"Its first line must read {wanted}.") from error
    if len(table) < 2 or not np.isfinite(table).all() or (np.diff(table[:, 0]) <= 0).any():
        raise InvalidArgument(
            f"{path} holds {len(table)} rows, or values that are not finite, or a {names[0]} that does not increase.",
            "Sort it, each value once.",
        )
    return tuple(table.T)
