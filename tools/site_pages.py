"""A hook of MkDocs: the site's pages and tables that are made from data, code and test results, and not kept.

Errors: what they say stands in data/errors.json, data/messages.json and data/rules.json, as `camssf explain CODE`
prints it. On a page of reference each public name stands below the first example that uses it.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import typer
from jinja2 import Environment, StrictUndefined

from camssf.cli import app
from camssf.documents.document import Document
from camssf.documents.schema import described, schema
from camssf.error_codes import codes, explain_code
from camssf.messages import messages
from camssf.rules import Number, rules
from camssf.spectra.lamps import lamp_aliases
from camssf_fleet.passport.claims import Claims
from camssf_fleet.records import Row
from tools import formats, results, soup, trace
from tools.pages import filled, markdown_table

ERROR_PAGE = Environment(
    undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True,
).from_string((Path(__file__).parent / "templates" / "error.md").read_text("utf-8"))  # fmt: skip


def lamp_names() -> str:
    """What people call lamps, and the lamp that each name is read as, or the advice with which it is refused."""
    rows = [
        (", ".join(said.names), f"`{said.lamp}`: {said.what}" if said.lamp else said.advice)
        for said in lamp_aliases()
    ]
    return markdown_table(("name", "lamp, or advice"), rows)


def fields(kind: type) -> str:
    """The fields of a class as its docstring tells them; those that share a meaning share a row."""
    names: dict[str, list[str]] = {}
    for name, meaning in described(kind)[1].items():
        names.setdefault(meaning, []).append(f"`{name}`")
    return markdown_table(("field", "meaning"), [(" ".join(these), meaning) for meaning, these in names.items()])


def options(context: typer.Context | None = None) -> str:
    """The options of every command that has some, as `--help` tells them."""
    context = context or typer.Context(typer.main.get_command(app), info_name="camssf")
    if isinstance(context.command, typer.core.TyperGroup):
        inner = (typer.Context(each, context, name) for name, each in context.command.commands.items())
        return "\n\n".join(filter(None, map(options, inner)))
    records = [each.get_help_record(context) for each in context.command.params if "--help" not in each.opts]
    rows = [(f"`{record[0]}`", record[1].replace("|", "\\|")) for record in records if record]
    return f"**`{context.command_path}`**\n\n{markdown_table(('option', 'meaning'), rows)}" if rows else ""


def limits() -> str:
    """The bounds of the verdict; a quantity with a doubtful and a refusing bound is one row."""
    found = rules().numbers
    refusing = {f"verdict.{number.refuses}" for number in found.values() if number.refuses}
    rows = []
    for number in (each for each in found.values() if each.makes and each.name not in refusing):
        bounds = [number, *([found[f"verdict.{number.refuses}"]] if number.refuses else [])]
        unit = "" if number.unit == "1" else f" {number.unit}"
        names = ", ".join(f"`{each.name.partition('.')[2]}`" for each in bounds)
        rows.append((number.what, ", ".join(map(_limit, bounds)) + unit, names))
    return markdown_table(("number", "limit", "`name`"), rows)


def _limit(number: Number) -> str:
    """Where an answer is doubtful, or `refused` before it."""
    return f"{'refused ' * (number.makes == 'refused')}{number.beyond} {number.value:.4g}"


def error_index() -> str:
    """The list of all codes, with links to their pages, and the first sentence of what each means."""
    every = [explain_code(code) for code in codes()]
    first = {one.code: re.split(r"(?<=\.)\s|:\s", one.means)[0].rstrip(".") + "." for one in every}
    rows = [(f"[`{one.code}`]({one.code}.md)", str(one.exit_status), first[one.code]) for one in every]
    return markdown_table(("code", "exit status", "meaning"), rows)


def error_pages() -> dict[str, str]:
    """The page of each code by its file's name."""
    pages = {}
    for each in map(explain_code, codes()):
        limited = dict.fromkeys(name for reason in each.reasons for name in reason.limits)
        said = [message for message in messages().values() if message.code == each.code]
        rows = [(f"`{message.key}`", f"{message.text} *{message.advice}*") for message in said]
        table = markdown_table(("key", "text and *advice*"), rows) if rows else ""
        pages[f"{each.code}.md"] = ERROR_PAGE.render(error=each, limits=limited, messages=table)
    return pages


def public_names(room: str) -> list[str]:
    """What a package exports; of the errors each that has an exit status."""
    module = import_module(room)
    kinds = (name for name, kind in vars(module).items() if isinstance(kind, type) and hasattr(kind, "exit_status"))
    return list(getattr(module, "__all__", None) or kinds)


def names_in(section: str) -> set[str]:
    """The words of the Python in a section that are no attributes."""
    blocks = re.findall(r"^```python\n(.*?)^```", section, re.DOTALL | re.MULTILINE)
    return set(re.findall(r"(?<![.\w])\w+", "\n".join(blocks)))


def with_names(page: str) -> str:
    """A page whose title is a package, with marks of mkdocstrings; names without an example stand at its end."""
    room = page.partition("\n")[0].removeprefix("# ")
    left = public_names(room)
    sections = re.split(r"^(?=## )", page, flags=re.MULTILINE)
    for i, section in enumerate(sections):
        used = names_in(section) if i < len(sections) - 1 else left
        shown = [name for name in left if name in used]
        left = [name for name in left if name not in shown]
        sections[i] = "\n\n".join([section.rstrip(), *(f"::: {room}.{name}" for name in shown)])
    return "\n\n".join(sections) + "\n"


TABLES: dict[str, dict[str, Callable[[], str]]] = {
    "cli.md": {"camssf.cli": options},
    "errors/index.md": {"camssf.error_codes": error_index},
    "formats.md": {"tools.formats": lambda: formats.tables(schema(Document))},
    "passport.md": {"camssf_fleet.passport.claims": lambda: fields(Claims)},
    "registry.md": {"camssf_fleet.records": lambda: fields(Row)},
    "paper.md": {"benchmarks paper": lambda: results.markdown("paper")},
    "real.md": {"benchmarks real": lambda: results.markdown("real")},
    "soup.md": {f"tools.soup: {language}": partial(soup.table, language) for language in soup.LANGUAGES},
    "tables.md": {"data/lamp-names.json": lamp_names},
    "traceability.md": {"tools.trace": trace.table},
    "verdict.md": {"benchmarks faults": lambda: results.markdown("faults"), "data/rules.json": limits},
}
"""What makes the tables of a page, by their marks in it."""


def on_files(files: Any, config: Any) -> Any:
    """Add a page for each error code."""
    from mkdocs.structure.files import File

    for name, text in error_pages().items():
        files.append(File.generated(config, f"errors/{name}", content=text))
    return files


def on_page_markdown(markdown: str, page: Any, **_: object) -> str:
    """Fill the marks of a page with their tables, and a page of reference with its names."""
    uri = page.file.src_uri
    if uri.startswith("reference/") and not uri.endswith("/index.md"):
        return with_names(markdown)
    made = {mark: make() for mark, make in TABLES.get(uri, {}).items()}
    return filled(markdown, made)
