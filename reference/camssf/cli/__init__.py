"""The command line."""

from __future__ import annotations

from camssf.cli.commands import BATCH_FAILED, BUG, INTERRUPTED, PARTED, app, main

__all__ = ["BATCH_FAILED", "BUG", "INTERRUPTED", "PARTED", "app", "main"]
