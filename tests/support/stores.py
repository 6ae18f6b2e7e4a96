"""An S3 server on the loopback (moto), and the faults of a busy one."""

import random
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

SECRET = "not-to-be-seen-1234"
BUSY = b"<Error><Code>SlowDown</Code><Message>Please reduce your request rate.</Message></Error>"
BROKEN = b"<Error><Code>InternalError</Code><Message>We encountered an internal error.</Message></Error>"


class Faulty:
    """An application of which a fraction `rate` of the answers is a fault: throttled, an error, or cut in the middle.

    An answer that is cut or an error may stand for a request that was done: then the client does not know.
    """

    def __init__(self, application: Any) -> None:
        self.application, self.rate, self.dice, self.faults = application, 0.0, random.Random(1), 0

    def __call__(self, environ: dict[str, Any], start: Callable[..., Any]) -> Any:
        dice = self.dice.random()
        if dice >= self.rate:
            return self.application(environ, start)
        self.faults += 1
        kind = int(4 * dice / self.rate)
        if kind == 0:
            start("503 Slow Down", [("Content-Type", "application/xml"), ("Content-Length", str(len(BUSY)))])
            return [BUSY]
        if kind == 1:
            list(self.application(environ, lambda *_: None))
        if kind < 3:
            start("500 Internal Server Error", [("Content-Type", "application/xml")])
            return [BROKEN]
        return _cut(self.application(environ, start))


def _cut(answer: Any) -> Iterator[bytes]:
    whole = b"".join(answer)
    yield whole[: len(whole) // 2]
    raise ConnectionResetError


@contextmanager
def served() -> Iterator[Faulty]:
    """A server, which the libraries of S3 find by what they read in the environment."""
    from moto.moto_server.werkzeug_app import DomainDispatcherApplication, create_backend_app
    from werkzeug.serving import WSGIRequestHandler, make_server

    application = Faulty(DomainDispatcherApplication(create_backend_app))
    server = make_server("127.0.0.1", 0, application, threaded=True)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    environment = {
        "AWS_ENDPOINT_URL": f"http://127.0.0.1:{server.server_port}", "AWS_ALLOW_HTTP": "true",
        "AWS_ACCESS_KEY_ID": "key-of-the-tests", "AWS_SECRET_ACCESS_KEY": SECRET,
        "AWS_DEFAULT_REGION": "us-east-1", "AWS_REGION": "us-east-1", "AWS_EC2_METADATA_DISABLED": "true",
    }  # fmt: skip
    try:
        with pytest.MonkeyPatch.context() as patched:
            patched.setattr(WSGIRequestHandler, "log", lambda *_: None)
            for name, value in environment.items():
                patched.setenv(name, value)
            yield application
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
