"""For test_fuzz: the fuzzing process's other half, which dies on every third file. Importable by a new process."""

from __future__ import annotations

import os
from multiprocessing.connection import Connection


def serve(pipe: Connection, reader: str) -> None:
    """As `tools.fuzz._serve`."""
    assert reader == "manifest"
    while seeds := pipe.recv():
        for seed in seeds:
            if seed % 3 == 2:
                os._exit(7)
            pipe.send(("read", ""))
