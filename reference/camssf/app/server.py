"""The local server of the page: Starlette's routes, run by uvicorn on the loopback.

Three locks keep others out: the Host header must be the loopback's (against DNS rebinding), no other origin may send
a request, and every address begins with a random key.
"""

from __future__ import annotations

import json
import secrets
import shutil
import signal
import socket
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
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import ClientDisconnect, Request
from starlette.responses import FileResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from camssf.app.session import Session
from camssf.app.tasks import UPLOADS, stored_name
from camssf.errors import InvalidArgument
from camssf.files import error_in_words, temporary_folder

HOST = "127.0.0.1"
LARGEST_PHOTO = 512 * 2**20
MOST_UPLOADS, MOST_SESSIONS = 32, 16
LARGEST_ORDER = 2**20
"""Bytes of a task's order; a key takes the most."""
DATA = Path(str(files("camssf"))) / "data"
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
    "frame-src 'self'; form-action 'none'; base-uri 'none'; frame-ancestors 'none'"
)
REPORT_POLICY = (
    "sandbox; default-src 'none'; style-src 'unsafe-inline'; img-src data:; font-src data:; frame-ancestors 'self'"
)


class SameOrigin:
    """Middleware: answers 403 to what another origin's page asks, and forbids the browser to fetch elsewhere."""

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
        if headers.get("origin", own) != own or headers.get("sec-fetch-site", "none") not in ("none", "same-origin"):
            app = Response("Only the page of camssf app may ask this.", 403, media_type="text/plain")

        async def guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                found = MutableHeaders(scope=message)
                found.setdefault("content-security-policy", POLICY)
                found["cache-control"] = "no-store"
                found["x-content-type-options"] = "nosniff"
                found["referrer-policy"] = "same-origin"
                found["cross-origin-resource-policy"] = "same-origin"
                found["cross-origin-opener-policy"] = "same-origin"
            await send(message)

        await app(scope, receive, guarded)


class Sessions:
    """The endpoints, and the sessions of the tabs by name."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.open: dict[str, Session] = {}

    def close(self) -> None:
        """Close all sessions."""
        for session in self.open.values():
            session.close()

    async def begin(self, request: Request) -> Response:
        """Open a tab's session: its name and the names of lamps, charts and exports."""
        from camssf.exports import FORMATS
        from camssf.spectra import chart_names, lamp_names
        from camssf.spectra.families import FAMILIES

        if len(self.open) >= MOST_SESSIONS:
            raise HTTPException(429, f"{MOST_SESSIONS} tabs are open. Close one, or start camssf app again.")
        session = Session(self.root)
        self.open[session.name] = session
        exports = {name: each.what for name, each in FORMATS.items()}
        lamps = sorted(lamp_names(), key=lambda name: name not in FAMILIES)  # the kinds of light first
        lists = {"lamps": lamps, "charts": chart_names(), "exports": exports, "largest": LARGEST_PHOTO}
        return JSONResponse({"session": session.name} | lists)

    async def end(self, request: Request) -> Response:
        """Close a tab's session and remove its files."""
        self._session(request).close()
        del self.open[request.path_params["session"]]
        return Response(status_code=204)

    async def upload(self, request: Request) -> Response:
        """Store a file in a folder of its number, which is the answer. It is never whole in memory."""
        session, size, kind = self._session(request), 0, request.path_params["kind"]
        too_large = HTTPException(
            413, f"The file is larger than {LARGEST_PHOTO >> 20} MB, more than any photo. Choose a RAW photo (DNG)."
        )
        if int(request.headers.get("content-length", "0")) > LARGEST_PHOTO:
            raise too_large
        if kind not in UPLOADS:
            raise HTTPException(404, f"There is no kind of file {kind!r}.")
        if session.uploads >= MOST_UPLOADS:
            raise HTTPException(413, f"A tab takes {MOST_UPLOADS} files. Reload the page to begin again.")
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
        except BaseException as error:
            shutil.rmtree(folder, ignore_errors=True)
            if isinstance(error, OSError):
                words = f"The file cannot be stored ({error.strerror or error}). Free some space, and drop it again."
                raise HTTPException(507, words) from error
            raise
        return JSONResponse({"number": number})

    async def task(self, request: Request) -> Response:
        """Perform a task; the answer is a line of JSON for each step. Closing the request stops the task."""
        session, data = self._session(request), b""
        async for chunk in request.stream():
            data += chunk
            if len(data) > LARGEST_ORDER:
                raise HTTPException(413, "The order is too large.")
        try:
            order = json.loads(data)
        except (ValueError, RecursionError):
            order = None
        if not isinstance(order, dict):
            raise HTTPException(400, "The order is no JSON object.")

        async def lines() -> AsyncIterator[str]:
            async for line in session.run(request.path_params["task"], order):
                yield json.dumps(line) + "\n"

        return StreamingResponse(lines(), media_type="application/x-ndjson")

    async def file(self, request: Request) -> Response:
        """A file that a task wrote. The report opens in the page; `?save` lets the browser save a file."""
        name = request.path_params["name"]
        path = self._session(request).file(name)
        if path is None:
            raise HTTPException(404, "There is no such file.")
        policy = {"content-security-policy": REPORT_POLICY} if path.suffix in (".html", ".svg") else {}
        return FileResponse(path, headers=policy, filename=name if "save" in request.query_params else None)

    def _session(self, request: Request) -> Session:
        found = self.open.get(request.path_params["session"])
        if found is None:
            raise HTTPException(404, "This tab's session has ended. Reload the page.")
        return found


async def _wrong(request: Request, error: Exception) -> Response:
    """An HTTP error in the form of a task's error; nothing reads it if the browser has left."""
    status = getattr(error, "status_code", 500)
    return JSONResponse({"error": {"code": str(status), "words": getattr(error, "detail", str(error))}}, status)


async def _page(request: Request) -> Response:
    return FileResponse(DATA / "app" / "index.html")


async def _style(request: Request) -> Response:
    return FileResponse(DATA / "report" / "report.css")


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
        Route("/sessions/{session}/files/{kind}", sessions.upload, methods=["POST"]),
        Route("/sessions/{session}/tasks/{task}", sessions.task, methods=["POST"]),
        Route("/sessions/{session}/files/{name}", sessions.file),
        Mount("/static", StaticFiles(directory=DATA / "app")),
    ]
    guards = [Middleware(TrustedHostMiddleware, allowed_hosts=[HOST, "localhost"], www_redirect=False)]
    return Starlette(
        routes=[Mount(f"/{key}", routes=routes)],
        middleware=[*guards, Middleware(SameOrigin)],
        exception_handlers={HTTPException: _wrong, ClientDisconnect: _wrong},
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
