"""The commands that need the packages beside camssf: the page in the browser, and the demo."""

from __future__ import annotations

from typing import Annotated

import typer

from camssf.cli.terminal import say
from camssf_app.demo import demo


def app(
    port: Annotated[
        int, typer.Option(min=0, max=65535, show_default="any free one", help="Port on the loopback.")
    ] = 0,
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Print the address only; do not open it in a browser.")
    ] = False,
) -> None:
    """Serve a page in the browser: drop photos, get the report.

    On this computer only; nothing is sent anywhere. Needs the extra `app` (docs/install.md). Ctrl-C ends it and
    removes what the tabs hold.
    """
    from camssf.libraries import library

    for name in ("starlette", "uvicorn"):
        library(name, "The page in the browser needs", "app")
    from camssf_app.server import serve

    def ready(address: str) -> None:
        say("", f"The page: {address}")
        say("", "Ctrl-C ends it.")
        if not no_browser:
            import threading
            import webbrowser

            # in a thread: a browser in the terminal would not return
            threading.Thread(target=webbrowser.open, args=(address,), daemon=True).start()

    serve(port, ready)


COMMANDS = ((demo, "camssf demo -o out/"), (app, "camssf app"))
"""Each command with an example for its help."""
