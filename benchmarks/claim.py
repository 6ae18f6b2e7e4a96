"""A run of a claim: its options, the tables and bars that it prints and keeps, and its verdict."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence, Sized
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

import numpy as np

from benchmarks.shared import command_parser, console, progress, save, table, versions
from benchmarks.turns import Unavailable

T = TypeVar("T")
TABLES = {"phones": "measured phones", "foreign": "cameras of another laboratory"}
"""Tables that may not be passed on."""


class Run:
    """What a claim is asked for, and what it has found.

    Attributes:
        options: --phones, --foreign, --only, and the OPTIONS of the claim's module.
        kept: what results/NAME.json will hold besides the bars, in place of the tables.
    """

    def __init__(self, name: str, options: argparse.Namespace) -> None:
        self.name, self.options = name, options
        self.kept: dict[str, Any] = {}
        self.parts: dict[str, bool] = {}
        self.tables: dict[str, list[dict[str, Any]]] = {}
        self.bars: list[dict[str, Any]] = []

    @classmethod
    def of(cls, name: str, module: ModuleType, arguments: Sequence[str]) -> Run:
        """The run that the arguments of `python -m benchmarks NAME` ask for."""
        parser = command_parser(None, module.__doc__)
        parser.prog = f"python -m benchmarks {name}"
        for key, words in TABLES.items():
            place = os.environ.get(f"CAMSSF_{key.upper()}") or None
            parser.add_argument(f"--{key}", type=Path, default=place, metavar="CSV", help=words)
        parser.add_argument("--only", default="", help="the part or the devices whose name begins so")
        for key, (default, words) in getattr(module, "OPTIONS", {}).items():
            kind: dict[str, Any] = {"type": type(default)}
            if default is False:
                kind = {"action": "store_true"}
            parser.add_argument(f"--{key}", default=default, help=words, **kind)
        return cls(name, parser.parse_args(arguments))

    def named(self, key: str) -> Path:
        """That table of TABLES; `Unavailable` if it was not named."""
        place: Path | None = getattr(self.options, key)
        if place is None:
            raise Unavailable(f"The {TABLES[key]} are missing: name their table by --{key} or CAMSSF_{key.upper()}.")
        return place

    def wants(self, part: str) -> bool:
        """Whether that part is asked for."""
        self.parts[part] = part.startswith(self.options.only)
        return self.parts[part]

    def track(self, steps: Iterable[T], label: str) -> Iterator[T]:
        """The steps, with a bar of their progress on stderr."""
        with progress() as bar:
            yield from bar.track(steps, total=len(steps) if isinstance(steps, Sized) else None, description=label)

    def table(self, title: str, columns: Mapping[str, str], rows: Iterable[Sequence[Any]]) -> None:
        """Print rows by the formats of their columns; a tuple fills a pattern, None and NaN are left empty."""
        kept = [[_plain(cell) for cell in row] for row in rows]
        words = [[_cell(*pair) for pair in zip(row, columns.values(), strict=True)] for row in kept]
        self.print_table(title, tuple(columns), words)
        self.tables[title] = [dict(zip(columns, row, strict=True)) for row in kept]

    def print_table(self, title: str, head: Sequence[str], lines: Sequence[Sequence[str]]) -> None:
        """Print a table of words."""
        console().print(table(title, head, lines))

    def print_bars(self) -> None:
        """Print the bars."""
        lines = [
            (bar["bar"], f"{bar['value']:.4g}", bar["limit"], "met" if bar["met"] else "MISSED") for bar in self.bars
        ]
        self.print_table("Bars", ("bar", "value", "limit", "verdict"), lines)

    def say(self, words: str) -> None:
        """Print a sentence."""
        console().print(words, highlight=False)

    def bar(self, name: str, value: float, *, least: float | None = None, most: float | None = None) -> None:
        """A bar, met from `least` to `most`; what is not a number misses it."""
        met = (least is None or value >= least) and (most is None or value <= most)
        ends = (f"{sign} {end:g}" for sign, end in (("≥", least), ("≤", most)) if end is not None)
        self.bars.append({"bar": name, "value": float(value), "limit": " and ".join(ends), "met": bool(met)})

    def end(self) -> int:
        """Print the bars, write the results; 1 where a bar is missed; `Unavailable` if --only chose nothing."""
        if self.options.only and not any(self.parts.values()):
            parts = ", ".join(self.parts) or "it is not divided"
            raise Unavailable(f"--only {self.options.only} is no part of {self.name}: {parts}.")
        if self.bars:
            self.print_bars()
        kept = (self.kept or {"tables": self.tables}) | {"bars": self.bars}
        console().print(save(self.name, kept | {"versions": versions("scipy", "colour-science")}))
        return int(any(not bar["met"] for bar in self.bars))


def _plain(cell: Any) -> Any:
    if isinstance(cell, np.generic | np.ndarray):
        return cell.tolist()
    return tuple(map(_plain, cell)) if isinstance(cell, tuple) else cell


def _cell(cell: Any, pattern: str) -> str:
    if cell is None or cell == () or cell != cell:
        return ""
    return (
        pattern.format(*cell) if isinstance(cell, tuple) else format(cell, "" if isinstance(cell, str) else pattern)
    )
