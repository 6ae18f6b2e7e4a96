"""The thresholds of data/rules.json as docs/verdict.md shows them: `python -m tools.rules_table [--check]`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from camssf.rules import Number, Rules, rules
from tools.pages import filled, markdown_table, parser, write_or_check

PAGE = Path(__file__).parents[1] / "docs" / "verdict.md"
COMMAND = "python -m tools.rules_table"


def markdown(found: Rules) -> str:
    """The bounds of the verdict, a quantity a row."""
    refusing = {f"verdict.{number.refuses}" for number in found.numbers.values() if number.refuses}
    rows = []
    for number in found.numbers.values():
        if number.makes and number.name not in refusing:
            second = [found.numbers[f"verdict.{number.refuses}"]] if number.refuses else []
            rows.append(_quantity([number, *second]))
    return markdown_table(("number", "limit", "`name`"), rows)


def _quantity(bounds: list[Number]) -> list[str]:
    """The row of a quantity with its bound, or with the doubtful and the refusing one."""
    names = [number.name.partition(".")[2] for number in bounds]
    return [
        bounds[0].what,
        ", ".join(map(_limit, bounds)) + ("" if bounds[0].unit == "1" else f" {bounds[0].unit}"),
        ", ".join(f"`{name}`" for name in names),
    ]


def _limit(number: Number) -> str:
    """Where an answer is doubtful, or `refused` before it."""
    return f"{'refused ' * (number.makes == 'refused')}{number.beyond} {number.value:.4g}"


def page(text: str, found: Rules) -> str:
    """The page with its table made anew."""
    return filled(text, {COMMAND: markdown(found)})


def main(argv: Sequence[str] | None = None) -> int:
    """Write the table, or say whether it is the file's."""
    made = {PAGE.name: page(PAGE.read_text("utf-8"), rules())}
    return write_or_check(COMMAND, PAGE.parent, made, check=parser(COMMAND, __doc__).parse_args(argv).check)


if __name__ == "__main__":
    sys.exit(main())
