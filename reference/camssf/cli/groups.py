"""Groups of commands that take each option once, unless it is declared as a list."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

import typer.core
from typer.models import CommandFunctionType

from camssf.errors import InvalidArgument


class Command(typer.core.TyperCommand):
    """A command that takes no option twice; click would use the last value and drop the others."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Check and parse the arguments.

        Raises:
            InvalidArgument: an option with one value was given several times.
        """
        _, _, order = self.make_parser(ctx).parse_args(list(args))
        for option, times in Counter(order).items():
            if times > 1 and isinstance(option, typer.core.TyperOption) and not (option.multiple or option.is_flag):
                raise InvalidArgument(
                    f"{max(option.opts, key=len)} was given {times} times; it takes one value.", "Give it once."
                )
        return super().parse_args(ctx, args)


class Group(typer.Typer):
    """A group of such commands."""

    def command(self, *args: Any, **settings: Any) -> Callable[[CommandFunctionType], CommandFunctionType]:
        """As `typer.Typer.command`."""
        return super().command(*args, **{"cls": Command} | settings)
