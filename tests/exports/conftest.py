"""Other people's programs, which read the exports."""

import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest


def run(*words: str | Path, home: Path | None = None) -> str:
    """What a program prints; skips where it is not there."""
    if shutil.which(words[0]) is None:
        pytest.skip(f"{words[0]} is not on this machine")
    env = os.environ | ({"HOME": str(home)} if home else {})
    return subprocess.run(words, capture_output=True, text=True, timeout=300, check=True, env=env).stdout


SPECTACLE = """
import sys, json, pathlib
import scipy.integrate
from spectacle import spectral
table, name = spectral.load_spectral_response(pathlib.Path(sys.argv[1]), return_filename=True)
print(json.dumps([table.tolist(), str(name)]))
"""


def pyspectacle(folder: Path, curves: bytes) -> Any:
    """Table and name as SPECTACLE reads them; it is GPL and needs an old SciPy: an environment of its own judges."""
    python = os.environ.get("CAMSSF_SPECTACLE")
    if not python:
        pytest.skip("CAMSSF_SPECTACLE names no Python that has pyspectacle")
    (folder / "calibration").mkdir()
    (folder / "calibration" / "spectral_response.csv").write_bytes(curves)
    printed = run(python, "-W", "ignore", "-c", SPECTACLE, folder, home=folder)
    return json.loads(printed.splitlines()[-1])
