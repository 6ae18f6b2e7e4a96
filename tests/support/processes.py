"""What a process that a test starts needs, so that it finds the package and the tests."""

import os
import sys
from pathlib import Path

SEARCH = os.pathsep.join(str(Path(path).absolute()) for path in sys.path if path)
"""PYTHONPATH."""
