"""Measures a claim or the speed of a kernel, or lists them: `python -m benchmarks [NAME] [--help]`."""

from __future__ import annotations

import ast
import runpy
import sys
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

from benchmarks.claim import Run
from benchmarks.kernels.turns import Unavailable
from benchmarks.shared import console, one_thread, table

FOLDER = Path(__file__).parent


def named(pattern: str, function: str) -> dict[str, str]:
    """The modules that have such a function: the first line of their docstring, by name."""
    sources = {path.stem: path.read_text("utf-8") for path in sorted(FOLDER.glob(pattern))}
    return {
        name: (ast.get_docstring(ast.parse(source)) or "").split("\n", maxsplit=1)[0]
        for name, source in sources.items()
        if f"\ndef {function}(" in source
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command; 1 where a bar is missed, 2 where something is not here."""
    name, *rest = list(sys.argv[1:] if arguments is None else arguments) or [""]
    claims = named("claims/*.py", "claim")
    others = {word: f"benchmarks.kernels.{word}" for word in named("kernels/*.py", "main")}
    others["paper"] = "benchmarks.paper"
    if name in others:
        sys.argv = [name, *rest]
        runpy.run_module(others[name], run_name="__main__", alter_sys=True)
        return 0
    if name not in claims:
        console().print(table("python -m benchmarks NAME", ("claim", "question"), claims.items()))
        console().print(f"Others: {', '.join(others)}")
        return 0 if name in ("", "-h", "--help") else 2
    module = import_module(f"benchmarks.claims.{name}")
    run = Run.of(name, module, rest)
    try:
        module.claim(run)
        return run.end()
    except Unavailable as error:
        print(error, file=sys.stderr)
        return 2


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
