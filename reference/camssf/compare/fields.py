"""Compares two results of the same photos field by field: missing fields, and fields that differ otherwise.

`camssf.compare.parity` compares curves, signals and similar values by their own measures; all other fields of a
document are compared here. `document` is the other side's, `made` our own.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

Json: TypeAlias = dict[str, Any]

STAGE_OF = {
    "/format": "inputs", "/excerpt": "inputs",
    "/generator": "inputs", "/camera": "photo", "/chart": "inputs", "/basis": "inputs",
    "/engine": "inputs", "/hashes": "inputs", "/ssf": "curve", "/channel_gain": "curve", "/gamma": "curve",
    "/l2": "curve", "/ssf_std": "band", "/code_covariance": "band", "/evidence": "band", "/prior_scale": "band",
    "/choice": "band", "/uncertainty": "band", "/gap": "gap", "/layers_gap": "gap", "/finish_steps": "gap",
    "/scores": "scores", "/truth": "scores", "/verdict": "verdict", "/assumptions": "verdict", "/shots": "inputs",
    "/shots/photo": "photo", "/shots/white": "photo", "/shots/dark": "photo", "/shots/saturation": "photo",
    "/shots/pose": "pose", "/shots/white_reference": "signals", "/shots/dark_reference": "signals",
    "/shots/light": "band", "/shots/patches": "inputs", "/shots/patches/chart": "patch means",
    "/shots/patches/white": "patch means", "/shots/patches/dark": "patch means",
    "/shots/patches/clipped": "patch means", "/shots/patches/dead": "patch means",
    "/shots/patches/gradient": "patch means", "/shots/patches/signal": "signals",
    "/shots/patches/standard_error": "signals", "/shots/patches/predicted": "curve",
    "/shots/patches/level": "band", "/shots/patches/predicted_std": "band", "/shots/patches/unseen_std": "band",
    "/shots/patches/unseen": "scores", "/shots/patches/measured_srgb": "scores",
    "/shots/patches/synthetic_srgb": "scores",
}  # fmt: skip
"""The stage of a field by its path; the longest matching path counts. Paths have no list indices."""
MEASURED = (
    "/ssf/red", "/ssf/green", "/ssf/blue", "/ssf_std/red", "/ssf_std/green", "/ssf_std/blue", "/channel_gain",
    "/code_covariance", "/evidence", "/gap", "/layers_gap", "/finish_steps", "/prior_scale", "/choice",
    "/uncertainty", "/scores/rmsre_percent", "/scores/delta_e00", "/hashes", "/basis", "/chart/table",
    "/chart/layout", "/shots/photo", "/shots/saturation", "/shots/pose/corners", "/shots/pose/patches",
    "/shots/pose/quarter_turns", "/shots/pose/score", "/shots/light/kinds", "/shots/light/power",
    "/shots/light/std", "/shots/light/kelvin", "/shots/light/kelvin_std",
    *(f"/shots/patches/{key}" for key in (
        "used", "reflectance_srgb", "measured_srgb", "synthetic_srgb", "signal", "level", "predicted", "unseen",
        "predicted_std", "unseen_std", "standard_error", "clipped", "dead", "gradient", "chart", "white", "dark",
    )),
)  # fmt: skip
"""Beginnings of the paths of values that `camssf.compare.parity` compares by their own measures. Here only their
presence is checked."""
APART = ("/shots/white/name", "/shots/dark/name", "/shots/pose/method", "/shots/pose/notes", "/generator/version")
"""Values that may differ: files may be renamed (their SHA-256 are compared), the search for the corners is not
repeated here, and another release may have written the result."""
VERDICT = ("/engine", "/verdict", "/assumptions")
"""Fields that always differ if only one side refused."""
WORDS = tuple(f"/verdict/reasons/{key}" for key in ("message", "advice", "value", "threshold"))
"""Texts and numbers about a chart that was not found: they depend on the corners that the search started from, which
a refused result does not hold."""


@dataclass(frozen=True)
class FieldDifference:
    """A field that differs.

    Attributes:
        stage: a value of STAGE_OF.
        apart: infinite if missing or not a number; else the difference relative to our largest number, at least to 1.
        words: its place and its value on both sides.
    """

    stage: str
    apart: float
    words: str


def stage_of(path: str) -> str:
    """The stage that a path belongs to."""
    found = [known for known in STAGE_OF if f"{path}/".startswith(f"{known}/")]
    return STAGE_OF[max(found, key=len)]


def field_differences(document: Json, made: Json, *, skip: tuple[str, ...] = ()) -> tuple[FieldDifference, ...]:
    """List every field that is missing on one side or differs, except values in MEASURED and APART.

    A missing field is no difference if another release wrote the result, or if only one side refused.

    Args:
        document, made: results of the same photos.
        skip: beginnings of paths to ignore.
    """
    older = document["generator"]["version"] != made["generator"]["version"]
    parted = (document["engine"] == "none") != (made["engine"] == "none")
    but = (*skip, *APART, *MEASURED, *(VERDICT if parted else ()))
    return tuple(_walk(document, made, "", "", older or parted, but))


def _within(path: str, beginnings: tuple[str, ...]) -> bool:
    return any(f"{path}/".startswith(f"{known}/") for known in beginnings)


def _walk(
    theirs: Any, ours: Any, path: str, place: str, lenient: bool, but: tuple[str, ...]
) -> Iterator[FieldDifference]:
    if isinstance(theirs, dict) and isinstance(ours, dict):
        for key in [*ours, *(key for key in theirs if key not in ours)]:
            here, where = f"{path}/{key}", f"{place}.{key}" if place else key
            if key in theirs and key in ours:
                yield from _walk(theirs[key], ours[key], here, where, lenient, but)
            elif not lenient and not here.startswith(("/hashes/inputs/", "/shots/light/kinds/")):
                yield FieldDifference(
                    stage_of(here), np.inf, f"{where} is missing {'there' if key in ours else 'here'}"
                )
    elif _of_objects(theirs) or _of_objects(ours):
        yield from _lists(theirs, ours, path, place, lenient, but)
    elif not _within(path, but) and (apart := _apart(theirs, ours)):
        yield FieldDifference(stage_of(path), apart, f"{place}: {_said(theirs)} there, {_said(ours)} here")


def _of_objects(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(each, dict) for each in value)


def _lists(
    theirs: Any, ours: Any, path: str, place: str, lenient: bool, but: tuple[str, ...]
) -> Iterator[FieldDifference]:
    """Compare lists of objects; one side may be empty or null."""
    sizes = [len(each) if isinstance(each, list) else 0 for each in (theirs, ours)]
    if sizes[0] != sizes[1]:
        if not lenient:
            yield FieldDifference(stage_of(path), np.inf, f"{place}: {sizes[0]} there, {sizes[1]} here")
        return
    for number, (one, other) in enumerate(zip(theirs, ours, strict=True), 1):
        name = other.get("name")
        where = f"{place}[{number}]" + (f" ({name})" if isinstance(name, str) else "")
        yield from _walk(one, other, path, where, lenient, but)


def _apart(theirs: Any, ours: Any) -> float:
    """Difference of two values, 0 if equal; see FieldDifference."""
    if theirs == ours:
        return 0.0
    numbers = [_numbers(each) for each in (theirs, ours)]
    if numbers[0] is None or numbers[1] is None or numbers[0].shape != numbers[1].shape:
        return float(np.inf)
    size = max(1.0, float(np.max(np.abs(numbers[1]), initial=0.0)))
    return float(np.max(np.abs(numbers[0] - numbers[1]), initial=0.0)) / size


def _numbers(value: Any) -> Any:
    """A number or a list of numbers as an array; None for anything else."""
    each = value if isinstance(value, list) else [value]
    plain = all(isinstance(one, int | float) and not isinstance(one, bool) for one in each)
    return np.array(value, float) if plain else None


def _said(value: Any) -> str:
    text = f"{value:.9g}" if isinstance(value, float) else str(value)
    return text if len(text) <= 80 else f"{text[:77]}..."
