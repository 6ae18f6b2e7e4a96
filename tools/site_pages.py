"""A hook of MkDocs: the site's pages and tables that are made from data, code and test results, and not kept."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from camssf.documents.document import Document
from camssf.documents.schema import described, schema
from camssf.rules import rules
from camssf.spectra.lamps import lamp_aliases
from camssf_fleet.passport.claims import Claims
from camssf_fleet.records import Row
from tools import cli_options, error_pages, formats, results, rules_table, soup, trace
from tools.pages import filled, markdown_table
from tools.reference_names import with_names

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files
    from mkdocs.structure.pages import Page


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


TABLES: dict[str, dict[str, Callable[[], str]]] = {
    "cli.md": {"tools.cli_options": cli_options.tables},
    "errors/index.md": {"tools.error_pages": error_pages.index},
    "formats.md": {"tools.formats": lambda: formats.tables(schema(Document))},
    "passport.md": {"camssf_fleet.passport.claims": lambda: fields(Claims)},
    "registry.md": {"camssf_fleet.records": lambda: fields(Row)},
    "paper.md": {"benchmarks paper": lambda: results.markdown("paper")},
    "real.md": {"benchmarks real": lambda: results.markdown("real")},
    "soup.md": {f"tools.soup: {language}": partial(soup.table, language) for language in soup.LANGUAGES},
    "tables.md": {"data/lamp-names.json": lamp_names},
    "traceability.md": {"tools.trace": trace.table},
    "verdict.md": {
        "benchmarks faults": lambda: results.markdown("faults"),
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
