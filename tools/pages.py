"""Writes what the tools make, or checks it: whole files, and tables between two marks of a page."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from camssf.files import write_files

END = "<!-- end -->"
"""The mark behind a table that a tool makes; before it stands the command that makes it."""
_TEMPLATES = Environment(
    loader=FileSystemLoader(Path(__file__).with_name("templates")),
    undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True,
)  # fmt: skip


def markdown_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    top, *body = ["| " + " | ".join(line) + " |" for line in (head, *rows)]
    return "\n".join([top, "|" + "---|" * len(head), *body])


def template(name: str, **values: Any) -> str:
    """A file of tools/templates with these values."""
    return _TEMPLATES.get_template(name).render(values)


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


def parser(command: str, about: str | None) -> argparse.ArgumentParser:
    """The parser of a command with the option `--check`."""
    made = argparse.ArgumentParser(prog=command, description=(about or "").partition("\n")[0])
    made.add_argument("--check", action="store_true", help="write nothing; 1 if a file is not what would be written")
    return made


def write_or_check(command: str, folder: Path, contents: Mapping[str, str | None], *, check: bool) -> int:
    """Write the files of a folder, or name those that differ.

    Args:
        command: makes them.
        folder: of the files.
        contents: texts by name; None for a file that must not be there.
        check: write nothing.

    Returns:
        The exit status: 1 if a file differs.
    """
    if not check:
        write_files(folder, contents)
        return 0
    there = {name: path.read_text("utf-8") if (path := folder / name).is_file() else None for name in contents}
    odd = sorted(name for name, text in contents.items() if there[name] != text)
    print(f"Not what `{command}` makes: {', '.join(odd)}." if odd else f"{len(there)} files: no difference.")
    return int(bool(odd))
