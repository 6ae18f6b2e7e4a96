"""How colours are stated."""

from __future__ import annotations

from dataclasses import dataclass

from camssf.errors import InvalidArgument
from camssf.spectra.bundled import observer

ADAPTED = ("lamp", "D50", "D65")


@dataclass(frozen=True)
class View:
    """How colours are stated.

    Attributes:
        observer: "1931" (2°) or "1964" (10°).
        white: "lamp", the light itself; or "D50", "D65", to which colours are adapted by CAT16.
    """

    observer: str = "1931"
    white: str = "lamp"

    def __post_init__(self) -> None:
        observer(self.observer)
        if self.white not in ADAPTED:
            raise InvalidArgument(
                f"Colour cannot be computed for the white {self.white!r}.", f"Take one of {', '.join(ADAPTED)}."
            )
