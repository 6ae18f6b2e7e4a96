"""The command line."""

from __future__ import annotations

from camssf.cli.commands import app, main
from camssf.cli.terminal import BATCH_FAILED, BUG, INTERRUPTED, PARTED, UNDECIDED

__all__ = ["BATCH_FAILED", "BUG", "INTERRUPTED", "PARTED", "UNDECIDED", "app", "main"]
