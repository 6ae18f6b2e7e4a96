"""Writes the SBOM of the Python package, CycloneDX 1.6: `python -m tools.sbom [-o FILE]`.

A wheel requires ranges of versions; the SBOM lists the versions in this environment, in `.ci/run` the pinned ones.
The same environment gives the same bytes. Kotlin's SBOMs come from cyclonedx-maven-plugin.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from importlib.metadata import Distribution, distribution
from pathlib import Path
from typing import Any, TypeAlias

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from benchmarks.shared import command_parser
from camssf import __version__
from camssf.files import write_file

EXTRAS = ("app", "passport", "fleet", "colour-science", "cxf", "plot")
"""Extras for users with libraries of their own; `test`, `dev` and `export` are for developers."""
UNSTATED = "not stated"
"""The licence of a package whose metadata give none."""
SPDX = {
    "3-Clause BSD License": "BSD-3-Clause",
    "Apache Software License": "Apache-2.0",
    "BSD License": "BSD-3-Clause",
    "Dual License": "Apache-2.0 OR BSD-3-Clause",
    "ISC License": "ISC",
    "MIT License": "MIT",
    "Python Software Foundation License": "PSF-2.0",
}
"""Identifiers by the last part of the classifier `License :: OSI Approved :: ...`, or the field License."""
Found: TypeAlias = Mapping[str, tuple[str, str]]
"""Version and licence by normalised name; the licence is an SPDX expression if the metadata give one."""


def licence(found: Distribution) -> str:
    """The licence: from License-Expression, else from a classifier, else from the first line of License."""
    said = found.metadata.json  # a plain dictionary, because the message's lookup of missing keys is deprecated
    if expression := said.get("license_expression"):
        return str(expression)
    last = [line.rpartition(" :: ")[2] for line in said.get("classifier", []) if line.startswith("License :: ")]
    classified = [SPDX[word] for word in last if word in SPDX]
    if len(classified) == 1:
        return classified[0]
    words = str(said.get("license", "")).strip().partition("\n")[0]
    return SPDX.get(words, words) or " OR ".join(classified) or UNSTATED


def closure(extras: Sequence[str] = EXTRAS) -> Found:
    """All run-time dependencies of camssf with these extras, direct and indirect, as installed; sorted by name.

    Raises:
        PackageNotFoundError: one of them is not installed here.
    """
    left, seen = [("camssf", extra) for extra in ("", *extras)], set()
    while left:
        name, extra = left.pop()
        if (name, extra) not in seen:
            seen.add((name, extra))
            for need in map(Requirement, distribution(name).requires or []):
                if need.marker is None or need.marker.evaluate({"extra": extra}):
                    left += [(canonicalize_name(need.name), asked) for asked in ("", *need.extras)]
    packages = {name: distribution(name) for name, _ in sorted(seen) if name != "camssf"}
    return {name: (found.version, licence(found)) for name, found in packages.items()}


def document(packages: Found) -> dict[str, Any]:
    """The SBOM of camssf with these packages: cyclonedx-bom's of this environment, without what else is in it."""
    project = str(Path(__file__).parents[1] / "pyproject.toml")
    options = ["--pyproject", project, "--mc-type", "library", "--output-reproducible", "--sv", "1.6"]
    call = [sys.executable, "-m", "cyclonedx_py", "environment", *options, "--no-validate", sys.executable]
    made: dict[str, Any] = json.loads(subprocess.run(call, stdout=subprocess.PIPE, check=True).stdout)
    always = closure(extras=())
    components, refs = [], {made["metadata"]["component"]["bom-ref"]}
    for component in made["components"]:
        name = canonicalize_name(component["name"])
        if name in packages:
            said = packages[name][1]  # the metadata's own words are not always an SPDX expression, and may be missing
            licences = [{"expression": said}] if " " in said else [{"license": {"id": said}}]
            scope = "required" if name in always else "optional"
            components.append(component | {"licenses": licences, "scope": scope})
            refs.add(component["bom-ref"])
    dependencies = [
        {"ref": each["ref"], "dependsOn": [ref for ref in each.get("dependsOn", ()) if ref in refs]}
        for each in made["dependencies"]
        if each["ref"] in refs
    ]
    return made | {"components": components, "dependencies": dependencies}


def main(argv: Sequence[str] | None = None) -> None:
    """Run the command."""
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("-o", "--out", type=Path, default=Path("dist") / f"camssf-{__version__}-cyclonedx.json")
    options, packages = parser.parse_args(argv), closure()
    options.out.parent.mkdir(parents=True, exist_ok=True)
    write_file(options.out, json.dumps(document(packages), indent=2, ensure_ascii=False) + "\n")
    print(f"{options.out}: camssf {__version__} and {len(packages)} packages")


if __name__ == "__main__":
    main()
