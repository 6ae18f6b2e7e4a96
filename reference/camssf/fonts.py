"""Loads matplotlib without creating its folders in the user's home directory."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from threading import Lock

from camssf.files import temporary_folder

_LOADING = Lock()


def prepare_matplotlib() -> None:
    """Keep matplotlib from creating folders and a font list in the home directory; call before its first import.

    The font list is only needed during the import, so it goes into a temporary folder. If matplotlib's folders
    already exist, or MPLCONFIGDIR is set, matplotlib uses these as usual.

    Raises:
        InvalidArgument: there is no room for temporary files.
    """
    with _LOADING:
        if "matplotlib.font_manager" in sys.modules or os.environ.get("MPLCONFIGDIR") or _at_home():
            return
        with temporary_folder() as folder:
            os.environ["MPLCONFIGDIR"] = str(folder)
            try:
                import matplotlib.font_manager  # noqa: F401
            finally:
                del os.environ["MPLCONFIGDIR"]


def _at_home() -> bool:
    """Whether matplotlib's folders for settings and for caches already exist."""
    try:
        home = Path.home()
    except RuntimeError:  # there is no home directory
        return False
    if sys.platform.startswith(("linux", "freebsd")):
        settings, caches = (os.environ.get(f"XDG_{name}_HOME") for name in ("CONFIG", "CACHE"))
        places = [Path(settings or home / ".config", "matplotlib"), Path(caches or home / ".cache", "matplotlib")]
    else:
        places = [home / ".matplotlib"]
        if sys.platform == "win32" and not places[0].is_dir() and os.environ.get("LOCALAPPDATA"):
            places = [Path(os.environ["LOCALAPPDATA"], "matplotlib")]
    return all(place.is_dir() for place in places)
