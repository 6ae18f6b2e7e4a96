"""The public names of the site's pages of reference, each below the first example that uses it."""

from __future__ import annotations

import ast
import re
from importlib import import_module


def public_names(room: str) -> list[str]:
    """What a package exports; of the errors each that has an exit status."""
    module = import_module(room)
    kinds = (name for name, kind in vars(module).items() if isinstance(kind, type) and hasattr(kind, "exit_status"))
    return list(getattr(module, "__all__", None) or kinds)


def names_in(section: str) -> set[str]:
    """The names that the Python of a section uses or imports."""
    blocks = re.findall(r"^```python\n(.*?)^```", section, re.DOTALL | re.MULTILINE)
    nodes = [node for block in blocks for node in ast.walk(ast.parse(block))]
    used = {node.id for node in nodes if isinstance(node, ast.Name)}
    return used | {alias.name for node in nodes if isinstance(node, ast.ImportFrom) for alias in node.names}


def with_names(page: str) -> str:
    """A page whose title is a package, with marks of mkdocstrings; names without an example stand at its end."""
    room = page.partition("\n")[0].removeprefix("# ")
    left = public_names(room)
    sections = re.split(r"^(?=## )", page, flags=re.MULTILINE)
    for i, section in enumerate(sections):
        used = names_in(section)
        last = i == len(sections) - 1
        shown = [name for name in left if name in used or last]
        left = [name for name in left if name not in shown]
        sections[i] = "\n\n".join([section.rstrip(), *(f"::: {room}.{name}" for name in shown)])
    return "\n\n".join(sections) + "\n"
