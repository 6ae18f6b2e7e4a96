"""Differences of two results of the same photos: one table of their fields, and one walk over both documents."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from itertools import zip_longest
from typing import Any, TypeAlias

import numpy as np

from camssf.documents.basis_choice import hypothesis_in_words
from camssf.grid import CHANNELS, WAVELENGTHS, Floats

Json: TypeAlias = dict[str, Any]
Measure: TypeAlias = Callable[[Floats, Floats], Floats]
"""From the numbers of a field, theirs and ours, to the size of each difference."""


def relative(theirs: Floats, ours: Floats) -> Floats:
    """Relative to our largest number, at least to 1."""
    return np.asarray(np.abs(theirs - ours) / max(1.0, np.abs(ours).max()))


def of_largest(theirs: Floats, ours: Floats) -> Floats:
    """Relative to our largest number."""
    return np.asarray(np.abs(theirs - ours) / (np.abs(ours).max() or 1.0))


def either(theirs: Floats, ours: Floats) -> Floats:
    """The larger number, because each must be small by itself."""
    return np.maximum(np.abs(theirs), np.abs(ours))


def any_steps(theirs: Floats, ours: Floats) -> Floats:
    """Infinite if only one side took steps. Rounding decides between paths of equal length."""
    return np.where((theirs > 0) == (ours > 0), 0.0, np.inf)


TABLE: dict[str, tuple[str, Measure | None, float]] = {
    "": ("inputs", relative, 0.0),
    "/generator/version": ("inputs", None, 0.0),  # another release may have written the result
    "/prior_scale": ("inputs", relative, 1e-9),
    "/chart_fading": ("inputs", relative, 1e-6),
    "/choice": ("inputs", relative, 1e-9),
    "/choice/log_evidence": ("band", relative, 1e-9),
    "/choice/probability": ("band", relative, 1e-6),  # changes by at most as much as a log evidence of 1000
    "/camera": ("photo", relative, 0.0),
    "/shots": ("inputs", relative, 1e-9),
    "/shots/photo": ("photo", relative, 0.0),
    "/shots/photo/name": ("photo", None, 0.0),  # files may be renamed; their SHA-256 are compared
    "/shots/photo/sha256": ("file", relative, 0.0),
    "/shots/white": ("file", relative, 0.0),
    "/shots/white/name": ("file", None, 0.0),
    "/shots/dark": ("file", relative, 0.0),
    "/shots/dark/name": ("file", None, 0.0),
    "/shots/saturation": ("photo", relative, 0.0),
    "/shots/pose": ("pose", relative, 0.0),  # taken over; `parity` refines its corners again
    "/shots/white_reference": ("signals", relative, 0.0),
    "/shots/dark_reference": ("signals", relative, 0.0),
    "/shots/light": ("band", of_largest, 1e-9),
    # Sums are exact, so only the last bits of means may differ.
    "/shots/patches/chart": ("patch means", of_largest, 1e-12),
    "/shots/patches/white": ("patch means", of_largest, 1e-12),
    "/shots/patches/dark": ("patch means", of_largest, 1e-12),
    "/shots/patches/clipped": ("patch means", relative, 1e-12),
    "/shots/patches/dead": ("patch means", relative, 1e-12),
    "/shots/patches/gradient": ("patch means", relative, 1e-12),
    "/shots/patches/signal": ("signals", relative, 1e-12),
    "/shots/patches/standard_error": ("signals", of_largest, 1e-12),
    "/shots/patches/reflectance_srgb": ("inputs", relative, 1e-6),
    "/shots/patches/measured_srgb": ("scores", relative, 1e-9),
    "/shots/patches/synthetic_srgb": ("scores", relative, 1e-9),
    "/shots/patches/level": ("band", relative, 1e-9),
    "/shots/patches/predicted": ("curve", relative, 1e-9),
    "/shots/patches/predicted_std": ("band", relative, 1e-9),
    "/shots/patches/unseen": ("scores", relative, 1e-9),
    "/shots/patches/unseen_std": ("band", relative, 1e-9),
    # Processors round differently (measured: docs/solver.md).
    "/ssf": ("curve", relative, 1e-9),
    "/channel_gain": ("curve", of_largest, 1e-9),
    "/gamma": ("curve", relative, 1e-9),
    "/l2": ("curve", relative, 1e-9),
    "/ssf_std": ("band", relative, 1e-9),
    "/code_covariance": ("band", relative, 1e-9),
    "/evidence": ("band", relative, 1e-9),
    "/uncertainty": ("band", relative, 1e-9),
    "/gap": ("gap", either, 1e-9),
    "/layers_gap": ("gap", relative, 1e-9),
    "/finish_steps": ("gap", any_steps, 0.0),
    "/scores": ("scores", relative, 1e-9),
    "/scores/rmsre_percent": ("scores", of_largest, 1e-9),
    "/truth": ("scores", relative, 1e-9),
    "/verdict": ("verdict", relative, 1e-8),
    "/assumptions": ("verdict", relative, 1e-8),
}
"""Stage, measure and bound of each path; the longest matching path counts. Paths have no list indices.

No measure: only its presence is compared. Bound 0: must be equal."""
LABELS = {
    "/prior_scale": "width of the prior",
    "/chart_fading": "fading of the chart",
    "/choice/*": "{key} of {name}",
    "/hashes/inputs/*": "SHA-256 of {key}",
    "/ssf/*": "ssf, {key}",
    "/ssf_std/*": "ssf_std, {key}",
    "/uncertainty/budget/*": "{name}, {key}",
    "/shots/light/*": "{key} of the light of shot {numbers[0]}",
    "/shots/patches/*": "{key}, shot {numbers[0]}, patch {numbers[1]} ({name})",
}
"""Names of fields in words; `*` is any key. Without one, it is the place in the document."""
UNSOLVED = ("/basis", "/engine", "/hashes/model", "/shots/patches/used", "/shots/patches/level")
"""Fields that a refused result has without their values."""
NAMED = ("/verdict/reasons", "/assumptions")
"""Lists that must have the same entries in all releases."""
ABSENT: Any = object()
"""In place of the value of a field that one side lacks."""


@dataclass(frozen=True)
class Finding:
    """One stage, or one field of it, compared.

    Attributes:
        stage: one of `camssf.compare.parity.STAGES`.
        agrees: whether `measured` is within the bound.
        measured: the largest difference in the field's own measure; infinite if missing or not a number.
        bound: largest difference allowed.
        words: what was compared, and the place of the largest difference.
    """

    stage: str
    agrees: bool
    measured: float
    bound: float
    words: str


@cache
def row_of(path: str) -> tuple[str, Measure | None, float]:
    """Stage, measure and bound of a path."""
    return TABLE[max((row for row in TABLE if _within(path, row)), key=len)]


def differences(document: Json, made: Json, *, skip: tuple[str, ...] = (), part: bool = False) -> Iterator[Finding]:
    """Yield every field that differs, also within its bound.

    A missing field is no difference if another release wrote the result, or if only one side refused.

    Args:
        document, made: the other side's result and ours, of the same photos.
        skip: paths to ignore.
        part: whether `made` has only some of the fields.
    """
    parted = (document.get("engine") == "none") != (made.get("engine") == "none")
    versions = [each.get("generator", {}).get("version") for each in (document, made)]
    lenient = part or parted or versions[0] != versions[1]
    skip += UNSOLVED if parted else ()
    for path, label, there, here in _pairs(document, made):
        stage, measure, bound = row_of(path)
        nothing = ABSENT if there is ABSENT or here is ABSENT else None
        if any(_within(path, each) for each in skip):
            continue
        if (there is nothing) != (here is nothing):
            if (lenient if nothing is ABSENT else parted) and not any(_within(path, each) for each in NAMED):
                continue
            size, words = np.inf, f" is missing {'there' if there is nothing else 'here'}"
        elif measure is None:
            continue
        else:
            size, words = _compare(there, here, measure)
        if size:
            size = size if bound else np.inf
            yield Finding(stage, size <= bound, size, bound, f"{label}{words}")


def _within(path: str, beginning: str) -> bool:
    return f"{path}/".startswith(f"{beginning}/")


def _pairs(
    theirs: Any, ours: Any, path: str = "", place: str = "", numbers: tuple[int, ...] = (), name: str = ""
) -> Iterator[tuple[str, str, Any, Any]]:
    """Each field of both documents: its path, its name in words, its value on both sides; ABSENT if missing."""
    if isinstance(theirs, dict) and isinstance(ours, dict):
        if path == "/hashes/inputs":  # files may be renamed, their roles are compared
            theirs, ours = ({key.partition(": ")[0]: each[key] for key in each} for each in (theirs, ours))
        for key in {**ours, **theirs}:
            there, here = theirs.get(key, ABSENT), ours.get(key, ABSENT)
            yield from _pairs(there, here, f"{path}/{key}", f"{place}.{key}" if place else key, numbers, name)
    elif isinstance(theirs, list) and isinstance(ours, list) and any(isinstance(e, dict) for e in theirs + ours):
        for number, (there, here) in enumerate(zip_longest(theirs, ours, fillvalue=ABSENT), 1):
            name = _name(there if here is ABSENT else here)
            entry = f"{place}[{number}] ({name})" if name else f"{place}[{number}]"
            yield from _pairs(there, here, path, entry, (*numbers, number), name)
    else:
        holder, _, key = path.rpartition("/")
        words = LABELS.get(path) or LABELS.get(f"{holder}/*")
        yield path, words.format(key=key, numbers=numbers, name=name) if words else place, theirs, ours


def _name(entry: Json) -> str:
    """What a list's entry is called; empty if nothing."""
    if {"basis", "log_evidence"} <= entry.keys():
        return hypothesis_in_words(entry)
    return str(next((entry[key] for key in ("name", "source", "code") if key in entry), ""))


def _compare(theirs: Any, ours: Any, measure: Measure) -> tuple[float, str]:
    """The largest difference of two values or lists, and both in words."""
    there, here = _numbers(theirs), _numbers(ours)
    if there is None or here is None:
        return 0.0 if theirs == ours else np.inf, f": {theirs!s:.80} there, {ours!s:.80} here"
    if there.shape != here.shape:
        return np.inf, f": {there.size} numbers there, {here.size} here"
    if not there.size:
        return 0.0, ""
    sizes = measure(there, here)
    i = int(sizes.argmax())
    return float(sizes[i]), f"{_element(i, sizes.size)}: {there[i]:.9g} there, {here[i]:.9g} here"


def _element(i: int, size: int) -> str:
    """The place in a vector: a wavelength, a channel or an index."""
    if size == WAVELENGTHS.size:
        return f" at {WAVELENGTHS[i]:g} nm"
    return "" if size == 1 else f", {CHANNELS[i]}" if size == len(CHANNELS) else f"[{i}]"


def _numbers(value: Any) -> Floats | None:
    """A number or a list of numbers as a vector; None for anything else."""
    each = value if isinstance(value, list) else [value]
    plain = all(isinstance(one, int | float) and not isinstance(one, bool) for one in each)
    return np.array(each, float) if plain else None
