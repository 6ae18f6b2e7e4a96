"""Reports of progress to a caller: a stage in words, and the part that is done, which rises from 0 to 1."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

Progress: TypeAlias = Callable[[str, float], None]
"""Called with the name of a stage and the part done."""


def part_of(progress: Progress | None, begin: float, end: float) -> Progress:
    """The reports of a step that takes the part from `begin` to `end` of the whole; None reports nothing."""
    if progress is None:
        return lambda stage, part: None
    return lambda stage, part: progress(stage, begin + part * (end - begin))
