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
    """The bounds of the verdict, a quantity a row."""
    refusing = {f"verdict.{number.refuses}" for number in found.numbers.values() if number.refuses}
    lines = ["| number | limit | `name` |", "|---|---|---|"]
    for number in found.numbers.values():
        if number.makes and number.name not in refusing:
            second = [found.numbers[f"verdict.{number.refuses}"]] if number.refuses else []
            lines.append(_quantity([number, *second]))
    return "\n".join(lines)


def _quantity(bounds: list[Number]) -> str:
    """The row of a quantity with its bound, or with the doubtful and the refusing one."""
    names = [number.name.partition(".")[2] for number in bounds]
    cells = [
        bounds[0].what,
        ", ".join(map(_limit, bounds)) + ("" if bounds[0].unit == "1" else f" {bounds[0].unit}"),
        ", ".join(f"`{name}`" for name in names),
    ]
    return f"| {' | '.join(cells)} |"


def _limit(number: Number) -> str:
    """Where an answer is doubtful, or `refused` before it."""
    return f"{'refused ' * (number.makes == 'refused')}{number.beyond} {number.value:.4g}"


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
