"""Writes the SBOM of the Python package, CycloneDX 1.6: `python -m tools.sbom [-o FILE]`.

A wheel requires ranges of versions; the SBOM lists the versions in this environment, in `.ci/run` the pinned ones.
The same environment gives the same bytes: no serial number, no time. Kotlin's SBOMs come from cyclonedx-maven-plugin.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from typing import Any

from camssf import __version__
from camssf.files import write_file
from tools.closure import EXTRAS, Package, closure

SITE = "https://github.com/camssf/camssf"


def _url(name: str, version: str) -> str:
    return f"pkg:pypi/{name}@{version}"


def _licences(said: str) -> list[dict[str, Any]]:
    """The licence as a CycloneDX list: one expression, or one licence with its id."""
    return [{"expression": said}] if " " in said else [{"license": {"id": said}}]


def _component(found: Package) -> dict[str, Any]:
    return {
        "type": "library",
        "bom-ref": _url(found.name, found.version),
        "name": found.name,
        "version": found.version,
        "scope": "optional" if found.direct in EXTRAS else "required",
        "licenses": _licences(found.licence),
        "purl": _url(found.name, found.version),
    }


def document(packages: Sequence[Package]) -> dict[str, Any]:
    """The SBOM of camssf with these packages."""
    own, at = _url("camssf", __version__), {each.name: _url(each.name, each.version) for each in packages}
    asked = [at[each.name] for each in packages if each.direct is not None]
    return {
        "$schema": "http://cyclonedx.org/schema/bom-1.6.schema.json",
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {
            "component": {
                "type": "library",
                "bom-ref": own,
                "name": "camssf",
                "version": __version__,
                "licenses": _licences("Apache-2.0"),
                "purl": own,
                "externalReferences": [{"type": "vcs", "url": SITE}],
            }
        },
        "components": [_component(each) for each in packages],
        "dependencies": [
            {"ref": own, "dependsOn": asked},
            *({"ref": at[each.name], "dependsOn": [at[name] for name in each.needs]} for each in packages),
        ],
    }


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns 1 if a package is not installed."""
    parser = argparse.ArgumentParser(prog="python -m tools.sbom", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("-o", "--out", type=Path, default=Path("dist") / f"camssf-{__version__}-cyclonedx.json")
    options = parser.parse_args(argv)
    try:
        packages = closure()
    except PackageNotFoundError as error:
        print(f"{error.name} is not installed here. Install camssf[test] first.", file=sys.stderr)
        return 1
    options.out.parent.mkdir(parents=True, exist_ok=True)
    write_file(options.out, json.dumps(document(packages), indent=2, ensure_ascii=False) + "\n")
    print(f"{options.out}: camssf {__version__} and {len(packages)} packages")
    return 0


if __name__ == "__main__":
    sys.exit(main())
