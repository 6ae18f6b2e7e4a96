"""Each tutorial as a Jupyter notebook: `python -m tools.notebooks -o FOLDER`, and a hook of MkDocs.

The site offers each notebook on its page. No notebook is kept in the repository: the pages are the source.
"""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import TYPE_CHECKING

import jupytext

from camssf.files import write_files

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files
    from mkdocs.structure.pages import Page

DOCS = Path(__file__).parents[1] / "docs"
TUTORIALS = sorted(page for page in (DOCS / "tutorials").glob("*.md") if page.stem != "index")
SOURCE = "https://github.com/camssf/camssf/blob/main/docs/"
HEAD = "---\njupyter:\n  kernelspec:\n    display_name: Python 3\n    language: python\n    name: python3\n---\n\n"


def notebook(page: Path) -> str:
    """A page as a notebook: its Python blocks are cells, and so are its shell blocks, by `%%sh`.

    The block that makes an environment stays text: who opens the notebook has one. Links to other pages lead to the
    repository.
    """
    text = page.read_text("utf-8")
    text = re.sub(r"^```sh\n(?=[^`]*venv)", "```text\n", text, flags=re.MULTILINE)
    text = re.sub(r"\]\(\.\./([^)]+)\)", rf"]({SOURCE}\1)", text)
    text = re.sub(r"\]\(([\w-]+\.md[^)]*)\)", rf"]({SOURCE}tutorials/\1)", text)
    made = jupytext.reads(HEAD + text, fmt="md")
    for number, cell in enumerate(made.cells):
        cell.id = f"cell-{number}"  # the same page gives the same bytes
    return str(jupytext.writes(made, fmt="ipynb"))


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the notebooks to the site."""
    from mkdocs.structure.files import File

    for page in TUTORIALS:
        files.append(File.generated(config, f"tutorials/{page.stem}.ipynb", content=notebook(page)))
    return files


def on_page_markdown(markdown: str, page: Page, **_: object) -> str:
    """Offer the notebook below a tutorial's title."""
    path = Path(page.file.src_uri)
    if path.parent.name != "tutorials" or path.stem == "index":
        return markdown
    title, _break, rest = markdown.partition("\n")
    return f"{title}\n\n[This page as a Jupyter notebook]({path.stem}.ipynb)\n{rest}"


def main() -> None:
    """Write the notebooks into a folder."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("-o", "--out", type=Path, required=True, help="folder for the notebooks")
    write_files(parser.parse_args().out, {f"{page.stem}.ipynb": notebook(page) for page in TUTORIALS})


if __name__ == "__main__":
    main()
