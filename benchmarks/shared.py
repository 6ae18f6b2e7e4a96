"""What the benchmarks share: measured tables, arguments, tables on the terminal and results."""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from importlib.machinery import ModuleSpec
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from camssf.files import write_file
from camssf.grid import Floats
from camssf.recovery import basis as bases
from camssf.recovery.basis import Basis, interpolate
from camssf.recovery.covariance import LAMP_CORRELATION, smooth_errors
from camssf.spectra import read_chart, read_lamp

RESULTS = Path(__file__).parent / "results"
LAMP_SMOOTH = 0.02
TABLE = "classic24:babelcolor"
"""The chart's table, fixed: the chart in the photo is often Ohta's, in place of a chart without a measured table."""
CURVES = Path(__file__).parents[1] / "data" / "ssf" / "rawtoaces.csv"


@contextmanager
def standing_in(*others: Basis) -> Iterator[None]:
    """Within, the reference engine reads these for the shipped bases of their names: `auto` on a camera left out."""
    shipped = bases.basis_file

    with tempfile.TemporaryDirectory() as folder:
        paths = {basis.name: Path(folder) / f"{basis.name}.npz" for basis in others}
        for basis in others:
            nodes = {"mean": basis.mean[:, ::10], "dictionary": basis.dictionary[:, ::10]}
            np.savez(paths[basis.name], **nodes, source=np.array(basis.source))
        bases.basis_file = lambda spec: paths[spec] if spec in paths else shipped(spec)
        bases.read_basis.cache_clear()
        try:
            yield
        finally:
            bases.basis_file = shipped
            bases.read_basis.cache_clear()


@cache
def cameras() -> dict[str, Floats]:
    """The 52 measured cameras, name → (681, 3)."""
    from camssf_lab.learning.training import read_curves

    return {name: interpolate(curve) for name, curve in read_curves(CURVES).items()}


@cache
def chart() -> Floats:
    """(24, 681) BabelColor's table."""
    return read_chart("classic24").values


@cache
def lamp(name: str) -> Floats:
    """(681,)."""
    return read_lamp(name).values


def ripple(rng: np.random.Generator) -> Floats:
    """(681,) by what factor a lamp differs that is off by a smooth 2 %."""
    smooth = interpolate(smooth_errors(LAMP_CORRELATION))
    return np.asarray(np.exp(LAMP_SMOOTH * (smooth @ rng.normal(size=smooth.shape[1]))))


def versions(*packages: str) -> dict[str, str]:
    """Versions of the packages that are there, and the processor's architecture."""
    found = {"python": platform.python_version(), "machine": platform.machine()}
    for name in ("numpy", "onnxruntime", *packages):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found


def command_parser(spec: ModuleSpec | None, doc: str | None) -> argparse.ArgumentParser:
    """The arguments of `python -m MODULE`, whose docstring is the help."""
    name = f"python -m {spec.name.removesuffix('.__main__')}" if spec else None
    return argparse.ArgumentParser(prog=name, description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)


def one_thread(spec: ModuleSpec | None) -> None:
    """Start the command anew with every library held to one thread: the limits must stand before NumPy is loaded."""
    pools = ("OMP", "OPENBLAS", "MKL", "BLIS", "VECLIB_MAXIMUM", "NUMEXPR", "NUMBA", "RAYON")
    limits = {f"{name}_NUM_THREADS": "1" for name in pools}
    if any(os.environ.get(name) != value for name, value in limits.items()):
        assert spec is not None
        os.execve(sys.executable, [sys.executable, "-m", spec.name, *sys.argv[1:]], os.environ | limits)


def console() -> Console:
    """Tables go to stdout, wide enough where that is a file."""
    return Console() if Console().is_terminal else Console(width=240)


def progress() -> Progress:
    """A bar on stderr."""
    return Progress(
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
        TimeRemainingColumn(), console=Console(stderr=True), transient=True,
    )  # fmt: skip


def table(title: str, head: Sequence[str], rows: Iterable[Sequence[object]]) -> Table:
    """Words left, numbers right."""
    made = Table(title=title, title_justify="left")
    lines = [[str(cell) for cell in row] for row in rows]
    for i, name in enumerate(head):
        number = bool(lines) and all(not line[i] or line[i][0] in "0123456789-.+<" for line in lines)
        made.add_column(name, justify="right" if number else "left")
    for line in lines:
        made.add_row(*line)
    return made


def save(name: str, content: dict[str, Any]) -> str:
    """Write results/NAME.json whole or not at all; returns its place relative to the repository."""
    RESULTS.mkdir(exist_ok=True)
    write_file(RESULTS / f"{name}.json", json.dumps(content, indent=1, ensure_ascii=False) + "\n")
    return f"benchmarks/results/{name}.json"
