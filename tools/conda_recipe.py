"""recipe/meta.yaml from pyproject.toml: `python -m tools.conda_recipe [--check] [--sdist dist/camssf-X.Y.Z.tar.gz]`.

Without `--sdist` the recipe builds the checkout that it lies in. With it, the recipe has the form that conda-forge
takes: the source is the file that PyPI will have, with its SHA-256.
"""

from __future__ import annotations

import hashlib
import re
import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tools.pages import parser, template, write_or_check

ROOT = Path(__file__).parents[1]
COMMAND = "python -m tools.conda_recipe"
PAGE = ROOT / "recipe" / "meta.yaml"
OPENCV = "opencv-python-headless"
"""conda-forge's py-opencv; it has four numbers in PyPI's version and three in its own."""


def requirement(line: str) -> str:
    """A requirement of pyproject.toml as conda writes it."""
    found = re.fullmatch(r"([\w.-]+)(.*)", line)
    assert found is not None, line
    name, bound = found.groups()
    if name == OPENCV:
        name, bound = "py-opencv", re.sub(r"(\d+\.\d+\.\d+)\.\d+", r"\1", bound)
    return f"{name} {bound}".strip()


def recipe(project: dict[str, Any], build: Sequence[str], sdist: Path | None = None) -> str:
    """The whole file."""
    source = ["path: .."]
    if sdist is not None:
        base = "https://pypi.org/packages/source/c/camssf/camssf-{{ version }}.tar.gz"
        source = [f"url: {base}", f"sha256: {hashlib.sha256(sdist.read_bytes()).hexdigest()}"]
    needs = [list(map(requirement, lines)) for lines in (build, project["dependencies"])]
    return template("meta.yaml", project=project, source=source, build=needs[0], needs=needs[1])


def main(argv: Sequence[str] | None = None) -> int:
    """Write the recipe, or say whether it is pyproject.toml's."""
    command = parser(COMMAND, __doc__)
    command.add_argument("--sdist", type=Path, help="the source distribution of a release")
    options = command.parse_args(argv)
    content = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    made = recipe(content["project"], content["build-system"]["requires"], options.sdist)
    return write_or_check(COMMAND, PAGE.parent, {PAGE.name: made}, check=options.check)


if __name__ == "__main__":
    sys.exit(main())
