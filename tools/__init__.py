"""Tools that write data files and release documents (requirements, SOUP, SBOM) or compare outputs; not shipped."""

from collections.abc import Iterable, Sequence


def markdown_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    top, *body = ["| " + " | ".join(line) + " |" for line in (head, *rows)]
    return "\n".join([top, "|" + "---|" * len(head), *body])
