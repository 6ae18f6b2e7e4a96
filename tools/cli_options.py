"""The options of every command, as `--help` tells them, which the site shows on the page of the command line."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import typer

from camssf.cli import app
from tools.pages import markdown_table


def tables() -> str:
    """A table for each command that has options."""
    parts = []
    for context in _contexts(typer.main.get_command(app), "camssf"):
        records = [each.get_help_record(context) for each in context.command.params if "--help" not in each.opts]
        rows = [(f"`{record[0]}`", record[1].replace("|", "\\|")) for record in records if record]
        if rows:
            parts.append(f"**`{context.info_name}`**\n\n{markdown_table(('option', 'meaning'), rows)}")
    return "\n\n".join(parts)


def _contexts(command: Any, name: str) -> Iterator[typer.Context]:
    """Of a command of typer's, or of each command of a group."""
    if isinstance(command, typer.core.TyperGroup):
        for inner, each in command.commands.items():
            yield from _contexts(each, f"{name} {inner}")
    else:
        yield typer.Context(command, info_name=name)
