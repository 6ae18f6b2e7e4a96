"""recipe/meta.yaml, which builds its checkout, from pyproject.toml: `python -m tools.conda_recipe [--check]`."""

from __future__ import annotations

import hashlib
import re
import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path

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


def recipe(sdist: Path | None = None) -> str:
    """The whole file: of the checkout, or in conda-forge's form of the sdist that PyPI will have, by its SHA-256."""
    content = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    source = ["path: .."]
    if sdist is not None:
        base = "https://pypi.org/packages/source/c/camssf/camssf-{{ version }}.tar.gz"
        source = [f"url: {base}", f"sha256: {hashlib.sha256(sdist.read_bytes()).hexdigest()}"]
    lines = (content["build-system"]["requires"], content["project"]["dependencies"])
    build, needs = [list(map(requirement, each)) for each in lines]
    return template("meta.yaml", project=content["project"], source=source, build=build, needs=needs)


def main(argv: Sequence[str] | None = None) -> int:
    """Write the recipe, or say whether it is pyproject.toml's."""
    options = parser(COMMAND, __doc__).parse_args(argv)
    return write_or_check(COMMAND, PAGE.parent, {PAGE.name: recipe()}, check=options.check)


if __name__ == "__main__":
    sys.exit(main())
