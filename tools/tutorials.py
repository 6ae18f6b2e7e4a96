"""Runs the tutorials and writes what they print below their blocks: `python -m tools.tutorials [NAME ...]`.

A page runs in an empty folder. Shown are the output of each Python block, and the messages of a shell block above a
block `text` (an empty one is filled). A shell command's data, on standard output, are not shown.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Sequence
from pathlib import Path

from benchmarks.shared import command_parser
from camssf.files import write_file

TUTORIALS = sorted((Path(__file__).parents[1] / "docs" / "tutorials").glob("*.md"))
WITH_OUTPUT = [*TUTORIALS, Path(__file__).parents[1] / "docs" / "registry.md"]
"""All pages that show what they print; those that are no tutorials need more than these install."""
BLOCK = re.compile(r"^```(python|sh)\n(.*?)^```\n(\n```text\n(.*?)^```\n)?", re.MULTILINE | re.DOTALL)
BREAK = "-- end of a block --"


def blocks(text: str) -> list[tuple[str, str, str | None]]:
    """Kind, code and shown output (None: no block `text` follows) of a page's blocks, but the installation."""
    return [(match[1], match[2], match[4]) for match in BLOCK.finditer(text) if "venv" not in match[2]]


def outputs(text: str, folder: Path, python: str = sys.executable, scripts: str | None = None) -> list[str]:
    """What each block prints, run in the page's order in that folder, by that Python and the `camssf` beside it.

    Raises:
        subprocess.CalledProcessError: a block failed; its `output` ends with what it printed.
    """
    lines = ["import subprocess"]
    for kind, code, _ in blocks(text):
        shell = f"subprocess.run(['sh', '-e', '-c', {code!r}], check=True, stdout=subprocess.DEVNULL)"
        lines += [code if kind == "python" else shell, f"print({BREAK!r})"]
    path = os.pathsep.join((scripts or sysconfig.get_path("scripts"), os.environ["PATH"]))
    environment = os.environ | {"PATH": path, "MPLBACKEND": "agg", "COLUMNS": "80", "PYTHONUTF8": "1"}
    # By -c, as pasted into an interpreter: a batch starts processes, which would run a script's file anew.
    done = subprocess.run(
        [python, "-u", "-c", "\n".join(lines)], cwd=folder, env=environment, check=True, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, encoding="utf-8",
    )  # fmt: skip
    printed = [[line.rstrip() for line in each.splitlines()] for each in done.stdout.split(f"{BREAK}\n")[:-1]]
    return ["".join(f"{line}\n" for line in lines if line) for lines in printed]


def page(text: str, found: Sequence[str]) -> str:
    """The page with these outputs."""
    rest = iter(found)

    def shown(match: re.Match[str]) -> str:
        if "venv" in match[2]:
            return match[0]
        kind, code, printed = match[1], match[2], next(rest)
        below = f"\n```text\n{printed}```\n" if printed and (kind == "python" or match[3]) else ""
        return f"```{kind}\n{code}```\n{below}"

    return BLOCK.sub(shown, text)


def main() -> None:
    """Write the outputs into the pages."""
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="pages, as `skin`; all if none is named")
    names = parser.parse_args().names
    for place in WITH_OUTPUT:
        if not names or place.stem in names:
            text = place.read_text("utf-8")
            with tempfile.TemporaryDirectory() as folder:
                write_file(place, page(text, outputs(text, Path(folder))))


if __name__ == "__main__":
    main()
