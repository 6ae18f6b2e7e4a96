"""Breaks the code on purpose, one line at a time, and says which test notices: `python -m tools.mutants [WORD ...]`.

tests/mutants.json lists what is changed, and the tests that are run; words choose the rows whose description has one
of them. The work is done on a copy. Exits with 1 if a change is not noticed.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
TABLE = ROOT / "tests" / "mutants.json"
COPIED = ("reference", "export", "tests", "golden", "data", "tools", "benchmarks", "pyproject.toml")


@dataclass(frozen=True)
class Mutant:
    """A fault that is put into the code.

    Attributes:
        what: the fault in words.
        file: where, from the root.
        was, becomes: a piece of text that is there once, and what replaces it.
        tests: files of tests, one of which must fail.
    """

    what: str
    file: str
    was: str
    becomes: str
    tests: str

    def text(self, root: Path = ROOT) -> str:
        """The file's text with the fault.

        Raises:
            ValueError: the replaced text is not there, or more than once.
        """
        text = (root / self.file).read_text("utf-8")
        if text.count(self.was) != 1:
            raise ValueError(f"{self.file} has {self.was!r} {text.count(self.was)} times: {self.what}")
        return text.replace(self.was, self.becomes)


def mutants() -> list[Mutant]:
    """All rows of the table."""
    return [Mutant(**row) for row in json.loads(TABLE.read_text("utf-8"))]


def noticed_by(mutant: Mutant, root: Path) -> str:
    """The first test in the copy `root` that fails with the fault; "" if none does."""
    file = root / mutant.file
    sound = file.read_text("utf-8")
    path = os.pathsep.join(str(root / folder) for folder in ("reference", "export", "."))
    file.write_text(mutant.text(root), "utf-8")
    try:
        run = subprocess.run(
            [sys.executable, "-m", "pytest", "-x", "-q", "-n", "0", "-p", "no:cacheprovider", *mutant.tests.split()],
            cwd=root, env=os.environ | {"PYTHONPATH": path, "COLUMNS": "300"}, capture_output=True, text=True,
        )  # fmt: skip
    finally:
        file.write_text(sound, "utf-8")
    if run.returncode not in (0, 1, 2):  # neither passed nor failed, nor an error at import
        raise RuntimeError(f"pytest ended with {run.returncode}: {run.stdout}{run.stderr}")
    failed = re.search(r"^(?:FAILED|ERROR) (\S+)", run.stdout, re.MULTILINE)
    return failed[1] if failed else ""


def main(arguments: list[str] | None = None) -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("words", nargs="*", metavar="WORD")
    words = parser.parse_args(arguments).words
    chosen = [each for each in mutants() if not words or any(word in each.what for word in words)]
    missed = 0
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        for name in COPIED:
            copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
            copy(ROOT / name, root / name)
        for number, mutant in enumerate(chosen, 1):
            found = noticed_by(mutant, root)
            missed += not found
            print(f"{number}/{len(chosen)} {mutant.what}: {found or 'NOT NOTICED'}", flush=True)
    print(f"{len(chosen) - missed} of {len(chosen)} noticed")
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
