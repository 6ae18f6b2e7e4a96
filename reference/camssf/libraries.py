"""Loads what an installation may lack: optional libraries, and what packages on top of camssf contribute."""

from __future__ import annotations

import os
import sys
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from threading import Lock
from typing import Any

from camssf.errors import InvalidArgument
from camssf.files import temporary_folder

COMMANDS = "camssf.commands"
"""Group of command lists: tuples of (function or group, example)."""
REPORT = "camssf.report"
"""Group of modules that add to a report."""
RESULTS = "camssf.results"
"""Group of modules that read other forms of a result."""


@cache
def extensions(group: str) -> dict[str, Any]:
    """What is contributed to a group, by name, in alphabetical order."""
    return {point.name: point.load() for point in sorted(entry_points(group=group))}


def extension(group: str, name: str) -> Any:
    """What is contributed to a group under a name.

    Raises:
        InvalidArgument: no installed package contributes it.
    """
    try:
        return extensions(group)[name]
    except KeyError:
        raise InvalidArgument(
            f"This installation of camssf lacks its part {name!r} ({group}).", "Install camssf again, whole."
        ) from None


def install_extra(extra: str) -> str:
    """The advice to install an extra of camssf: from a clone, as long as nothing is released."""
    what = f'-e ".[{extra}]"'
    return f"In your clone of camssf, run {pip_install(what)}."


def pip_install(what: str) -> str:
    """The command that installs into the Python that runs; its quotes are any shell's, also Windows's."""
    python = f'"{sys.executable}"' if " " in sys.executable else sys.executable
    return f"{python} -m pip install {what}"


def library(name: str, who: str, extra: str) -> Any:
    """Import a module of an optional library.

    Args:
        name: of the module; the part before the first dot is the library's name.
        who: start of the error message: what needs the library, with its verb.
        extra: the extra of camssf that installs it.

    Raises:
        InvalidArgument: it is not installed.
    """
    try:
        return import_module(name)
    except ImportError as error:
        raise InvalidArgument(
            f"{who} the library {name.partition('.')[0]}, which is not installed.",
            install_extra(extra),
        ) from error


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
