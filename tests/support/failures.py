"""What tests put in a function's place so that it fails."""

from collections.abc import Callable
from typing import Any


def raising(value: Any) -> Callable[..., Any]:
    """A function that raises the exception, or the function given."""

    def fail(*_: Any, **__: Any) -> Any:
        raise value

    return fail if isinstance(value, BaseException) else value
