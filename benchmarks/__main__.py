"""Measures a claim, or lists them with their questions: `python -m benchmarks [NAME] [--help]`."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

from benchmarks.claim import Run
from benchmarks.shared import console, one_thread, table
from benchmarks.turns import Unavailable
from camssf.errors import InvalidArgument

CLAIMS = Path(__file__).parent / "claims"


def questions() -> dict[str, str]:
    """The first line of each claim's docstring, by name."""
    sources = {path.stem: path.read_text("utf-8") for path in sorted(CLAIMS.glob("*.py"))}
    return {
        name: (ast.get_docstring(ast.parse(source)) or "").split("\n", maxsplit=1)[0]
        for name, source in sources.items()
        if "\ndef claim(" in source
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command; 1 where a bar is missed, 2 where something is not here."""
    name, *rest = list(sys.argv[1:] if arguments is None else arguments) or [""]
    claims = questions()
    if name not in claims:
        console().print(table("python -m benchmarks NAME", ("claim", "question"), claims.items()))
        return 0 if name in ("", "-h", "--help") else 2
    try:
        module = import_module(f"benchmarks.claims.{name}")
        run = Run.of(name, module, rest)
        module.claim(run)
        return run.end()
    except subprocess.CalledProcessError as error:
        said = (error.stderr or error.stdout or "").strip().splitlines()
        print(f"{Path(error.cmd[0]).name} failed: {' '.join(said[-3:])}", file=sys.stderr)
    except (Unavailable, InvalidArgument) as error:
        print(error, file=sys.stderr)
    return 2


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
