"""What a process that a test starts needs, so that it finds the package and the tests; and waiting for it."""

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

SEARCH = os.pathsep.join(str(Path(path).absolute()) for path in sys.path if path)
"""PYTHONPATH."""


def until(holds: Callable[[], object], seconds: float = 120.0) -> None:
    """Wait until it holds."""
    deadline = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.05)
