"""A hook of MkDocs: the site's pages and tables that are made from data, code and test results, and not kept."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from camssf.documents.document import Document
from camssf.documents.schema import described, schema
from camssf.rules import rules
from camssf.spectra.lamps import lamp_aliases
from camssf_fleet.passport.claims import Claims
from camssf_fleet.records import Row
from tools import cli_options, error_pages, faults_table, formats, paper_page, real_page, rules_table, soup, trace
from tools.pages import filled, markdown_table
from tools.reference_names import with_names

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files
    from mkdocs.structure.pages import Page

DOCS = Path(__file__).parents[1] / "docs"


def numbers(name: str) -> dict[str, Any]:
    """What a benchmark's last run left in docs/<name>.json."""
    return dict(json.loads((DOCS / f"{name}.json").read_text("utf-8")))


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


def real_table(name: str) -> str:
    """A table of the measurements on real cameras."""
    return real_page.markdown(numbers("real"))[name]


TABLES: dict[str, dict[str, Callable[[], str]]] = {
    "cli.md": {"tools.cli_options": cli_options.tables},
    "errors/index.md": {"tools.error_pages": error_pages.index},
    "formats.md": {"tools.formats": lambda: formats.tables(schema(Document))},
    "passport.md": {"camssf_fleet.passport.claims": lambda: fields(Claims)},
    "registry.md": {"camssf_fleet.records": lambda: fields(Row)},
    "paper.md": {"tools.paper_page": lambda: paper_page.page(numbers("paper"))},
    "real.md": {
        f"tools.real_page: {name}": partial(real_table, name)
        for name in ("curves", "references", "scatter", "photo", "bars")
    },
    "soup.md": {"tools.soup: python": soup.python_table, "tools.soup: kotlin": soup.kotlin_table},
    "tables.md": {"data/lamp-names.json": lamp_names},
    "traceability.md": {"tools.trace": trace.table},
    "verdict.md": {
        "tools.faults_table: causes": lambda: faults_table.causes(numbers("faults")),
        "tools.faults_table: summary": lambda: faults_table.summary(numbers("faults")),
        "tools.faults_table: faults": lambda: faults_table.table(numbers("faults")),
        "tools.rules_table": lambda: rules_table.markdown(rules()),
    },
}
"""What makes the tables of a page, by their marks in it."""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add a page for each error code."""
    from mkdocs.structure.files import File

    for name, text in error_pages.pages().items():
        files.append(File.generated(config, f"errors/{name}", content=text))
    return files


def on_page_markdown(markdown: str, page: Page, **_: object) -> str:
    """Fill the marks of a page with their tables, and a page of reference with its names."""
    uri = page.file.src_uri
    if uri.startswith("reference/") and not uri.endswith("/index.md"):
        return with_names(markdown)
    made = {mark: make() for mark, make in TABLES.get(uri, {}).items()}
    return filled(markdown, made)
