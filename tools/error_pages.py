"""The site's page for each error code, and their list.

What they say stands in data/errors.json, data/messages.json and data/rules.json, as `camssf explain CODE` prints it.
"""

from __future__ import annotations

import re

from camssf.error_codes import Explained, codes, explain_code
from camssf.messages import messages
from tools.pages import markdown_table, template


def pages() -> dict[str, str]:
    """The page of each code by its file's name."""
    return {f"{code}.md": _page(explain_code(code)) for code in codes()}


def index() -> str:
    """The list of all codes, with links to their pages."""
    every = [explain_code(code) for code in codes()]
    rows = [(f"[`{one.code}`]({one.code}.md)", str(one.exit_status), _first_sentence(one.means)) for one in every]
    return markdown_table(("code", "exit status", "meaning"), rows)


def _page(each: Explained) -> str:
    limits = dict.fromkeys(name for reason in each.reasons for name in reason.limits)
    said = [message for message in messages().values() if message.code == each.code]
    rows = [(f"`{message.key}`", f"{message.text} *{message.advice}*") for message in said]
    table = markdown_table(("key", "text and *advice*"), rows) if rows else ""
    return template("error.md", error=each, limits=limits, messages=table)


def _first_sentence(text: str) -> str:
    """Up to the first full stop or colon that a space follows."""
    return re.split(r"(?<=\.)\s|:\s", text)[0].rstrip(".") + "."
