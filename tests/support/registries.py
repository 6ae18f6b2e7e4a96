"""Rows of simulated results, and processes that write them: for the tests of the registry."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from camssf.grid import Floats
from camssf_fleet import record_files
from camssf_fleet.compare import NM
from camssf_fleet.record_queries import connection
from camssf_fleet.records import JobEnd, Row
from camssf_fleet.registry import Registry
from tests.support.processes import SEARCH

if TYPE_CHECKING:
    import pytest

START = datetime(2026, 1, 1, tzinfo=UTC)


def bells(shift: Floats | float = 0.0, width: float = 35.0) -> Floats:
    """(3, wavelengths): bells whose centres are moved by so many nm."""
    centre = np.array([600.0, 540.0, 460.0]) + shift
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
    values: dict[str, Any] = {"key": f"{number:064x}", "added": START + timedelta(seconds=number)}
    if curves is not None:
        for colour, curve in zip(("red", "green", "blue"), curves, strict=True):
            values |= {colour: tuple(curve.tolist()), f"{colour}_std": (0.02,) * len(NM)}
    return replace(plain(), **values | more)


def ended(name: str, key: str = "", **more: Any) -> JobEnd:
    """The end of a job."""
    return JobEnd(f"t{name}", f"j{name}", "", START, name, "failed", "", "", key, **more)


def history(count: int, drift: float, step: float = 0.0) -> list[Row]:
    """Results of one unit every month; red's centre drifts by so many nm a year, and steps before the last."""
    dice, rows = np.random.default_rng(0), []
    for month in range(count):
        red = drift * month / 12 + step * (month == count - 1)
        curves = bells(np.array([red, 0, 0]) + 0.3 * dice.standard_normal(3))
        rows.append(made(month, curves, captured=START + timedelta(days=30.4 * month)))
    return rows


def far_off(**more: Any) -> Row:
    """A result of the unit of `history`, newer than its first five; so far off that it is doubtful."""
    row = made(50, bells(np.array([0.0, 0.0, 12.0])), captured=START + timedelta(days=200), status="doubtful")
    why = {"code": "lamp_unfit", "reason": "The photo fits D:4300 better.", "inputs": ("b" * 64,)}
    return replace(row, **why | more)


def correct(registry: Registry, *rows: Row) -> Any:
    """Add rows, also where they contradict."""
    return Registry(registry.folder, new=True, correct=True).add(list(rows))


def keys(registry: Registry) -> list[str]:
    return [str(found["key"]) for found in registry.query("SELECT key FROM rows ORDER BY key")]


def holding(registry: Registry, condition: str) -> list[Path]:
    """Files with such records."""
    sql = f"SELECT DISTINCT filename FROM stored WHERE {condition} ORDER BY filename"
    return [Path(name) for (name,) in registry.files.ask(lambda con: con.execute(sql).fetchall())]


def rewritten(file: Path, columns: str, to: Path, where: str = "true") -> Path:
    """Another program's copy of a file, with other columns or fewer rows, named by its content in this folder."""
    part = to / "rewritten"
    with connection() as con:
        con.execute(f"COPY (SELECT {columns} FROM '{file}' WHERE {where}) TO '{part}' (FORMAT parquet)")
    return part.rename(to / f"{hashlib.sha256(part.read_bytes()).hexdigest()}.parquet")


def meanwhile(patch: pytest.MonkeyPatch, method: str, act: Callable[[], object]) -> None:
    """Somebody else acts once, right after this process's next call of a method such as `RecordFiles.sizes`."""
    owner = Registry if method.startswith("Registry.") else record_files.RecordFiles
    name = method.partition(".")[2]
    real = getattr(owner, name)

    def call(self: Any, *values: Any) -> Any:
        patch.setattr(owner, name, real)
        answer = real(self, *values)
        act()
        return answer

    patch.setattr(owner, name, call)


@contextmanager
def writing(folder: str, rows: dict[int, int]) -> Iterator[list[subprocess.Popen[bytes]]]:
    """Processes of these numbers that write so many rows in tasks of five; whichever runs at the end is killed."""
    command = [sys.executable, "-m", "tests.support.registries", folder]
    how: Any = {"bufsize": 0, "stdout": subprocess.PIPE, "env": os.environ | {"PYTHONPATH": SEARCH}}
    writers = [subprocess.Popen([*command, str(number), str(count), "5"], **how) for number, count in rows.items()]
    try:
        yield writers
    finally:
        for process in writers:
            process.kill()
            process.wait()


def write(folder: str, writer: int, rows: int, task: int) -> None:
    """In a process of its own: so many rows in tasks; each key is told once it is acknowledged."""
    registry = Registry(folder, new=True)
    for first in range(0, rows, task):
        numbers = [writer * 1_000_000 + number for number in range(first, min(first + task, rows))]
        registry.add([made(number, bells()) for number in numbers])
        os.write(1, "".join(f"{number:064x}\n" for number in numbers).encode())


if __name__ == "__main__":
    write(sys.argv[1], *map(int, sys.argv[2:5]))
