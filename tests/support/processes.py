"""What a process that a test starts needs, so that it finds the package and the tests; waiting for it; memory."""

import os
import sys
import time
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

SEARCH = os.pathsep.join(str(Path(path).absolute()) for path in sys.path if path)
"""PYTHONPATH."""


def until(holds: Callable[[], object], seconds: float = 120.0) -> None:
    """Wait until it holds."""
    deadline = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.05)


@contextmanager
def memory_below(most: int) -> Iterator[None]:
    """The code in it takes less memory than that many bytes, Python's and NumPy's."""
    tracemalloc.start()
    try:
        yield
        assert tracemalloc.get_traced_memory()[1] < most
    finally:
        tracemalloc.stop()
