"""The pages of this repository, the code in them, and the pinned libraries."""

import re
import shlex
import tomllib
from pathlib import Path

from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
DOCS = sorted((ROOT / "docs").glob("**/*.md"))
PAGES = [*(ROOT / f"{name}.md" for name in ("README", "CHANGELOG", "CONTRIBUTING", "RELEASING", "SECURITY")), *DOCS]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))


def text_of(name: str) -> str:
    """A file of the repository."""
    return (ROOT / name).read_text("utf-8")


def blocks(text: str, language: str) -> list[str]:
    found = re.findall(rf"^( *)```{language}\n(.*?)^\1```", text, re.DOTALL | re.MULTILINE)
    return ["\n".join(line.removeprefix(indent) for line in body.splitlines()) for indent, body in found]


def calls(line: str) -> list[list[str]]:
    """The camssf commands of a shell line, without redirections."""
    found, current = [], None
    for token in shlex.split(line, comments=True):
        if token in ("|", "&&") or re.fullmatch(r"\d?>.*", token):
            current = None
        elif current is not None:
            current.append(token)
        elif Path(token).name == "camssf":
            found.append(current := [])
    return found


def pins() -> dict[str, str]:
    """The versions of constraints.txt."""
    lines = [line.split("==") for line in text_of("constraints.txt").splitlines() if "==" in line and line[0] != "#"]
    return {canonicalize_name(name): version for name, version in lines}
