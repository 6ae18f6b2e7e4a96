"""Writes what the tools make, or checks it: whole files, and tables between two marks of a page."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib.machinery import ModuleSpec
from pathlib import Path
from typing import Any, TypeAlias

from benchmarks.shared import command_parser
from camssf.files import write_file
from camssf.recovery.basis import NODES

DATA = Path(__file__).parents[1] / "reference" / "camssf" / "data"
GRID = {"start": float(NODES[0]), "step": float(NODES[1] - NODES[0])}
"""The 5-nm nodes of curves, as JSON."""
Json: TypeAlias = dict[str, Any]
END = "<!-- end -->"
"""The mark behind a table that a tool makes; before it stands the command that makes it."""


def markdown_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    top, *body = ["| " + " | ".join(line) + " |" for line in (head, *rows)]
    return "\n".join([top, "|" + "---|" * len(head), *body])


def filled(page: str, parts: Mapping[str, str]) -> str:
    """The page with new tables, by the commands of their marks.

    Raises:
        ValueError: the page lacks a mark.
    """
    for command, made in parts.items():
        head, mark, rest = page.partition(f"<!-- {command} -->")
        _, end, tail = rest.partition(END)
        if not mark or not end:
            raise ValueError(f"The page has no place for a table: <!-- {command} --> and {END}.")
        page = f"{head}{mark}\n{made}\n{end}{tail}"
    return page


def made_files(
    spec: ModuleSpec | None,
    about: str | None,
    make: Callable[[], Mapping[Path, Any]],
    arguments: Sequence[str] | None = None,
    bounds: Mapping[str, float] | None = None,
) -> int:
    """Run a command that makes files: write them, or with `--check` name those that differ.

    Args:
        spec: of the command's module.
        about: its help.
        make: returns text, or what JSON holds beside the command that makes it, by the files' paths.
        arguments: of the command line.
        bounds: what numbers of JSON may differ by, by a pattern of their path in it; the first that fits counts.

    Returns:
        The exit status: 1 if a file differs.
    """
    parser = command_parser(spec, about)
    parser.add_argument("--check", action="store_true", help="write nothing; 1 if a file differs")
    check = parser.parse_args(arguments).check
    made = {
        path: held if isinstance(held, str) else as_text({"format": held["format"], "generator": parser.prog} | held)
        for path, held in make().items()
    }
    if not check:
        for path, text in made.items():
            write_file(path, text)
        return 0
    stored = {path: path.read_text("utf-8") if path.is_file() else "null" for path in made}
    odd = [
        path.name
        for path, text in made.items()
        if stored[path] != text and not (bounds and near(json.loads(stored[path]), json.loads(text), bounds))
    ]
    print(f"Not what `{parser.prog}` makes: {', '.join(odd)}." if odd else f"{len(made)} files: no difference.")
    return int(bool(odd))


def near(stored: Any, made: Any, bounds: Mapping[str, float], path: str = "") -> bool:
    """Whether two JSON values are the same, but for numbers within the bound of their path."""
    if isinstance(stored, dict) and isinstance(made, dict):
        same = list(stored) == list(made)
        return same and all(near(stored[key], value, bounds, f"{path}/{key}") for key, value in made.items())
    if isinstance(stored, list) and isinstance(made, list):
        same = len(stored) == len(made)
        return same and all(near(stored[i], value, bounds, f"{path}/{i}") for i, value in enumerate(made))
    bound = next((bound for pattern, bound in bounds.items() if re.search(pattern, path)), 0.0)
    numbers = isinstance(stored, float) and isinstance(made, float)
    return bool(stored == made or (numbers and abs(stored - made) <= bound))


def as_text(value: Json) -> str:
    """The value as JSON, with one line for each row of numbers."""

    def lines(value: Any, indent: str) -> str:
        inner = indent + " "
        if isinstance(value, dict) and value:
            parts = [f"{json.dumps(key)}: {lines(each, inner)}" for key, each in value.items()]
            return "{\n" + ",\n".join(inner + part for part in parts) + f"\n{indent}}}"
        if isinstance(value, list) and value and isinstance(value[0], list):
            return "[\n" + ",\n".join(inner + lines(each, inner) for each in value) + f"\n{indent}]"
        return json.dumps(value, allow_nan=False, ensure_ascii=False)

    return lines(value, "") + "\n"
