"""The table of the thresholds of data/rules.json, which the site shows on the page of the verdict."""

from __future__ import annotations

from camssf.rules import Number, Rules
from tools.pages import markdown_table


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
