"""recipe/meta.yaml from pyproject.toml: `python -m tools.conda_recipe [--check] [--sdist dist/camssf-X.Y.Z.tar.gz]`.

Without `--sdist` the recipe builds the checkout that it lies in. With it, the recipe has the form that conda-forge
takes: the source is the file that PyPI will have, with its SHA-256.
"""

from __future__ import annotations

import argparse
import hashlib
import re
import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from camssf.files import write_file

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "recipe" / "meta.yaml"
NAMES = {"matplotlib": "matplotlib-base", "opencv-python-headless": "py-opencv"}
"""What conda-forge calls differently. Its OpenCV has four numbers in PyPI's version and three in its own."""


def requirement(line: str) -> str:
    """A requirement of pyproject.toml as conda writes it."""
    found = re.fullmatch(r"([\w.-]+)(.*)", line)
    assert found is not None, line
    name, bound = found.groups()
    if name == "opencv-python-headless":
        bound = re.sub(r"(\d+\.\d+\.\d+)\.\d+", r"\1", bound)
    return f"{NAMES.get(name, name)} {bound}".strip()


def recipe(project: dict[str, Any], build: Sequence[str], sdist: Path | None = None) -> str:
    """The whole file."""
    source = ["path: .."]
    if sdist is not None:
        base = "https://pypi.org/packages/source/c/camssf/camssf-{{ version }}.tar.gz"
        source = [f"url: {base}", f"sha256: {hashlib.sha256(sdist.read_bytes()).hexdigest()}"]
    script = "{{ PYTHON }} -m pip install . --no-deps --no-build-isolation -vv"
    (command,) = project["scripts"].items()
    python = f"python {project['requires-python']}"
    lines = [
        "# python -m tools.conda_recipe",
        f'{{% set version = "{project["version"]}" %}}',
        "",
        "package:",
        f"  name: {project['name']}",
        "  version: {{ version }}",
        "",
        "source:",
        *(f"  {line}" for line in source),
        "",
        "build:",
        "  number: 0",
        "  noarch: python",
        f"  script: {script}",
        "  entry_points:",
        f"    - {command[0]} = {command[1]}",
        "",
        "requirements:",
        "  host:",
        *(f"    - {each}" for each in (python, "pip", *map(requirement, build))),
        "  run:",
        *(f"    - {each}" for each in (python, *map(requirement, project["dependencies"]))),
        "",
        "test:",
        "  imports:",
        "    - camssf",
        "    - camssf_onnx",
        "  commands:",
        "    - camssf demo -o out",
        "",
        "about:",
        f"  home: {project['urls']['Homepage']}",
        f"  summary: {project['description']}",
        f"  license: {project['license']}",
        "  license_file:",
        *(f"    - {name}" for name in project["license-files"]),
        f"  doc_url: {project['urls']['Documentation']}",
        "",
        "extra:",
        "  recipe-maintainers:",
        "    - camssf",
        "",
    ]
    return "\n".join(lines)


def main(argv: Sequence[str] | None = None) -> int:
    """Write the recipe, or say whether it is pyproject.toml's."""
    parser = argparse.ArgumentParser(prog="python -m tools.conda_recipe", description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing; 1 if the recipe differs")
    parser.add_argument("--sdist", type=Path, help="the source distribution of a release")
    options = parser.parse_args(argv)
    content = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    made = recipe(content["project"], content["build-system"]["requires"], options.sdist)
    if options.check:
        same = PAGE.is_file() and PAGE.read_text("utf-8") == made
        print("The recipe is pyproject.toml's." if same else "The recipe differs: run python -m tools.conda_recipe.")
        return int(not same)
    write_file(PAGE, made.encode())
    return 0


if __name__ == "__main__":
    sys.exit(main())
