"""The local server of the page: Starlette's routes, run by uvicorn on the loopback.

Three locks keep others out: the Host header must be the loopback's (against DNS rebinding), no other origin may send
a request, and every address begins with a random key.
"""

from __future__ import annotations

import asyncio
import json
import secrets
import shutil
import signal
import socket
import time
from collections.abc import AsyncIterator
from contextlib import ExitStack
from importlib.resources import files
from pathlib import Path
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import ClientDisconnect, Request
from starlette.responses import FileResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from camssf.errors import InvalidArgument
from camssf.files import error_in_words, readable, temporary_folder
from camssf.strict_json import parse_strict
from camssf_app.orders import MOST_FILES, ORDERS, UPLOADS, read_order, stored_name
from camssf_app.session import BUSY, PULSE, Session

HOST = "127.0.0.1"
LARGEST_PHOTO = 512 * 2**20
MOST_SESSIONS = 16
BEAT = 20.0
"""Seconds between two signs of life of a page; a browser lets a hidden page give one a minute at least."""
CRASHED = 4
"""Missed beats after which a session gives way to a new tab if MOST_SESSIONS are open."""
EXPIRED = 90
"""Missed beats after which a session ends and its files are removed."""
LAST_TASK = 2.0
"""Seconds that a task waits for the end of one that was cancelled."""
OPEN = "Open the address that camssf app printed."
LARGEST_ORDER = 2**20
"""Bytes of a task's order; a key takes the most."""
DATA = Path(str(files("camssf_app"))) / "data"
REPORT = Path(str(files("camssf"))) / "data" / "report"
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
    "frame-src 'self'; form-action 'none'; base-uri 'none'; frame-ancestors 'none'"
)
REPORT_POLICY = (
    "sandbox; default-src 'none'; style-src 'unsafe-inline'; img-src data:; font-src data:; frame-ancestors 'self'"
)


class SameOrigin:
    """Middleware: refuses other hosts' names and other origins' pages, and forbids the browser to fetch elsewhere."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Check one request, and add the headers to its answer."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        own = f"http://{headers.get('host', '')}"
        app = self.app
        if headers.get("host", "").split(":")[0] not in (HOST, "localhost"):
            app = _refusal(400, f"The server's name is {HOST}. {OPEN}")
        elif headers.get("origin", own) != own or headers.get("sec-fetch-site", "none") not in (
            "none",
            "same-origin",
        ):
            app = _refusal(403, f"Only the page of camssf app may ask this. {OPEN}")

        async def guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                response_headers = MutableHeaders(scope=message)
                response_headers.setdefault("content-security-policy", POLICY)
                response_headers["cache-control"] = "no-store"
                response_headers["x-content-type-options"] = "nosniff"
                response_headers["referrer-policy"] = "same-origin"
                response_headers["cross-origin-resource-policy"] = "same-origin"
                response_headers["cross-origin-opener-policy"] = "same-origin"
            await send(message)

        await app(scope, receive, guarded)


class Sessions:
    """The endpoints, and the sessions of the tabs by name."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.open: dict[str, Session] = {}
        self._sweeping = False

    def close(self) -> None:
        """Close all sessions."""
        for session in self.open.values():
            session.close()

    def sweep(self) -> None:
        """Count a beat, and close the sessions that missed EXPIRED; again after a BEAT while any is open."""
        for session in tuple(self.open.values()):
            session.missed += 1
            if session.silent(EXPIRED):
                self._close(session)
        self._sweeping = bool(self.open)
        if self._sweeping:
            asyncio.get_running_loop().call_later(BEAT, self.sweep)

    def _close(self, session: Session) -> None:
        del self.open[session.name]
        session.close()

    def _make_room(self) -> None:
        """Close the idle session that was silent for longest if no other may open; one with files only if it crashed.

        Raises:
            HTTPException: all are in use.
        """
        if len(self.open) < MOST_SESSIONS:
            return
        idle = [session for session in self.open.values() if session.silent(CRASHED if session.uploads else 0)]
        if not idle:
            words = (
                f"Close one and reload this page. A tab that crashed is closed after {CRASHED * BEAT:.0f} seconds."
            )
            raise HTTPException(429, f"{MOST_SESSIONS} tabs are open. {words}")
        self._close(max(idle, key=lambda each: each.missed))

    async def begin(self, request: Request) -> Response:
        """Open a tab's session: its name and the names of lamps, charts and exports."""
        from camssf.exports import FORMATS
        from camssf.spectra import chart_names
        from camssf_app.menus import CHART_MENU, CODES, lamp_menu

        self._make_room()
        session = Session(self.root)
        self.open[session.name] = session
        if not self._sweeping:
            self.sweep()
        exports = {name: form.what for name, form in FORMATS.items()}
        codes = chart_names()
        charts = [(name, words, name in codes) for name, words in CHART_MENU.items()]
        limits = {"largest": LARGEST_PHOTO, "beat": BEAT}
        menus = {"lamps": lamp_menu(), "codes": CODES, "charts": charts, "chart_codes": codes, "exports": exports}
        return JSONResponse({"session": session.name} | menus | limits)

    async def beat(self, request: Request) -> Response:
        """A sign of life of a tab."""
        self._session(request)
        return Response(status_code=204)

    async def end(self, request: Request) -> Response:
        """Close a tab's session and remove its files."""
        self._close(self._session(request))
        return Response(status_code=204)

    async def upload(self, request: Request) -> Response:
        """Store a file in a folder of its number, which is the answer. It is never whole in memory."""
        session, size, kind = self._session(request), 0, request.path_params["kind"]
        if _content_type(request) in ("multipart/form-data", "application/x-www-form-urlencoded"):
            raise HTTPException(415, "A form holds more than the file. Send the file's bytes alone.")
        too_large = HTTPException(
            413, f"The file is larger than {LARGEST_PHOTO >> 20} MB, more than any photo. Choose a RAW photo (DNG)."
        )
        if int(request.headers.get("content-length", "0")) > LARGEST_PHOTO:
            raise too_large
        if kind not in UPLOADS:
            raise HTTPException(404, f"There is no kind of file {kind!r}. Send one of {', '.join(UPLOADS)}.")
        if session.uploads >= MOST_FILES:
            raise HTTPException(413, f"A tab takes {MOST_FILES} files. Reload the page to begin again.")
        session.uploads += 1
        number, folder = session.uploads, session.folder / f"{kind}-{session.uploads}"
        path = folder / stored_name(kind, request.query_params.get("name", ""))
        try:
            folder.mkdir()
            with open(path, "xb") as stream:
                async for chunk in request.stream():
                    size += len(chunk)
                    if size > LARGEST_PHOTO:
                        raise too_large
                    stream.write(chunk)
                    session.missed = 0
        except BaseException as error:
            shutil.rmtree(folder, ignore_errors=True)
            if isinstance(error, OSError):
                words = f"The file cannot be stored ({error.strerror or error}). Free some space, and drop it again."
                raise HTTPException(507, words) from error
            raise
        if session.closed:
            raise _session_ended()
        return JSONResponse({"number": number})

    async def task(self, request: Request) -> Response:
        """Perform a task; the answer is a line of JSON for each step. Closing the request stops the task."""
        session, task = self._session(request), request.path_params["task"]
        if task not in ORDERS:
            raise HTTPException(404, f"There is no task {task!r}. The tasks are {', '.join(ORDERS)}.")
        order = read_order(task, await _order(request), session.folder)
        end = time.monotonic() + LAST_TASK
        while session.busy:
            if time.monotonic() > end:
                raise HTTPException(409, BUSY)
            await asyncio.sleep(PULSE)

        async def lines() -> AsyncIterator[str]:
            async for line in session.run(task, order):
                yield json.dumps(line) + "\n"

        return StreamingResponse(lines(), media_type="application/x-ndjson")

    async def file(self, request: Request) -> Response:
        """A file that a task wrote. The report opens in the page; `?save` lets the browser save a file."""
        name = request.path_params["name"]
        path = self._session(request).file(name)
        if path is None:
            raise HTTPException(404, "There is no such file. Take the names from the answer of a task.")
        policy = {"content-security-policy": REPORT_POLICY} if path.suffix in (".html", ".svg") else {}
        return FileResponse(path, headers=policy, filename=name if "save" in request.query_params else None)

    def _session(self, request: Request) -> Session:
        session = self.open.get(request.path_params["session"])
        if session is None:
            raise _session_ended()
        session.missed = 0
        return session


def _session_ended() -> HTTPException:
    words = "This tab's session has ended and its files are removed: it was closed, or silent for long."
    return HTTPException(404, f"{words} Reload the page and add the photos again.")


def _content_type(request: Request) -> str:
    return str(request.headers.get("content-type", "")).partition(";")[0].strip().casefold()


async def _order(request: Request) -> dict[str, Any]:
    """The JSON object of a request.

    Raises:
        HTTPException: another type of content, too large, or no such JSON.
    """
    if _content_type(request) != "application/json":
        raise HTTPException(415, "An order is JSON. Send it with the content type application/json.")
    data = b""
    async for chunk in request.stream():
        data += chunk
        if len(data) > LARGEST_ORDER:
            raise HTTPException(413, f"The order is larger than {LARGEST_ORDER >> 10} kB. Choose a key's file (PEM).")
    try:
        order = parse_strict(data.decode())
    except (ValueError, RecursionError):
        order = None
    if not isinstance(order, dict):
        raise HTTPException(
            400, "The order is no JSON object: damaged, nested too deep, a key twice, or NaN. Correct it."
        )
    return order


async def _wrong(request: Request, error: Exception) -> Response:
    """A client's error in the form of a task's error; nothing reads it if the browser has left."""
    status = getattr(error, "status_code", 400)
    words = readable(getattr(error, "detail", str(error)))
    if words in ("Not Found", "Method Not Allowed"):
        words = f"{words}. {OPEN}"
    return _refusal(status, words)


def _refusal(status: int, words: str) -> Response:
    code = InvalidArgument.code if status < 500 else str(status)
    return JSONResponse({"error": {"code": code, "words": words}}, status)


async def _page(request: Request) -> Response:
    return FileResponse(DATA / "index.html")


async def _style(request: Request) -> Response:
    return FileResponse(REPORT / "report.css")


class _Server(uvicorn.Server):
    """uvicorn's server; it ends the sessions' tasks first, so that no answer is cut off.

    It also removes the temporary folder, since after a signal uvicorn's `run` does not return.
    """

    def __init__(self, config: uvicorn.Config, sessions: Sessions, folder: ExitStack) -> None:
        super().__init__(config)
        self.sessions, self.folder = sessions, folder

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """End the tasks, then the connections; remove the temporary folder."""
        self.sessions.close()
        await super().shutdown(sockets)
        self.folder.close()


def application(key: str, sessions: Sessions) -> Starlette:
    """The server's routes, all below a secret key."""
    routes = [
        Route("/", _page),
        Route("/report.css", _style),
        Route("/sessions", sessions.begin, methods=["POST"]),
        Route("/sessions/{session}", sessions.end, methods=["DELETE"]),
        Route("/sessions/{session}", sessions.beat, methods=["POST"]),
        Route("/sessions/{session}/files/{kind}", sessions.upload, methods=["POST"]),
        Route("/sessions/{session}/tasks/{task}", sessions.task, methods=["POST"]),
        Route("/sessions/{session}/files/{name}", sessions.file),
        Mount("/static", StaticFiles(directory=DATA)),
    ]
    return Starlette(
        routes=[Mount(f"/{key}", routes=routes)],
        middleware=[Middleware(SameOrigin)],
        exception_handlers=dict.fromkeys((HTTPException, ClientDisconnect, InvalidArgument), _wrong),
    )


def serve(port: int, ready: Any) -> None:
    """Serve the page on the loopback until Ctrl-C.

    Args:
        port: 0 for any free one.
        ready: called with the page's address once the port is open.

    Raises:
        InvalidArgument: the port is taken, or there is no room for temporary files.
    """
    try:
        listener = socket.create_server((HOST, port))
    except (OSError, OverflowError) as error:
        raise InvalidArgument(
            f"Port {port} cannot be opened ({error_in_words(error)}).", "Leave --port out, or name another."
        ) from error
    key = secrets.token_urlsafe(16)
    with listener, ExitStack() as folder:
        sessions = Sessions(folder.enter_context(temporary_folder()))
        config = uvicorn.Config(
            application(key, sessions), http="h11", ws="none", loop="asyncio", lifespan="off", log_level="error",
            access_log=False, server_header=False, timeout_graceful_shutdown=2,
        )  # fmt: skip
        ready(f"http://{HOST}:{listener.getsockname()[1]}/{key}/")
        server = _Server(config, sessions, folder)
        if hasattr(signal, "SIGHUP"):  # the terminal was closed
            signal.signal(signal.SIGHUP, server.handle_exit)
        server.run(sockets=[listener])
