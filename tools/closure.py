"""Lists all run-time dependencies of camssf, direct and indirect, from the metadata of the installed packages."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import Distribution, PackageNotFoundError, distribution

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

EXTRAS = ("app", "passport", "fleet", "colour-science", "cxf", "plot")
"""Extras for users with libraries of their own; `test`, `dev` and `export` are for developers."""
CLASSIFIERS = {
    "Apache Software License": "Apache-2.0",
    "BSD License": "BSD-3-Clause",
    "MIT License": "MIT",
    "Mozilla Public License 2.0 (MPL 2.0)": "MPL-2.0",
    "Python Software Foundation License": "PSF-2.0",
    "The Unlicense (Unlicense)": "Unlicense",
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
    classified = [
        CLASSIFIERS[last]
        for line in said.get("classifier", [])
        if line.startswith("License :: ") and (last := line.rpartition(" :: ")[2]) in CLASSIFIERS
    ]
    if len(classified) == 1:
        return classified[0]
    words = str(said.get("license", "")).strip().partition("\n")[0]
    return WORDS.get(words, words) or " OR ".join(classified) or "not stated"


def needs(found: Distribution, extra: str = "") -> list[Requirement]:
    """Requirements that hold in this environment, for one extra or none."""
    asked = map(Requirement, found.requires or [])
    return [each for each in asked if each.marker is None or each.marker.evaluate({"extra": extra})]


def closure(root: str = "camssf", extras: Sequence[str] = EXTRAS) -> list[Package]:
    """All dependencies of `root` with these extras, sorted by name.

    Raises:
        PackageNotFoundError: one of them is not installed here.
    """
    top = distribution(root)
    open_ = [name for extra in ("", *extras) for name in _wanted(top, extra)]
    found = dict[str, Package]()
    while open_:
        name = open_.pop()
        if name not in found:
            package = distribution(name)
            found[name] = Package(name, package.version, licence(package))
            open_ += _wanted(package)
    return [found[name] for name in sorted(found)]


def _wanted(found: Distribution, extra: str = "") -> set[str]:
    """Names of the requirements, including those of the extras that a requirement asks for."""
    names = set()
    for need in needs(found, extra):
        names.add(canonicalize_name(need.name))
        for asked in need.extras:
            try:
                names |= {canonicalize_name(more.name) for more in needs(distribution(need.name), asked)}
            except PackageNotFoundError:
                names.add(canonicalize_name(need.name))
    return {name for name in names if re.fullmatch(r"[a-z0-9-]+", name)}
