"""Libraries that not everybody needs: asked for where they are used, and named where they are missing."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from camssf.errors import InvalidArgument


def library(name: str, who: str, extra: str) -> Any:
    """The module of that name.

    Args:
        name: of the module; the library's is what stands before its first dot.
        who: needs it, as a sentence begins.
        extra: of camssf, which installs it.

    Raises:
        InvalidArgument: it is not there.
    """
    try:
        return import_module(name)
    except ImportError as error:
        raise InvalidArgument(
            f"{who} the library {name.partition('.')[0]}, which is not there.", f"Run pip install 'camssf[{extra}]'."
        ) from error
