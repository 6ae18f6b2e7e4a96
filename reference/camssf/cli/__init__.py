"""The command line. Its names are imported on first use: packages that add commands import parts of it themselves."""

from __future__ import annotations

from typing import TYPE_CHECKING

from camssf.lazy_names import lazy_names

if TYPE_CHECKING:
    from camssf.cli.commands import app as app
    from camssf.cli.commands import main as main
    from camssf.cli.terminal import BATCH_FAILED as BATCH_FAILED
    from camssf.cli.terminal import BUG as BUG
    from camssf.cli.terminal import INTERRUPTED as INTERRUPTED
    from camssf.cli.terminal import PARTED as PARTED
    from camssf.cli.terminal import UNDECIDED as UNDECIDED

STATUSES = ("BATCH_FAILED", "BUG", "INTERRUPTED", "PARTED", "UNDECIDED")
__getattr__, __dir__ = lazy_names(
    __name__, dict.fromkeys(("app", "main"), "camssf.cli.commands") | dict.fromkeys(STATUSES, "camssf.cli.terminal")
)
