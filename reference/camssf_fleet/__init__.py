"""Batches of many cameras, the registry of their results, and passports.

Each public name is imported on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from camssf.lazy_names import lazy_names

if TYPE_CHECKING:
    from camssf_fleet.batch import run_batch as run_batch
    from camssf_fleet.manifest import Manifest as Manifest
    from camssf_fleet.passport.document import Passport as Passport
    from camssf_fleet.passport.document import verify as verify
    from camssf_fleet.passport.keys import read_public as read_public

_HOME = {
    "Manifest": "camssf_fleet.manifest",
    "Passport": "camssf_fleet.passport.document",
    "read_public": "camssf_fleet.passport.keys",
    "run_batch": "camssf_fleet.batch",
    "verify": "camssf_fleet.passport.document",
}

__all__ = ["Manifest", "Passport", "read_public", "run_batch", "verify"]

__getattr__, __dir__ = lazy_names(__name__, _HOME)
