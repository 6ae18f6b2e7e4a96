"""What a benchmark found, for its page: `python -m tools.results NAME` keeps its last run as docs/NAME.json.

The site shows below the page's mark `<!-- benchmarks NAME -->` what `python -m benchmarks NAME` printed.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from benchmarks.claim import Run
from benchmarks.claims import faults, paper, real
from benchmarks.shared import RESULTS, command_parser
from camssf.files import write_file
from tools.pages import markdown_table

DOCS = Path(__file__).parents[1] / "docs"
SHOW: dict[str, Callable[[Run, Any], None]] = {"faults": faults.show, "paper": paper.show, "real": real.show}
"""What prints the numbers of a benchmark, by its name."""


class Shown(Run):
    """Takes as Markdown what a benchmark prints."""

    parts_of_page: list[str]

    def print_table(self, title: str, head: Sequence[str], lines: Sequence[Sequence[str]]) -> None:
        """Keep a table."""
        self.parts_of_page.append(f"**{title}**\n\n{markdown_table(head, lines)}")

    def say(self, words: str) -> None:
        """Keep a sentence."""
        self.parts_of_page.append(words.replace("  ", "- ", 1) if words.startswith("  ") else words)


def markdown(name: str) -> str:
    """What a benchmark printed, and its bars, from the numbers in docs/NAME.json."""
    found, page = json.loads((DOCS / f"{name}.json").read_text("utf-8")), Shown(name, argparse.Namespace())
    page.parts_of_page = []
    SHOW[name](page, found)
    page.bars = found["bars"]
    page.print_bars()
    return "\n\n".join(page.parts_of_page)


def main() -> None:
    """Keep the numbers."""
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("name", choices=SHOW)
    name = parser.parse_args().name
    words = (RESULTS / f"{name}.json").read_text("utf-8")
    found = json.loads(words, parse_float=lambda number: float(f"{float(number):.5g}"))
    del found["versions"]
    write_file(DOCS / f"{name}.json", json.dumps(found, indent=1, ensure_ascii=False) + "\n")


if __name__ == "__main__":
    main()
