"""Module names of version 0.1: they still import, and say where the module stands now.

One table and one finder instead of a file for each name. To be removed in the release after the next.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Sequence
from importlib import import_module
from importlib.abc import InspectLoader, MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

FORMER = {
    "_bundled": "spectra.bundled",
    "_opcodes": "photo.opcodes",
    "_page": "documents.page",
    "_tables": "spectra.tables",
    "basis": "curves.basis",
    "batch": "fleet.run",
    "calibrate": "calibration",
    "capture": "photo.capture",
    "chart": "photo.pose",
    "dispersion": "direct.dispersion",
    "engine": "curves.engine",
    "families": "spectra.families",
    "faults": "simulation.faults",
    "learn": "tools.learn",
    "mosaic": "photo.mosaic",
    "patches": "photo.patches",
    "report": "documents.report",
    "sensing": "curves.sensing",
    "signals": "photo.signals",
    "simulate": "simulation.frames",
    "ssf": "curves",
    "tabulate": "tools.tabulate",
    "unrolled": "curves.code",
    "validate": "evidence.scores",
    "verdict": "evidence.verdict",
}
"""Former name → where it stands now, both below `camssf`."""


VERBS = ("calibrate", "validate")
"""Former modules with the name of their verb, which `camssf` itself offers: they can be called."""


class FormerNames(MetaPathFinder):
    """Finds `camssf.<former>` as the module that took its place."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """The spec of a former name; None for every other."""
        package, _, name = fullname.partition(".")
        if package != "camssf" or name not in FORMER:
            return None
        file = Path(__file__).parent / f"{FORMER[name].replace('.', '/')}.py"  # `python -m` tells the code its file
        return ModuleSpec(fullname, _Loader(f"camssf.{FORMER[name]}"), origin=str(file))


class _Loader(InspectLoader):
    """Gives the module that stands there now, its own spec kept; `python -m` runs its code."""

    def __init__(self, now: str) -> None:
        self.now = now

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        warnings.warn(
            f"{spec.name} has become {self.now}; the former name goes with the release after the next.",
            DeprecationWarning,
            stacklevel=2,
        )
        module = import_module(self.now)
        self.spec = module.__spec__
        verb = spec.name.rpartition(".")[2]
        return _Verb(spec.name, module, verb) if verb in VERBS else module

    def exec_module(self, module: ModuleType) -> None:
        if not isinstance(module, _Verb):
            module.__spec__ = self.spec

    def get_code(self, fullname: str) -> CodeType | None:
        spec = find_spec(self.now)
        assert spec is not None
        assert isinstance(spec.loader, InspectLoader)
        return spec.loader.get_code(self.now)

    def get_source(self, fullname: str) -> str | None:
        spec = find_spec(self.now)
        assert spec is not None
        assert isinstance(spec.loader, InspectLoader)
        return spec.loader.get_source(self.now)


class _Verb(ModuleType):
    """A former module that Python puts in the place of the verb of the same name, and that still is that verb."""

    def __init__(self, name: str, now: ModuleType, verb: str) -> None:
        super().__init__(name, now.__doc__)
        self._now, self._verb = now, verb

    def __getattr__(self, name: str) -> Any:
        return getattr(self._now, name)

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        return getattr(self._now, self._verb)(*arguments, **named)


def install() -> None:
    """Ask for former names last, so that a module that is really there always wins."""
    if not any(isinstance(finder, FormerNames) for finder in sys.meta_path):
        sys.meta_path.append(FormerNames())
