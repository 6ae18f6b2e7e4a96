"""Rows of simulated results, and processes that write them: for the tests and the benchmark of the registry."""

from __future__ import annotations

import os
import sys
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import cache

import numpy as np

from camssf.grid import Floats
from camssf_fleet.compare import NM
from camssf_fleet.records import Row
from camssf_fleet.registry import Registry

START = datetime(2026, 1, 1, tzinfo=UTC)
PEAKS = np.array([600.0, 540.0, 460.0])


def bells(shift: Floats | float = 0.0, width: float = 35.0) -> Floats:
    """(3, wavelengths): bells whose centres are moved by so many nm."""
    centre = PEAKS + shift
    return np.exp(-0.5 * ((NM - centre[:, None]) / width) ** 2)


@cache
def plain() -> Row:
    return Row(
        key="0" * 64, added=START, name="", status="accepted", code="", reason="", reasons=(), make="Maker",
        model="Model", camera_id="", serial="A1", lens="", focal_length=None, aperture=None, captured=None,
        chart="classic24", chart_table="BabelColor Average", lamps=("D55",), basis="cameras", engine="onnx",
        software="0.1.0", inputs=("f" * 64,), onnx="e" * 64, made_from="", passport="", place="", delta_e00=0.5,
        rmsre=(0.5, 0.6, 0.7), half_width=0.08, gap=1e-20, evidence=123.0, channel_gain=(0.6, 1.0, 0.7), red=(),
        green=(), blue=(), red_std=(), green_std=(), blue_std=(), extra="",
    )  # fmt: skip


def made(number: int, curves: Floats | None = None, **more: object) -> Row:
    """A row with a key of its own."""
    each = replace(plain(), key=f"{number:064x}", added=START + timedelta(seconds=number))
    if curves is not None:
        red, green, blue = (tuple(curve.tolist()) for curve in curves)
        band = (0.02,) * len(NM)
        each = replace(each, red=red, green=green, blue=blue, red_std=band, green_std=band, blue_std=band)
    return replace(each, **more)  # type: ignore[arg-type]


def write(folder: str, writer: int, rows: int, task: int) -> None:
    """In a process of its own: so many rows in tasks; each key is told once it is acknowledged."""
    registry = Registry(folder, new=True)
    for first in range(0, rows, task):
        numbers = [writer * 1_000_000 + number for number in range(first, min(first + task, rows))]
        registry.add([made(number, bells()) for number in numbers])
        os.write(1, "".join(f"{number:064x}\n" for number in numbers).encode())


def now() -> datetime:
    return datetime.now(UTC)


if __name__ == "__main__":
    write(sys.argv[1], *map(int, sys.argv[2:5]))
