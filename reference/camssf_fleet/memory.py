"""Keeps the freed memory of a job for the next one."""

from __future__ import annotations

import ctypes
from contextlib import suppress
from functools import cache

_TRIM, _MMAP = -1, -3
"""Parameters of glibc's `mallopt`."""
KEPT, LARGEST = 1 << 26, 1 << 25
"""Bytes of freed memory that a process keeps; size of an array from which on it is returned at once."""


@cache
def keep_memory() -> None:
    """Let glibc keep up to KEPT bytes that were freed; other C libraries have no such setting.

    Otherwise each array of a job takes new pages of the system, and even more where a Dask nanny has set
    MALLOC_TRIM_THRESHOLD_ for its worker.
    """
    with suppress(OSError, AttributeError, TypeError):
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(_MMAP, LARGEST)
        mallopt(_TRIM, KEPT)
