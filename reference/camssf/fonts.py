"""matplotlib is loaded so that it leaves nothing in the home of someone who does not use it."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Lock

_LOADING = Lock()


def prepare_matplotlib() -> None:
    """Before the first import of matplotlib: keep it from leaving folders and a list of fonts with who has none.

    The list is needed while the module loads and never again, so it goes into a folder that is gone at once. Where
    matplotlib's folders are already there, or MPLCONFIGDIR names one, it keeps its list there as ever.
    """
    with _LOADING:
        if "matplotlib.font_manager" in sys.modules or os.environ.get("MPLCONFIGDIR") or _at_home():
            return
        with TemporaryDirectory(prefix="camssf-", ignore_cleanup_errors=True) as folder:
            os.environ["MPLCONFIGDIR"] = folder
            try:
                import matplotlib.font_manager  # noqa: F401
            finally:
                del os.environ["MPLCONFIGDIR"]


def _at_home() -> bool:
    """Whether matplotlib already has its folders, for settings and for caches, where it looks for them."""
    try:
        home = Path.home()
    except RuntimeError:  # no home, nothing to leave there
        return False
    if sys.platform.startswith(("linux", "freebsd")):
        settings, caches = (os.environ.get(f"XDG_{name}_HOME") for name in ("CONFIG", "CACHE"))
        places = [Path(settings or home / ".config", "matplotlib"), Path(caches or home / ".cache", "matplotlib")]
    else:
        places = [home / ".matplotlib"]
        if sys.platform == "win32" and not places[0].is_dir() and os.environ.get("LOCALAPPDATA"):
            places = [Path(os.environ["LOCALAPPDATA"], "matplotlib")]
    return all(place.is_dir() for place in places)
