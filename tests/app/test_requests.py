"""Requests to the page's server: strangers' and malformed ones are refused, and crashed tabs give way."""

import asyncio
import json
import socket
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import pytest

from camssf.cli import main
from camssf_app.orders import ORDERS, CalibrateOrder
from camssf_app.tasks import TASKS, perform


class Client:
    """Sends requests to the application without a network, so that its sessions' clocks can be set."""

    def __init__(self, root: Path) -> None:
        server = pytest.importorskip("camssf_app.server", reason="starlette or uvicorn is not installed")
        self.sessions = server.Sessions(root)
        self.app = server.application("key", self.sessions)
        self.session = ""

    def ask(self, path: str, method: str = "POST", body: bytes = b"", **headers: str) -> tuple[int, Any]:
        """Status and JSON; {} if there is none. The loop of asyncio ends with each request, so no timer runs."""
        address, _, query = path.partition("?")
        named = {"host": "127.0.0.1:1"} | {name.replace("_", "-"): value for name, value in headers.items()}
        scope = {
            "type": "http", "method": method, "path": unquote(address if address[:1] == "/" else f"/key/{address}"),
            "raw_path": b"", "root_path": "", "scheme": "http", "query_string": query.encode(),
            "headers": [(name.encode(), value.encode()) for name, value in named.items()], "http_version": "1.1",
        }  # fmt: skip
        sent: list[Any] = []
        parts = iter([{"type": "http.request", "body": body, "more_body": False}])

        async def receive() -> Any:
            part = next(parts, None)
            return part if part is not None else await asyncio.Event().wait()

        async def send(message: Any) -> None:
            sent.append(message)

        asyncio.run(self.app(scope, receive, send))
        content = b"".join(message.get("body", b"") for message in sent)
        return sent[0]["status"], json.loads(content.splitlines()[-1]) if content.startswith(b"{") else {}

    def begin(self) -> None:
        status, answer = self.ask("sessions")
        assert status == 200
        self.session = answer["session"]

    def send(self, kind: str, name: str, content: bytes = b"x") -> int:
        return int(self.ask(f"sessions/{self.session}/files/{kind}?name={name}", body=content)[1]["number"])

    def order(self, task: str, order: Any) -> tuple[int, Any]:
        body = order if isinstance(order, bytes) else json.dumps(order).encode()
        return self.ask(f"sessions/{self.session}/tasks/{task}", body=body, content_type="application/json")


@pytest.fixture
def client(tmp_path: Path) -> Iterator[Client]:
    made = Client(tmp_path)
    made.begin()
    yield made
    made.sessions.close()


COLOUR = {"photo": 1, "region": [1, 1, 20, 20], "white": [1, 1, 20, 20], "reflectance": 0.9}
MALFORMED: tuple[tuple[str, Any, str], ...] = (
    ("find", b"\xff{}", "no JSON object"), ("find", b"[" * 100_000, "no JSON object"),
    ("find", b'{"photo": 1, "photo": 1}', "no JSON object"), ("find", b'{"photo": NaN}', "no JSON object"),
    ("find", b'{"photo": ' + b"9" * 5000 + b"}", "no JSON object"), ("find", {}, "lacks photo"),
    ("find", {"photo": "../../x"}, "must be a whole number"), ("find", {"photo": 0}, "must lie between 1 and 32"),
    ("find", {"photo": 1, "colour": 2}, "unknown key"),
    ("find", {"photo": 2}, "This tab has no photo 2. Drop the photo again."),
    ("find", {"photo": 1, "chart": "/etc/passwd"}, "no chart"),
    ("find", {"photo": 1, "chart": {"table": "../x"}}, "chart"), ("find", {"photo": 1, "chart": "\ud800"}, "chart"),
    ("chart", {"chart": {"layout": 1}}, "chart"),
    ("calibrate", {"shots": [{"photo": 1}] * 33}, "must hold 1 to 32 entries"),
    ("calibrate", {"shots": [{"photo": 1, "white": 3}]}, "no photo 3"),
    ("calibrate", {"shots": [{"photo": 1, "lamp": "photo-1/x"}]}, "no lamp"),
    ("calibrate", {"shots": [{"photo": 1, "corners": [[1, 2]] * 3 + [[1, 1e300]]}]}, "from -1e+06 to 1e+06"),
    ("colour", COLOUR | {"white": [1, 2, 3, 1e300]}, "between -1e+06 and 1e+06"),
    ("colour", COLOUR | {"reflectance": 1e300}, "between 0.02 and 1.2"),
    ("colour", COLOUR | {"lamp": "../D55"}, "no lamp"), ("colour", COLOUR, "no result yet. Calibrate first."),
    ("export", {"to": "../../csv"}, "no export"), ("export", {"to": "csv"}, "no result yet. Calibrate first."),
    ("key", {"passphrase": "\ud800"}, "passphrase"),
    ("passport", {"key": "", "photos": [1], "serial": "x" * 1001}, "at most 1000"),
    ("passport", {"key": "", "photos": [1]}, "no result yet. Calibrate first."),
)  # fmt: skip


def test_a_malformed_order_is_the_clients_fault_and_says_what_to_do(client: Client) -> None:
    """No process is started for any of them."""
    client.send("photo", "a.dng")
    for task, order, words in MALFORMED:
        status, answer = client.order(task, order)
        assert (status, answer["error"]["code"]) == (400, "invalid_argument"), (task, str(order)[:80], answer)
        assert words in answer["error"]["words"], (task, str(order)[:80], answer["error"]["words"])
        assert answer["error"]["words"].endswith(".")
        assert "fault" not in answer["error"]["words"]
    assert {task for task, _, _ in MALFORMED} == set(TASKS) == set(ORDERS)


def test_every_route_answers_a_wrong_request_with_a_code_and_what_to_do(client: Client) -> None:
    ours = f"sessions/{client.session}"
    for status, path, method, content_type in (
        (404, "none", "GET", ""), (404, "static/none.js", "GET", ""), (405, "sessions", "GET", ""),
        (405, "", "POST", ""), (405, f"{ours}/tasks/find", "GET", ""), (405, ours, "PUT", ""),
        (404, "sessions/none", "POST", ""), (404, "sessions/none", "DELETE", ""),
        (404, "sessions/none/files/photo", "POST", ""), (404, "sessions/none/tasks/find", "POST", "application/json"),
        (404, f"{ours}/files/none", "POST", ""), (404, f"{ours}/files/none", "GET", ""),
        (415, f"{ours}/files/photo", "POST", "multipart/form-data; boundary=x"),
        (404, f"{ours}/tasks/perform", "POST", "application/json"), (415, f"{ours}/tasks/find", "POST", ""),
        (415, f"{ours}/tasks/find", "POST", "text/plain"),
    ):  # fmt: skip
        answer = client.ask(path, method, b"{}", content_type=content_type)
        assert (answer[0], answer[1]["error"]["code"]) == (status, "invalid_argument"), (path, method, answer)
        assert answer[1]["error"]["words"].count(".") > 1, (path, method, answer)  # what is wrong, and what to do


def test_strangers_and_requests_without_the_key_are_refused(client: Client) -> None:
    """Another name of the server (DNS rebinding), another origin's page, an address without the key."""
    assert client.ask("", "GET")[0] == client.ask("", "GET", origin="http://127.0.0.1:1")[0] == 200
    assert client.ask("", "GET", host="rebound.example:1")[0] == 400
    for headers in ({"origin": "http://other.example"}, {"origin": "null"}, {"sec_fetch_site": "same-site"}):
        assert client.ask("", "GET", **headers)[0] == client.ask("sessions", **headers)[0] == 403
    assert client.ask("/", "GET")[0] == client.ask("/sessions")[0] == 404


def test_no_text_of_a_request_becomes_a_path(client: Client) -> None:
    assert client.send("photo", "..%2F..%2Fa:b/%00IMG_1.dng") == 1
    assert client.send("table", "") == 2
    ours = f"sessions/{client.session}"
    assert client.ask(f"{ours}/files/..%2fphoto")[0] == 404
    for path in (
        "files/photo-1", "files/_.._a_b__IMG_1.dng", "files/photo-1%2f_.._a_b__IMG_1.dng", "files/table",
        "files/..%2fresult.json", "../../static/..%2forder.schema.json",
    ):  # fmt: skip
        assert client.ask(f"{ours}/{path}", "GET")[0] == 404, path
    folder = client.sessions.open[client.session].folder
    assert [path.name for path in folder.glob("photo-1/*")] == ["_.._a_b__IMG_1.dng"]
    assert folder.stat().st_mode & 0o77 == 0
    assert client.ask(ours, "DELETE")[0] == 204
    assert not folder.exists()


def test_files_that_are_too_large_leave_nothing(client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    """By the length that the request states, or by what comes, in pieces."""
    files = f"sessions/{client.session}/files/photo"
    assert client.ask(files, content_length=str(2 << 30))[0] == 413
    monkeypatch.setattr("camssf_app.server.LARGEST_PHOTO", 3)
    assert client.ask(files, body=b"1234")[0] == 413
    assert not list(client.sessions.open[client.session].folder.iterdir())


def test_a_task_waits_for_the_one_before_it_not_for_ever(client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    number = client.send("photo", "a.dng")
    client.sessions.open[client.session].busy = True
    monkeypatch.setattr("camssf_app.server.LAST_TASK", 0.0)
    assert client.order("find", {"photo": number})[0] == 409


def test_a_file_keeps_its_name(client: Client) -> None:
    names = (
        ("photo", "photo.jpg", "photo.jpg"), ("photo", "IMG.CR3", "IMG.CR3"), ("photo", "no_ending", "no_ending"),
        ("photo", "%C3%A4%20b.dng", "ä b.dng"), ("photo", f"{'x' * 300}.dng", f"{'x' * 56}.dng"),
        ("photo", "", "photo"), ("photo", "...", "photo"), ("photo", "..%2F..%5Ca:b%00.dng", "_.._a_b_.dng"),
        ("photo", "x.dng.%20", "x.dng"), ("table", "mine.txt", "mine.txt"), ("table", "mine", "mine"),
        ("layout", "card.JSON", "card.JSON"), ("layout", "card.txt", "card.txt.json"),
    )  # fmt: skip
    for number, (kind, sent, kept) in enumerate(names, 1):
        assert client.send(kind, sent) == number
        (path,) = (client.sessions.open[client.session].folder / f"{kind}-{number}").iterdir()
        assert path.name == kept


def test_crashed_tabs_give_way_and_expire(client: Client) -> None:
    """Neither a running calculation nor a tab that shows signs of life is ended."""
    from camssf_app.server import CRASHED, EXPIRED, MOST_SESSIONS

    sessions = client.sessions.open
    while len(sessions) < MOST_SESSIONS:
        client.begin()
    for name in sessions:
        client.session = name
        client.send("photo", "a.dng")
    assert client.ask("sessions")[0] == 429
    busy, oldest, other, *rest = sessions.values()
    for session, beats in ((busy, 3 * EXPIRED), (oldest, CRASHED + 2), (other, CRASHED)):
        session.missed = beats
    busy.busy = True
    client.begin()
    assert [each.closed for each in (busy, oldest, other)] == [False, True, False]
    assert not oldest.folder.exists()
    assert client.ask(f"sessions/{other.name}")[0] == 204  # a sign of life
    assert client.ask("sessions")[0] == 200  # in place of the one that holds no file
    for session in (busy, *rest):
        session.missed = EXPIRED - 1

    async def sweep() -> None:
        client.sessions.sweep()

    asyncio.run(sweep())
    assert [each.closed for each in (busy, other)] == [False, False]
    assert {each.closed for each in rest} == {True}
    assert not any(each.folder.exists() for each in rest)
    status, found = client.ask(f"sessions/{rest[0].name}")
    assert (status, "Reload the page" in found["error"]["words"]) == (404, True)


def test_where_it_cannot_run_it_says_why(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: Any) -> None:
    """A port that is taken, no room for temporary files, no library."""
    with socket.create_server(("127.0.0.1", 0)) as taken:
        assert main(["app", "--no-browser", "--port", str(taken.getsockname()[1])]) == 2
    assert "--port" in capsys.readouterr().err
    with monkeypatch.context() as patched:
        patched.setattr(tempfile, "tempdir", str(tmp_path / "none"))
        assert main(["app", "--no-browser"]) == 2
    assert "no room for temporary files" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "starlette", None)
    assert main(["app", "--no-browser"]) == 2
    assert f'{sys.executable} -m pip install -e ".[app]"' in capsys.readouterr().err


def test_a_calibration_that_fails_keeps_the_result(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "result").mkdir()
    (tmp_path / "result" / "result.json").write_text("good")
    answer = perform("calibrate", CalibrateOrder(()), lambda stage, part: None)
    assert "no photo" in answer["error"]["words"]
    assert (tmp_path / "result" / "result.json").read_text() == "good"
