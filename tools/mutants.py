"""Breaks the code on purpose, one line at a time, and says which test notices: `python -m tools.mutants [WORD ...]`.

A row of tests/mutants.json says in words `what` is wrong, in which `file` a piece of text that `was` there once
`becomes` another, and which `tests` are run, one of which must fail; words choose the rows whose `what` has one of
them. The work is done on a copy. Exits with 1 if a change is not noticed, or a test fails without one.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.shared import command_parser

ROOT = Path(__file__).parents[1]
COPIED = ("reference", "export", "tests", "golden", "data", "tools", "benchmarks", "pyproject.toml")


def mutants() -> list[dict[str, str]]:
    """All rows of the table."""
    return list(json.loads((ROOT / "tests" / "mutants.json").read_text("utf-8")))


def with_fault(mutant: dict[str, str]) -> str:
    """The file's text with the fault.

    Raises:
        ValueError: the replaced text is not there, or more than once.
    """
    text, was = (ROOT / mutant["file"]).read_text("utf-8"), mutant["was"]
    if text.count(was) != 1:
        raise ValueError(f"{mutant['file']} has {was!r} {text.count(was)} times: {mutant['what']}")
    return text.replace(was, mutant["becomes"])


def failing(tests: str, root: Path) -> str:
    """The first of these tests that fails in the copy `root`; "" if none does."""
    path = os.pathsep.join(str(root / folder) for folder in ("reference", "export", "."))
    run = subprocess.run(
        [sys.executable, "-m", "pytest", "-x", "-q", "-n", "0", "-p", "no:cacheprovider", *tests.split()],
        cwd=root, env=os.environ | {"PYTHONPATH": path, "COLUMNS": "300"}, capture_output=True, text=True,
    )  # fmt: skip
    if run.returncode not in (0, 1, 2):  # neither passed nor failed, nor an error at import
        raise RuntimeError(f"pytest ended with {run.returncode}: {run.stdout}{run.stderr}")
    return "".join(re.findall(r"^(?:FAILED|ERROR) (\S+)", run.stdout, re.MULTILINE)[:1])


def main() -> int:
    """The command."""
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("words", nargs="*", metavar="WORD")
    words = parser.parse_args().words
    chosen = [each for each in mutants() if not words or any(word in each["what"] for word in words)]
    missed = 0
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        for name in COPIED:
            copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
            copy(ROOT / name, root / name)
        if broken := next(filter(None, (failing(tests, root) for tests in {each["tests"] for each in chosen})), ""):
            sys.exit(f"{broken} fails without any fault.")
        for number, mutant in enumerate(chosen, 1):
            (root / mutant["file"]).write_text(with_fault(mutant), "utf-8")
            found = failing(mutant["tests"], root)
            shutil.copy(ROOT / mutant["file"], root / mutant["file"])
            missed += not found
            print(f"{number}/{len(chosen)} {mutant['what']}: {found or 'NOT NOTICED'}", flush=True)
    print(f"{len(chosen) - missed} of {len(chosen)} noticed")
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
