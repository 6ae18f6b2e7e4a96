"""What a process that a test starts needs, so that it finds the package and the tests."""

from __future__ import annotations

import os
import sys
from pathlib import Path

SEARCH = os.pathsep.join(str(Path(path).absolute()) for path in sys.path if path)
"""PYTHONPATH."""
