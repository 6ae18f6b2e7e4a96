"""A page of docs/errors for each error code, and their list: `python -m tools.error_pages [--check]`.

What they say stands in data/errors.json, data/messages.json and data/rules.json, as `camssf explain CODE` prints it.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from pathlib import Path

from camssf.error_codes import Explained, codes, explain_code
from camssf.messages import messages
from tools.pages import markdown_table, parser, template, write_or_check

COMMAND = "python -m tools.error_pages"
FOLDER = Path(__file__).parents[1] / "docs" / "errors"
MADE = "<!--tools.error_pages-->"


def pages() -> dict[str, str]:
    """Every page by its file's name."""
    found = [explain_code(code) for code in codes()]
    rows = [(f"[`{each.code}`]({each.code}.md)", _first_sentence(each.means)) for each in found]
    index = template("errors.md", mark=MADE, table=markdown_table(("code", "meaning"), rows))
    return {"index.md": index} | {f"{each.code}.md": _page(each) for each in found}


def _page(each: Explained) -> str:
    limits = dict.fromkeys(name for reason in each.reasons for name in reason.limits)
    said = [message for message in messages().values() if message.code == each.code]
    rows = [(f"`{message.key}`", f"{message.text} *{message.advice}*") for message in said]
    table = markdown_table(("key", "text and *advice*"), rows) if rows else ""
    return template("error.md", mark=MADE, error=each, limits=limits, messages=table)


def _first_sentence(text: str) -> str:
    """Up to the first full stop or colon that a space follows."""
    return re.split(r"(?<=\.)\s|:\s", text)[0].rstrip(".") + "."


def main(argv: Sequence[str] | None = None) -> int:
    """Write the pages, or say which differ."""
    made: dict[str, str | None] = dict.fromkeys(path.name for path in FOLDER.glob("*.md"))
    return write_or_check(COMMAND, FOLDER, made | pages(), check=parser(COMMAND, __doc__).parse_args(argv).check)


if __name__ == "__main__":
    sys.exit(main())
