"""Other people's programs, which read the exports."""

import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest


def run(*words: str | Path, stdin: str | None = None, home: Path | None = None) -> str:
    """What a program prints; skips where it is not there."""
    if shutil.which(words[0]) is None:
        pytest.skip(f"{words[0]} is not on this machine")
    env = os.environ | ({"HOME": str(home)} if home else {})
    how: Any = {"capture_output": True, "text": True, "timeout": 300, "check": True, "env": env}
    return str(subprocess.run(words, input=stdin, **how).stdout)


def pyspectacle(script: str, folder: Path, curves: bytes, stdin: Any = None) -> Any:
    """What a script prints last; SPECTACLE is GPL and needs an old SciPy: an environment of its own judges."""
    python = os.environ.get("CAMSSF_SPECTACLE")
    if not python:
        pytest.skip("CAMSSF_SPECTACLE names no Python that has pyspectacle")
    (folder / "calibration").mkdir(exist_ok=True)
    (folder / "calibration" / "spectral_response.csv").write_bytes(curves)
    printed = run(python, "-W", "ignore", "-c", script, folder, stdin=json.dumps(stdin), home=folder)
    return json.loads(printed.splitlines()[-1])
