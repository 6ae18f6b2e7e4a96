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
from tools.tutorials import BLOCK, TUTORIALS

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files
    from mkdocs.structure.pages import Page

SOURCE = "https://github.com/camssf/camssf/blob/main/docs/"
HEAD = "---\njupyter:\n  kernelspec:\n    display_name: Python 3\n    language: python\n    name: python3\n---\n\n"
FIRST = """\
# The camssf of the Python that runs this notebook: its commands go before any others.
import os
import sys
from importlib.metadata import PackageNotFoundError, files

try:
    (script,) = (path for path in files("camssf") if path.stem == "camssf" and path.parent.name in ("bin", "Scripts"))
except PackageNotFoundError:
    line = f'{sys.executable} -m pip install -e ".[notebook]"'
    where = "a clone of https://github.com/camssf/camssf.git"
    raise ModuleNotFoundError(f"camssf is not installed for this notebook's kernel. In {where}, run {line}") from None
os.environ["PATH"] = os.pathsep.join((str(script.locate().resolve().parent), os.environ["PATH"]))
"""
"""The first cell: a kernel may be any Python, and `%%sh` would find the commands of another, or none."""


def notebook(page: Path) -> str:
    """A page as a notebook: after FIRST its Python blocks are cells, and so are its shell blocks, by `%%sh`.

    Shown outputs are left out: the notebook makes its own. The block that makes an environment stays text. Links to
    other pages lead to the repository.
    """
    text = BLOCK.sub(r"```\1\n\2```\n", page.read_text("utf-8"))
    text = re.sub(r"^```sh\n(?=[^`]*venv)", "```text\n", text, flags=re.MULTILINE)
    text = re.sub(r"\]\(\.\./(images/[^)]+)\)", rf"]({SOURCE}\1?raw=true)", text)
    text = re.sub(r"\]\(\.\./([^)]+)\)", rf"]({SOURCE}\1)", text)
    text = re.sub(r"\]\(([\w-]+\.md[^)]*)\)", rf"]({SOURCE}tutorials/\1)", text)
    made = jupytext.reads(f"{HEAD}```python\n{FIRST}```\n\n{text}", fmt="md")
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
    if path.parent.name != "tutorials":
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
