"""Compares numbers of two results of the same photos: the size of each difference, and a description.

`document` is the other side's, `made` our own. A field that an older result does not have is no difference.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TypeAlias

import numpy as np

from camssf.documents.basis_choice import hypothesis_in_words
from camssf.grid import CHANNELS, Floats, columns

Json: TypeAlias = dict[str, Any]


def choice_apart(document: Json, made: Json) -> Iterator[tuple[float, str]]:
    """Evidence and probability of each hypothesis. A probability changes by at most as much as a log evidence."""
    for theirs, ours in zip(document.get("choice", ()), made["choice"], strict=False):
        size = max(1.0, abs(ours["log_evidence"]))
        for key in ("log_evidence", "probability"):
            place = f"{key} of {hypothesis_in_words(ours)}"
            yield abs(theirs[key] - ours[key]) / size, f"{place}: {theirs[key]:.9g} there, {ours[key]:.9g} here"


def curve_of(document: Json, key: str) -> Floats | None:
    """A document's curves, (681, 3); None if it has none."""
    found = document.get(key)
    return None if found is None else columns(found)


def curves_apart(document: Json, made: Json, key: str) -> tuple[float, str]:
    """Largest difference of curves, in parts of the peak."""
    theirs, ours = curve_of(document, key), curve_of(made, key)
    if theirs is None or ours is None:
        return (0.0, "no band on either side") if theirs is ours else (np.inf, f"{key} is missing on one side")
    apart = np.abs(theirs - ours)
    g, c = np.unravel_index(int(apart.argmax()), apart.shape)
    nm = made["ssf"]["wavelength_nm"][int(g)]
    place = f"{key}, {CHANNELS[c]} at {nm:g} nm"
    return float(apart.max()), f"{place}: {theirs[g, c]:.9g} there, {ours[g, c]:.9g} here"


def triple_apart(document: Json, made: Json, key: str) -> tuple[float, str]:
    """Largest relative difference of three numbers."""
    theirs, ours = np.array(document[key], float), np.array(made[key], float)
    apart = np.abs(theirs - ours) / np.maximum(np.abs(ours), 1e-300)
    return float(apart.max()), f"{key}: {theirs.tolist()} there, {ours.tolist()} here"


def list_apart(document: Json, made: Json, key: str, scale: float | None) -> tuple[float, str]:
    """Largest difference of a number or list that an older result may lack, in units of `scale`, at least 1."""
    if key not in document:
        return 0.0, f"no {key} there"
    if document[key] is None or made[key] is None:
        return (0.0, f"no {key} on either side") if document[key] is made[key] else (np.inf, f"no {key} on one side")
    theirs, ours = np.atleast_1d(document[key]).astype(float), np.atleast_1d(made[key]).astype(float)
    if theirs.shape != ours.shape:
        return np.inf, f"{key}: {theirs.size} numbers there, {ours.size} here"
    if not theirs.size:
        return 0.0, f"no {key} on either side"
    apart = np.abs(theirs - ours) / max(abs(scale or 0.0), 1.0)
    i = int(apart.argmax())
    place = f"{key}[{i}]" if apart.size > 1 else key
    return float(apart[i]), f"{place}: {theirs[i]:.9g} there, {ours[i]:.9g} here"


def stacked(document: Json, key: str) -> Floats:
    """A number of all patches, (k, n, 3)."""
    return np.array([[patch[key] for patch in shot["patches"]] for shot in document["shots"]], float)


def patch_apart(document: Json, key: str, made: Json, scale: Any) -> tuple[float, str]:
    """Largest difference of a patch number in units of `scale`, and its place in words."""
    theirs, ours = stacked(document, key), stacked(made, key)
    if theirs.shape != ours.shape:
        return np.inf, f"{key}: {theirs.shape[1]} patches there, {ours.shape[1]} here"
    apart = np.abs(theirs - ours) / scale
    j, i, c = np.unravel_index(int(apart.argmax()), apart.shape)
    name = document["shots"][j]["patches"][i]["name"]
    where = f"{key}, shot {j + 1}, patch {i + 1} ({name}), {CHANNELS[c]}"
    return float(apart.max()), f"{where}: {theirs[j, i, c]:.9g} there, {ours[j, i, c]:.9g} here"


def patches_apart(document: Json, made: Json, key: str) -> tuple[float, str]:
    """Largest difference of a patch number that may be missing, on the same patches of both sides; dimensionless."""
    worst, words = 0.0, f"no {key} there"
    for j, (shot, mine) in enumerate(zip(document["shots"], made["shots"], strict=True), 1):
        for i, (theirs, ours) in enumerate(zip(shot["patches"], mine["patches"], strict=True), 1):
            if key not in theirs:  # an older result
                continue
            one, other = theirs[key], ours.get(key)
            if one is None or other is None:
                apart = 0.0 if one is other else np.inf
            else:
                apart = float(np.abs(np.array(one) - np.array(other)).max())
            if apart >= worst:
                worst, words = apart, f"{key}, shot {j}, patch {i} ({theirs['name']}): {one} there, {other} here"
    return worst, words


def uncertainty_apart(document: Json, made: Json) -> Iterator[tuple[float, str]]:
    """Width of the band for each shot and for all shots, and each source's share; an older result may lack these."""
    theirs, ours = document.get("uncertainty"), made["uncertainty"]
    if theirs is None or ours is None:
        missing = "uncertainty" in document and theirs is not ours
        yield (np.inf, "the uncertainty is missing on one side") if missing else (0.0, "no uncertainty there")
        return
    yield list_apart(theirs, ours, "half_width", 1.0)
    yield list_apart(theirs, ours, "alone", 1.0)
    if not theirs["budget"]:
        return
    sources = [[row["source"] for row in each["budget"]] for each in (theirs, ours)]
    if sources[0] != sources[1]:
        yield np.inf, f"sources of the band: {', '.join(sources[0])} there, {', '.join(sources[1])} here"
        return
    for one, other in zip(theirs["budget"], ours["budget"], strict=True):
        apart, words = list_apart(one, other, "share", 1.0)
        yield apart, f"{one['source']}, {words}"
        if one["size"] != other["size"]:
            yield np.inf, f"{one['source']}: {one['size']!r} there, {other['size']!r} here"


def walked(document: Json, made: Json) -> tuple[float, str]:
    """Whether pivoting took any steps. Their number may differ: rounding decides between paths of equal length."""
    ours: list[int] = made["finish_steps"]
    theirs: list[int] = document.get("finish_steps", ours)
    alike = [count > 0 for count in theirs] == [count > 0 for count in ours]
    return 0.0 if alike else np.inf, f"finish_steps: {theirs} there, {ours} here"
