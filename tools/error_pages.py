"""A page of docs/errors for each error code, and their list: `python -m tools.error_pages [--check]`.

What they say stands in data/errors.json and data/rules.json, as `camssf explain CODE` prints it.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Sequence
from pathlib import Path

from camssf.error_codes import Explained, codes, explain_code
from camssf.files import write_file

FOLDER = Path(__file__).parents[1] / "docs" / "errors"
MADE = "<!--tools.error_pages-->"


def pages() -> dict[str, str]:
    """Every page by its file's name."""
    found = [explain_code(code) for code in codes()]
    made = {f"{each.code}.md": _page(each) for each in found}
    rows = [f"| [`{each.code}`]({each.code}.md) | {_first_sentence(each.means)} |" for each in found]
    head = [
        "# Error codes",
        "",
        MADE,
        "",
        "Every refusal has one of these codes. `camssf explain CODE` prints its page.",
        "",
        "| code | meaning |",
        "|---|---|",
    ]
    return {"index.md": "\n".join([*head, *rows, ""])} | made


def _page(each: Explained) -> str:
    lines = [f"# {each.code}", "", MADE, "", each.means, ""]
    lines += [f"Exit status {each.exit_status}; in Python `camssf.errors.{each.kind}`.", ""]
    lines += ["## Usual causes", "", *(f"- {cause}" for cause in each.causes), ""]
    lines += ["## What to do", "", *(f"{number}. {step}" for number, step in enumerate(each.do, 1)), ""]
    if each.reasons:
        reasons = ", ".join(f"`{reason.name}`" for reason in each.reasons)
        names = dict.fromkeys(f"`{name}`" for reason in each.reasons for name in reason.limits)
        limits = f"; [limits](../verdict.md#thresholds): {', '.join(names)}" if names else ""
        lines += [f"Reasons of the verdict: {reasons}{limits}.", ""]
    lines += ["More: " + ", ".join(f"[{page}](../{page})" for page in each.see) + ".", ""]
    return "\n".join(lines)


def _first_sentence(text: str) -> str:
    """Up to the first full stop or colon that a space follows."""
    return re.split(r"(?<=\.)\s|:\s", text)[0].rstrip(".") + "."


def main(argv: Sequence[str] | None = None) -> int:
    """Write the pages, or say which differ."""
    parser = argparse.ArgumentParser(prog="python -m tools.error_pages", description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing; 1 if a page differs or is too many")
    options = parser.parse_args(argv)
    made = pages()
    there = {path.name: path.read_text("utf-8") for path in FOLDER.glob("*.md")}
    if options.check:
        odd = sorted(name for name in made.keys() | there.keys() if made.get(name) != there.get(name))
        print(f"These differ: {', '.join(odd)}." if odd else "The pages are the table's.")
        return int(bool(odd))
    for name, text in made.items():
        write_file(FOLDER / name, text)
    for name in there.keys() - made.keys():
        (FOLDER / name).unlink()
    return 0


if __name__ == "__main__":
    sys.exit(main())
