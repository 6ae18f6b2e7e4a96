"""Differences of two results of the same photos: one table of their fields, and one walk over both."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from itertools import zip_longest
from typing import Any, TypeAlias

import numpy as np

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
    "/version": ("inputs", None, 0.0),  # another release may have written the result
    "/sha256": ("inputs", None, 0.0),
    "/capture": ("inputs", relative, 1e-9),
    "/capture/files": ("inputs", relative, 0.0),
    "/capture/shots/photo": ("photo", relative, 0.0),
    "/capture/shots/photo/name": ("photo", None, 0.0),  # files may be renamed; their SHA-256 are compared
    "/capture/shots/photo/sha256": ("file", relative, 0.0),
    "/capture/shots/white": ("photo", relative, 0.0),
    "/capture/shots/white/name": ("file", None, 0.0),
    "/capture/shots/white/sha256": ("file", relative, 0.0),
    "/capture/shots/dark": ("photo", relative, 0.0),
    "/capture/shots/dark/name": ("file", None, 0.0),
    "/capture/shots/dark/sha256": ("file", relative, 0.0),
    "/capture/shots/pose": ("pose", relative, 0.0),  # taken over; `parity` refines its corners again
    "/capture/shots/means/black": ("photo", relative, 0.0),
    "/capture/shots/means/saturation": ("photo", relative, 0.0),
    # Sums are exact, so only the last bits of means may differ.
    "/capture/shots/means": ("patch means", of_largest, 1e-12),
    "/answer": ("inputs", relative, 0.0),
    "/answer/prior_scale": ("inputs", relative, 1e-9),
    "/answer/chart_fading": ("inputs", relative, 1e-6),
    "/answer/choice": ("inputs", relative, 1e-9),
    "/answer/choice/log_evidence": ("band", relative, 1e-9),
    "/answer/choice/probability": ("band", relative, 1e-6),  # changes by at most as much as a log evidence of 1000
    # Processors round differently (measured: docs/solver.md).
    "/answer/curves": ("curve", relative, 1e-9),
    "/answer/channel_gain": ("curve", of_largest, 1e-9),
    "/answer/gamma": ("curve", relative, 1e-9),
    "/answer/l2": ("curve", relative, 1e-9),
    "/answer/predicted": ("curve", relative, 1e-9),
    "/answer/std": ("band", relative, 1e-9),
    "/answer/code_covariance": ("band", relative, 1e-9),
    "/answer/evidence": ("band", relative, 1e-9),
    "/answer/uncertainty": ("band", relative, 1e-9),
    "/answer/level": ("band", relative, 1e-9),
    "/answer/predicted_std": ("band", relative, 1e-9),
    "/answer/unseen_std": ("band", relative, 1e-9),
    "/answer/lights": ("band", of_largest, 1e-9),
    "/answer/proof/gap": ("gap", either, 1e-9),
    "/answer/proof/layers_gap": ("gap", relative, 1e-9),
    "/answer/proof/finish_steps": ("gap", any_steps, 0.0),
    "/answer/unseen": ("scores", relative, 1e-9),
    "/answer/scores": ("scores", relative, 1e-9),
    "/answer/scores/rmsre_percent": ("scores", of_largest, 1e-9),
    "/truth": ("scores", relative, 1e-9),
    "/verdict": ("verdict", relative, 1e-8),
    "/assumptions": ("verdict", relative, 1e-8),
}
"""Stage, measure and bound of each path; the longest matching path counts. Paths have no list indices.

No measure: only its presence is compared. Bound 0: must be equal."""
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


def differences(theirs: Json, ours: Json, *, skip: tuple[str, ...] = (), part: bool = False) -> Iterator[Finding]:
    """Yield every field that differs, also within its bound.

    A missing field is no difference if another release wrote the result, or if only one side refused.

    Args:
        theirs, ours: two results of the same photos as JSON has them (`forms.to_plain`).
        skip: paths to ignore.
        part: whether one of them has only some of the fields.
    """
    parted = ("answer" in theirs) != ("answer" in ours)
    lenient = part or parted or theirs.get("version") != ours.get("version")
    for path, label, there, here in _pairs(theirs, ours):
        stage, measure, bound = row_of(path)
        if any(_within(path, beginning) for beginning in skip):
            continue
        if (there is ABSENT) != (here is ABSENT):
            if lenient and not any(_within(path, beginning) for beginning in NAMED):
                continue
            size, words = np.inf, f" is missing {'there' if there is ABSENT else 'here'}"
        elif measure is None:
            continue
        else:
            size, words = _compare(there, here, measure)
        if size:
            size = size if bound else np.inf
            yield Finding(stage, size <= bound, size, bound, f"{label}{words}")


def _within(path: str, beginning: str) -> bool:
    return f"{path}/".startswith(f"{beginning}/")


def _pairs(theirs: Any, ours: Any, path: str = "", place: str = "") -> Iterator[tuple[str, str, Any, Any]]:
    """Each field of both documents: its path, its place, its value on both sides; ABSENT if missing."""
    if isinstance(theirs, dict) and isinstance(ours, dict):
        if path == "/capture/files":  # files may be renamed, their roles are compared
            theirs, ours = ({key.partition(": ")[0]: side[key] for key in side} for side in (theirs, ours))
        for key in {**ours, **theirs}:
            there, here = theirs.get(key, ABSENT), ours.get(key, ABSENT)
            yield from _pairs(there, here, f"{path}/{key}", f"{place}.{key}" if place else key)
    elif rows := _entries(theirs, ours):
        for number, (there, here) in enumerate(rows, 1):
            name = _name(there if here is ABSENT else here)
            entry = f"{place}[{number}] ({name})" if name else f"{place}[{number}]"
            yield from _pairs(there, here, path, entry)
    else:
        yield path, place, theirs, ours


def _entries(theirs: Any, ours: Any) -> list[tuple[Any, Any]]:
    """Pairs of the entries of two lists of objects, of which one may be left out, as it is when empty; else none."""
    lists = [[] if side is ABSENT else side for side in (theirs, ours)]
    if not all(isinstance(side, list) for side in lists) or not any(isinstance(e, dict) for s in lists for e in s):
        return []
    return list(zip_longest(*lists, fillvalue=ABSENT))


def _name(entry: Any) -> str:
    """What a list's entry is called; empty if nothing."""
    if not isinstance(entry, dict):
        return ""
    if "basis" in entry:
        return " under ".join(filter(None, [entry["basis"], " and ".join(filter(None, entry.get("kinds", ())))]))
    return str(next((entry[key] for key in ("name", "source", "code") if key in entry), ""))


def _compare(theirs: Any, ours: Any, measure: Measure) -> tuple[float, str]:
    """The largest difference of two values or arrays, and both in words."""
    there, here = _numbers(theirs), _numbers(ours)
    if there is None or here is None:
        return 0.0 if theirs == ours else np.inf, f": {theirs!s:.80} there, {ours!s:.80} here"
    if there.shape != here.shape:
        return np.inf, f": {there.size} numbers there, {here.size} here"
    if not there.size:
        return 0.0, ""
    if (np.isnan(there) != np.isnan(here)).any():
        return np.inf, ": other rows are missing"
    sizes = measure(np.nan_to_num(there), np.nan_to_num(here))
    at = np.unravel_index(int(sizes.argmax()), sizes.shape)
    return float(sizes[at]), f"{_element(at, sizes.shape)}: {there[at]:.9g} there, {here[at]:.9g} here"


def _element(at: tuple[np.intp, ...], shape: tuple[int, ...]) -> str:
    """The place in an array: a shot or patch by its number, and a wavelength, a channel or an index."""
    if not at or shape == (1,):
        return ""
    *rows, last = at
    words = "".join(f"[{row + 1}]" for row in rows)
    if shape[-1] == WAVELENGTHS.size:
        return f"{words} at {WAVELENGTHS[last]:g} nm"
    return f"{words}, {CHANNELS[last]}" if shape[-1] == len(CHANNELS) else f"{words}[{last + 1}]"


def _numbers(value: Any) -> Floats | None:
    """A number or an array of numbers, missing rows NaN; None for anything else."""
    rows = [value]
    while any(isinstance(row, list) for row in rows):
        rows = [entry for row in rows for entry in (row if isinstance(row, list) else [row])]
    if not all(row is None or (isinstance(row, int | float) and not isinstance(row, bool)) for row in rows):
        return None
    if value is None or not rows:
        return None
    try:
        return np.array(_filled(value), dtype=np.float64)
    except ValueError:
        return None


def _filled(value: Any) -> Any:
    """Nested lists with missing rows as rows of NaN."""
    if isinstance(value, list) and None in value:
        width = max((len(row) for row in value if isinstance(row, list)), default=len(CHANNELS))
        return [[np.nan] * width if row is None else row for row in value]
    return [_filled(row) for row in value] if isinstance(value, list) else value
