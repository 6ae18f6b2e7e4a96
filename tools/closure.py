"""Lists all run-time dependencies of camssf, direct and indirect, from the metadata of the installed packages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import Distribution, distribution

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

EXTRAS = ("app", "passport", "fleet", "colour-science", "cxf", "plot")
"""Extras for users with libraries of their own; `test`, `dev` and `export` are for developers."""
UNSTATED = "not stated"
"""The licence of a package whose metadata give none."""
CLASSIFIERS = {
    "Apache Software License": "Apache-2.0",
    "BSD License": "BSD-3-Clause",
    "MIT License": "MIT",
    "Python Software Foundation License": "PSF-2.0",
}
"""SPDX identifiers by the last part of the classifier `License :: OSI Approved :: ...`."""
WORDS = {
    "3-Clause BSD License": "BSD-3-Clause", "Dual License": "Apache-2.0 OR BSD-3-Clause", "ISC License": "ISC",
}  # fmt: skip
"""SPDX identifiers by other texts in the field License."""


@dataclass(frozen=True)
class Package:
    """One installed distribution.

    Attributes:
        name: normalised as by `packaging`.
        version: the installed version.
        licence: an SPDX expression if the metadata give one, else their text.
    """

    name: str
    version: str
    licence: str


def licence(found: Distribution) -> str:
    """The licence: from License-Expression, else from a classifier, else from the first line of License."""
    said = found.metadata.json  # a plain dictionary, because the message's lookup of missing keys is deprecated
    if expression := said.get("license_expression"):
        return str(expression)
    last = [line.rpartition(" :: ")[2] for line in said.get("classifier", []) if line.startswith("License :: ")]
    classified = [CLASSIFIERS[word] for word in last if word in CLASSIFIERS]
    if len(classified) == 1:
        return classified[0]
    words = str(said.get("license", "")).strip().partition("\n")[0]
    return WORDS.get(words, words) or " OR ".join(classified) or UNSTATED


def closure(root: str = "camssf", extras: Sequence[str] = EXTRAS) -> list[Package]:
    """All dependencies of `root` with these extras, sorted by name.

    Raises:
        PackageNotFoundError: one of them is not installed here.
    """
    left, seen = [(root, extra) for extra in ("", *extras)], set()
    while left:
        name, extra = left.pop()
        if (name, extra) not in seen:
            seen.add((name, extra))
            for need in map(Requirement, distribution(name).requires or []):
                if need.marker is None or need.marker.evaluate({"extra": extra}):
                    left += [(canonicalize_name(need.name), asked) for asked in ("", *need.extras)]
    packages = {name: distribution(name) for name, _ in sorted(seen) if name != root}
    return [Package(name, found.version, licence(found)) for name, found in packages.items()]
