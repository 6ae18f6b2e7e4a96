"""A page of docs/errors for each error code, and their list: `python -m tools.error_pages [--check]`.

What they say stands in data/errors.json and data/rules.json, as `camssf explain CODE` prints it.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from camssf.error_codes import Explained, codes, explain_code, limits_of, without_holes
from camssf.files import write_file
from camssf.rules import Number

FOLDER = Path(__file__).parents[1] / "docs" / "errors"
MADE = "<!-- python -m tools.error_pages -->"


def pages() -> dict[str, str]:
    """Every page by its file's name."""
    found = [explain_code(code) for code in codes()]
    made = {f"{each.code}.md": _page(each) for each in found}
    rows = [f"| [`{each.code}`]({each.code}.md) | {each.exit_status} | {each.means} |" for each in found]
    head = [
        "# Error codes",
        "",
        MADE,
        "",
        "Every refusal has one of these codes, the same in Python, Kotlin and JSON. `camssf explain CODE` prints it.",
        "",
        "| code | exit status | what it means |",
        "|---|---|---|",
    ]
    return {"index.md": "\n".join([*head, *rows, ""])} | made


def _page(each: Explained) -> str:
    lines = [f"# {each.code}", "", MADE, "", each.means, ""]
    lines += [f"Exit status {each.exit_status}; in Python `camssf.errors.{each.kind}`.", ""]
    lines += ["## Usual causes", "", *(f"- {cause}" for cause in each.causes), ""]
    lines += ["## What to do", "", *(f"{number}. {step}" for number, step in enumerate(each.do, 1)), ""]
    if each.reasons:
        lines += ["## Reasons of the verdict", ""]
        for reason in each.reasons:
            lines += [f"**`{reason.name}`**: {without_holes(reason.message)} {without_holes(reason.advice)}", ""]
            lines += [f"- {_limits(each)}" for each in _by_quantity(limits_of(reason))] + [""]
    lines += ["More: " + ", ".join(f"[{page}](../{page})" for page in each.see) + ", [all codes](index.md).", ""]
    return "\n".join(lines)


def _by_quantity(limits: Sequence[Number]) -> list[list[Number]]:
    """The limits of each quantity together: doubtful, then refused."""
    found: dict[str, list[Number]] = {}
    for limit in limits:
        found.setdefault(limit.what, []).append(limit)
    return list(found.values())


def _limits(limits: Sequence[Number]) -> str:
    """The limits of one quantity in words, for example "doubtful above 4 σ, refused above 8 σ: what it measures"."""
    unit = "" if limits[0].unit == "1" else f" {limits[0].unit}"
    bounds = ", ".join(f"{each.makes} {each.beyond} {each.value:g}{unit}" for each in limits)
    return f"{bounds}: {limits[0].what}"


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
