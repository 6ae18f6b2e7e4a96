"""The thresholds of data/rules.json as docs/verdict.md shows them: `python -m tools.rules_table [--check]`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from camssf.files import write_file
from camssf.rules import Number, Rules, rules

PAGE = Path(__file__).parents[1] / "docs" / "verdict.md"
BEGIN, END = "<!-- python -m tools.rules_table -->", "<!-- end of the rules -->"


def markdown(found: Rules) -> str:
    """The bounds of the verdict, then every other number."""
    bounds = [number for number in found.numbers.values() if number.makes]
    rest = [number for number in found.numbers.values() if not number.makes]
    lines = ["| number | unit | doubtful | refused | `name` | code | why |", "|---|---|---|---|---|---|---|"]
    lines += [_bound(number, found) for number in bounds]
    lines += ["", "The other numbers that both languages read:", ""]
    lines += ["| number | value | unit | `name` | why |", "|---|---|---|---|---|"]
    lines += [
        f"| {number.what} | {_value(number)} | {number.unit} | `{number.name}` | {number.why} |" for number in rest
    ]
    return "\n".join(lines)


def _bound(number: Number, found: Rules) -> str:
    name = number.name.partition(".")[2]
    codes = sorted({wording.code for wording in found.reasons.values() if name in wording.limits})
    value = f"{number.beyond} {_value(number)}"
    columns = [value if number.makes == makes else "" for makes in ("doubtful", "refused")]
    cells = [number.what, number.unit, *columns, f"`{name}`", " ".join(f"`{code}`" for code in codes), number.why]
    return "| " + " | ".join(cells) + " |"


def _value(number: Number) -> str:
    return f"{number.value:.4g}"


def page(text: str, found: Rules) -> str:
    """The page with its table made anew."""
    head, begin, rest = text.partition(BEGIN)
    _, end, tail = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"{PAGE.name} has no place for the table: {BEGIN} and {END}")
    return f"{head}{BEGIN}\n{markdown(found)}\n{END}{tail}"


def main(argv: Sequence[str] | None = None) -> int:
    """Write the table, or say whether it is the file's."""
    parser = argparse.ArgumentParser(prog="python -m tools.rules_table", description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing; 1 if the page differs")
    options = parser.parse_args(argv)
    text = PAGE.read_text("utf-8")
    made = page(text, rules())
    if options.check:
        print("The table is the file's." if made == text else "The table differs: run python -m tools.rules_table.")
        return int(made != text)
    write_file(PAGE, made.encode())
    return 0


if __name__ == "__main__":
    sys.exit(main())
