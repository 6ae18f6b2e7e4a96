"""Writes the SBOM of the Python package, CycloneDX 1.6: `python -m tools.sbom [-o FILE]`.

A wheel requires ranges of versions; the SBOM lists the versions in this environment, in `.ci/run` the pinned ones.
The same environment gives the same bytes. Kotlin's SBOMs come from cyclonedx-maven-plugin.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from typing import Any

from packaging.utils import canonicalize_name

from camssf import __version__
from camssf.files import write_file
from camssf.libraries import install_extra
from tools.closure import Package, closure

PROJECT = Path(__file__).parents[1] / "pyproject.toml"


def document(packages: Sequence[Package]) -> dict[str, Any]:
    """The SBOM of camssf with these packages: cyclonedx-bom's of this environment, without what else is in it."""
    options = ["--pyproject", str(PROJECT), "--mc-type", "library", "--output-reproducible", "--sv", "1.6"]
    call = [sys.executable, "-m", "cyclonedx_py", "environment", *options, "--no-validate", sys.executable]
    made: dict[str, Any] = json.loads(subprocess.run(call, stdout=subprocess.PIPE, check=True).stdout)
    kept, always = {each.name: each for each in packages}, {each.name for each in closure(extras=())}
    components, refs = [], {made["metadata"]["component"]["bom-ref"]}
    for component in made["components"]:
        package = kept.get(canonicalize_name(component["name"]))
        if package is not None:
            said = package.licence  # the metadata's own words are not always an SPDX expression, and may be missing
            licences = [{"expression": said}] if " " in said else [{"license": {"id": said}}]
            scope = "required" if package.name in always else "optional"
            components.append(component | {"licenses": licences, "scope": scope})
            refs.add(component["bom-ref"])
    dependencies = [
        {"ref": each["ref"], "dependsOn": [ref for ref in each.get("dependsOn", ()) if ref in refs]}
        for each in made["dependencies"]
        if each["ref"] in refs
    ]
    return made | {"components": components, "dependencies": dependencies}


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns 1 if a package is not installed."""
    parser = argparse.ArgumentParser(prog="python -m tools.sbom", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("-o", "--out", type=Path, default=Path("dist") / f"camssf-{__version__}-cyclonedx.json")
    options = parser.parse_args(argv)
    try:
        packages = closure()
    except PackageNotFoundError as error:
        print(f"{error.name} is not installed here. {install_extra('test')}", file=sys.stderr)
        return 1
    options.out.parent.mkdir(parents=True, exist_ok=True)
    write_file(options.out, json.dumps(document(packages), indent=2, ensure_ascii=False) + "\n")
    print(f"{options.out}: camssf {__version__} and {len(packages)} packages")
    return 0


if __name__ == "__main__":
    sys.exit(main())
