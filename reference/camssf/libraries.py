"""Imports optional libraries when they are used, with advice if one is missing."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from camssf.errors import InvalidArgument


def library(name: str, who: str, extra: str) -> Any:
    """Import a module of an optional library.

    Args:
        name: of the module; the part before the first dot is the library's name.
        who: start of the error message: what needs the library, with its verb.
        extra: the extra of camssf that installs it.

    Raises:
        InvalidArgument: it is not installed.
    """
    try:
        return import_module(name)
    except ImportError as error:
        raise InvalidArgument(
            f"{who} the library {name.partition('.')[0]}, which is not installed.",
            f"Run pip install 'camssf[{extra}]'.",
        ) from error
