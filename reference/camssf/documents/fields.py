"""Two results of the same photos, field by field: what one side lacks, and what else differs.

`camssf.parity` gives curves, signals and the like measures of their own; all that stands in a document beside them is
compared here, so that no field goes unseen. `document` is the other side's, `made` our own.
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
"""The stage of a field: by path, the longest that fits. Lists are passed through."""
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
"""Values that `camssf.parity` compares by measures of their own, beginnings of paths. Whether they are there is
asked here."""
APART = ("/shots/white/name", "/shots/dark/name", "/shots/pose/method", "/shots/pose/notes", "/generator/version")
"""Values that cannot be equal: files may have been named anew (their SHA-256 are compared), how the corners were
found there is not done again here, and another release may have written the result."""
VERDICT = ("/engine", "/verdict", "/assumptions")
"""What differs anyway where one side refused."""
WORDS = tuple(f"/verdict/reasons/{key}" for key in ("message", "advice", "value", "threshold"))
"""What is said of a chart that was not found: it depends on the corners from which it was looked for, which a
refused result does not hold."""


@dataclass(frozen=True)
class Field:
    """A field that differs.

    Attributes:
        stage: of STAGE_OF.
        apart: infinite where it is missing or no number; else of the largest number beside it, at least of 1.
        words: where, and what stands there on both sides.
    """

    stage: str
    apart: float
    words: str


def stage_of(path: str) -> str:
    """The stage that a path belongs to."""
    found = [known for known in STAGE_OF if f"{path}/".startswith(f"{known}/")]
    return STAGE_OF[max(found, key=len)]


def fields_apart(document: Json, made: Json, *, skip: tuple[str, ...] = ()) -> tuple[Field, ...]:
    """Every field that one side lacks or that differs, but for values in MEASURED and APART.

    What a result of another release lacks is no difference: it could not know better. Nor is what only an answer has,
    where one side refused.

    Args:
        document, made: results of the same photos.
        skip: beginnings of paths that shall not be looked at.
    """
    older = document["generator"]["version"] != made["generator"]["version"]
    parted = (document["engine"] == "none") != (made["engine"] == "none")
    but = (*skip, *APART, *MEASURED, *(VERDICT if parted else ()))
    return tuple(_walk(document, made, "", "", older or parted, but))


def _within(path: str, beginnings: tuple[str, ...]) -> bool:
    return any(f"{path}/".startswith(f"{known}/") for known in beginnings)


def _walk(theirs: Any, ours: Any, path: str, place: str, lenient: bool, but: tuple[str, ...]) -> Iterator[Field]:
    if isinstance(theirs, dict) and isinstance(ours, dict):
        for key in [*ours, *(key for key in theirs if key not in ours)]:
            here, where = f"{path}/{key}", f"{place}.{key}" if place else key
            if key in theirs and key in ours:
                yield from _walk(theirs[key], ours[key], here, where, lenient, but)
            elif not lenient and not here.startswith(("/hashes/inputs/", "/shots/light/kinds/")):
                yield Field(stage_of(here), np.inf, f"{where} is missing {'there' if key in ours else 'here'}")
    elif _of_objects(theirs) or _of_objects(ours):
        yield from _lists(theirs, ours, path, place, lenient, but)
    elif not _within(path, but) and (apart := _apart(theirs, ours)):
        yield Field(stage_of(path), apart, f"{place}: {_said(theirs)} there, {_said(ours)} here")


def _of_objects(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(each, dict) for each in value)


def _lists(theirs: Any, ours: Any, path: str, place: str, lenient: bool, but: tuple[str, ...]) -> Iterator[Field]:
    """Lists of objects, of which the other side may have an empty one, or null."""
    sizes = [len(each) if isinstance(each, list) else 0 for each in (theirs, ours)]
    if sizes[0] != sizes[1]:
        if not lenient:
            yield Field(stage_of(path), np.inf, f"{place}: {sizes[0]} there, {sizes[1]} here")
        return
    for number, (one, other) in enumerate(zip(theirs, ours, strict=True), 1):
        name = other.get("name")
        where = f"{place}[{number}]" + (f" ({name})" if isinstance(name, str) else "")
        yield from _walk(one, other, path, where, lenient, but)


def _apart(theirs: Any, ours: Any) -> float:
    """0 where they are equal."""
    if theirs == ours:
        return 0.0
    numbers = [_numbers(each) for each in (theirs, ours)]
    if numbers[0] is None or numbers[1] is None or numbers[0].shape != numbers[1].shape:
        return float(np.inf)
    size = max(1.0, float(np.max(np.abs(numbers[1]), initial=0.0)))
    return float(np.max(np.abs(numbers[0] - numbers[1]), initial=0.0)) / size


def _numbers(value: Any) -> Any:
    """An array of a number or of a list of numbers, None of anything else."""
    each = value if isinstance(value, list) else [value]
    plain = all(isinstance(one, int | float) and not isinstance(one, bool) for one in each)
    return np.array(value, float) if plain else None


def _said(value: Any) -> str:
    text = f"{value:.9g}" if isinstance(value, float) else str(value)
    return text if len(text) <= 80 else f"{text[:77]}..."
