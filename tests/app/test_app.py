"""The page in the browser: a stranger's requests are refused, and a real browser gets from a photo to a colour."""

import asyncio
import http.client
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from camssf.cli import main
from camssf.result import Result
from camssf_app.orders import ORDERS, CalibrateOrder
from camssf_app.tasks import TASKS, perform
from tests.spectra.test_layouts import photographed, write_card
from tests.support.axe import faults, serious_faults
from tests.support.browser import Browser
from tests.support.captures import photos
from tests.support.processes import until


class Server:
    """`camssf app` in a process of its own, whose temporary folder is watched."""

    def __init__(self, temporary: Path) -> None:
        self.temporary = temporary
        words = [sys.executable, "-m", "camssf", "app", "--no-browser"]
        self.home = temporary.with_name("home")
        self.home.mkdir()
        environment = os.environ | {"TMPDIR": str(temporary), "HOME": str(self.home)}
        self.process = subprocess.Popen(words, stderr=subprocess.PIPE, text=True, env=environment)
        self.address = re.findall(r"http://\S+", self.process.stderr.readline())[0]

    def stop(self) -> str:
        self.process.send_signal(signal.SIGINT)
        return self.process.communicate(timeout=30)[1]

    def folders(self) -> list[Path]:
        return list(self.temporary.glob("camssf-*/*"))

    def ask(self, path: str, method: str = "GET", body: Any = None, **headers: str) -> tuple[int, bytes]:
        url = urlsplit(self.address)
        connection = http.client.HTTPConnection(str(url.hostname), url.port, timeout=60)
        named = {name.replace("_", "-"): value for name, value in headers.items()}
        try:
            connection.request(method, path if path.startswith("/") else url.path + path, body, named)
            answer = connection.getresponse()
            return answer.status, answer.read()
        except (BrokenPipeError, ConnectionResetError):  # refused before all was sent
            return 0, b""
        finally:
            connection.close()


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    running = Server(tmp_path_factory.mktemp("temporary"))
    yield running
    output = running.stop()
    assert "ERROR" not in output, output
    assert [*running.temporary.iterdir(), *running.home.rglob("*")] == []


EVENTS = ("Runtime.exceptionThrown", "Log.entryAdded", "Network.requestWillBeSent")


@pytest.fixture
def browser(server: Server, tmp_path: Path) -> Iterator[Browser]:
    """One for each test: a tab behind another one asks nothing before it is left."""
    running = Browser(tmp_path / "profile")
    with closing(running):
        open_page(running, server)
        yield running
        running.do("Page.navigate", url="about:blank")  # leaves the page: its files go
        running.wait("location.href === 'about:blank'")  # its question is answered while something is asked of it
        left(server, [])
    told = {each: [event["params"] for event in running.events if event["method"] == each] for each in EVENTS}
    faults, logged, sent = told.values()
    assert faults == []
    assert [each["entry"]["text"] for each in logged if each["entry"]["level"] == "error"] == []
    outside = [each["request"]["url"] for each in sent]
    assert [url for url in outside if not url.startswith((server.address, "data:", "about:"))] == []


def open_page(browser: Browser, server: Server) -> str:
    target = browser.open(server.address)
    browser.wait("document.documentElement?.dataset.ready")
    return target


def left(server: Server, folders: list[Path]) -> None:
    """Wait until only these sessions' folders are left."""
    until(lambda: server.folders() == folders, 60.0)


def chart() -> Path:
    return Path(str(photos().shots[0].chart))


def text(browser: Browser, selector: str) -> str:
    return str(browser.js(f"document.querySelector({json.dumps(selector)}).textContent"))


def calibrated(browser: Browser) -> tuple[str, str]:
    """What the page says then: a problem, or the verdict."""
    browser.press("#calibrate")
    browser.wait("!document.querySelector('#result').hidden || document.querySelector('#problem').textContent")
    return text(browser, "#problem"), text(browser, "#status")


def dropped(browser: Browser, *photos: Path) -> None:
    """Drop photos, and wait for their cards."""
    browser.drop("#drop", *photos)
    browser.wait(f"document.querySelectorAll('.card').length == {len(photos)}")


# -- requests -----------------------------------------------------------------------------------------------------


def test_where_it_cannot_run_is_an_error_in_words(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without room for temporary files, and without its libraries."""
    with monkeypatch.context() as patched:
        patched.setattr(tempfile, "tempdir", str(tmp_path / "none"))
        assert main(["app", "--no-browser"]) == 2
    assert "no room for temporary files" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "starlette", None)
    assert main(["app", "--no-browser"]) == 2
    assert f'{sys.executable} -m pip install -e ".[app]"' in capsys.readouterr().err


@pytest.mark.full
def test_a_port_that_is_taken_is_an_error_in_words(server: Server, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["app", "--no-browser", "--port", str(urlsplit(server.address).port)]) == 2
    assert "--port" in capsys.readouterr().err


def test_a_calibration_that_fails_keeps_the_result(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "result").mkdir()
    (tmp_path / "result" / "result.json").write_text("good")
    found = perform("calibrate", CalibrateOrder(()), lambda stage, part: None)
    assert "no photo" in found["error"]["words"]
    assert (tmp_path / "result" / "result.json").read_text() == "good"


@pytest.mark.full
def test_strangers_paths_and_large_files_are_refused(server: Server, tmp_path: Path) -> None:
    host = urlsplit(server.address).netloc
    assert server.ask("")[0] == server.ask("", Origin=f"http://{host}")[0] == 200
    assert server.ask("", Host=f"rebound.example:{urlsplit(server.address).port}")[0] == 400
    for headers in ({"Origin": "http://other.example"}, {"Origin": "null"}, {"Sec_Fetch_Site": "same-site"}):
        assert server.ask("", **headers)[0] == server.ask("sessions", "POST", **headers)[0] == 403
    assert server.ask("/")[0] == server.ask("/sessions", "POST")[0] == 404  # without the key
    session = json.loads(server.ask("sessions", "POST")[1])["session"]
    ours = f"sessions/{session}"
    name = f"{ours}/files/photo?name=..%2F..%2Fa:b/%00IMG_1.dng"
    assert server.ask(name, "POST", chart().read_bytes()) == (200, b'{"number":1}')
    assert server.ask(f"{ours}/files/table", "POST", b"{}") == (200, b'{"number":2}')
    assert server.ask(f"{ours}/files/..%2fphoto", "POST", b"")[0] == 404
    for path in (
        "files/photo-1", "files/_.._a_b__IMG_1.dng", "files/photo-1%2f_.._a_b__IMG_1.dng", "files/table",
        "files/..%2fresult.json", "../../static/..%2forder.schema.json",
    ):  # fmt: skip
        assert server.ask(f"{ours}/{path}")[0] == 404, path
    (folder,) = server.folders()
    assert [path.name for path in folder.glob("photo-1/*")] == ["_.._a_b__IMG_1.dng"]
    assert folder.stat().st_mode & 0o77 == 0

    huge = tmp_path / "huge.dng"
    with huge.open("wb") as stream:
        stream.truncate(2 << 30)
    with huge.open("rb") as stream:
        assert server.ask(f"{ours}/files/table", "POST", stream)[0] in (413, 0)
    assert sum(path.stat().st_size for path in folder.iterdir()) < 4 << 20
    assert server.ask(ours, "DELETE")[0] == 204
    assert server.folders() == []
    assert server.ask(f"{ours}/tasks/find", "POST", "{}")[0] == 404


class Client:
    """Asks the application without a network, so that its sessions' clocks can be set."""

    def __init__(self, root: Path) -> None:
        server = pytest.importorskip("camssf_app.server", reason="starlette or uvicorn is not installed")
        self.sessions = server.Sessions(root)
        self.app = server.application("key", self.sessions)
        self.session = ""

    def ask(self, path: str, method: str = "POST", body: bytes = b"", type_: str = "") -> tuple[int, Any]:
        """Status and JSON; {} if there is none. The loop of asyncio ends with each request, so no timer runs."""
        address, _, query = path.partition("?")
        headers = [(b"host", b"127.0.0.1:1")] + ([(b"content-type", type_.encode())] if type_ else [])
        scope = {
            "type": "http", "method": method, "path": f"/key/{address}", "raw_path": b"", "root_path": "",
            "scheme": "http", "query_string": query.encode(), "headers": headers, "http_version": "1.1",
        }  # fmt: skip
        sent: list[Any] = []
        parts = iter([{"type": "http.request", "body": body, "more_body": False}])

        async def receive() -> Any:
            found = next(parts, None)
            return found if found is not None else await asyncio.Event().wait()

        async def send(message: Any) -> None:
            sent.append(message)

        asyncio.run(self.app(scope, receive, send))
        content = b"".join(each.get("body", b"") for each in sent)
        return sent[0]["status"], json.loads(content.splitlines()[-1]) if content else {}

    def begin(self) -> str:
        status, found = self.ask("sessions")
        assert status == 200
        self.session = found["session"]
        return str(self.session)

    def send(self, kind: str, name: str, content: bytes = b"x") -> int:
        return int(self.ask(f"sessions/{self.session}/files/{kind}?name={name}", body=content)[1]["number"])

    def order(self, task: str, order: Any) -> tuple[int, Any]:
        body = order if isinstance(order, bytes) else json.dumps(order).encode()
        return self.ask(f"sessions/{self.session}/tasks/{task}", body=body, type_="application/json")


@pytest.fixture
def client(tmp_path: Path) -> Iterator[Client]:
    made = Client(tmp_path)
    made.begin()
    yield made
    made.sessions.close()


RECTANGLE = [1, 1, 20, 20]
COLOUR = {"photo": 1, "region": RECTANGLE, "white": RECTANGLE, "reflectance": 0.9}
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
        status, found = client.order(task, order)
        assert (status, found["error"]["code"]) == (400, "invalid_argument"), (task, str(order)[:80], found)
        assert words in found["error"]["words"], (task, str(order)[:80], found["error"]["words"])
        assert found["error"]["words"].endswith(".")
        assert "fault" not in found["error"]["words"]
    assert {task for task, _, _ in MALFORMED} == set(TASKS) == set(ORDERS)


def test_every_route_answers_a_wrong_request_with_a_code_and_what_to_do(
    client: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    ours = f"sessions/{client.session}"
    for status, path, method, type_ in (
        (404, "none", "GET", ""), (404, "static/none.js", "GET", ""), (405, "sessions", "GET", ""),
        (405, "", "POST", ""),
        (405, f"{ours}/tasks/find", "GET", ""), (405, ours, "PUT", ""), (404, "sessions/none", "POST", ""),
        (404, "sessions/none", "DELETE", ""), (404, "sessions/none/files/photo", "POST", ""),
        (404, "sessions/none/tasks/find", "POST", "application/json"), (404, f"{ours}/files/none", "POST", ""),
        (415, f"{ours}/files/photo", "POST", "multipart/form-data; boundary=x"),
        (404, f"{ours}/files/none", "GET", ""),
        (404, f"{ours}/tasks/perform", "POST", "application/json"), (415, f"{ours}/tasks/find", "POST", ""),
        (415, f"{ours}/tasks/find", "POST", "text/plain"),
    ):  # fmt: skip
        found = client.ask(path, method, b"{}", type_)
        assert (found[0], found[1]["error"]["code"]) == (status, "invalid_argument"), (path, method, found)
        assert found[1]["error"]["words"].count(".") > 1, (path, method, found)  # what is wrong, and what to do
    session = client.sessions.open[client.session]
    with monkeypatch.context() as patched:  # a file whose length was not stated, in pieces
        patched.setattr("camssf_app.server.LARGEST_PHOTO", 3)
        assert client.ask(f"{ours}/files/photo", body=b"1234")[0] == 413
    assert not list(session.folder.iterdir())
    number = client.send("photo", "a.dng")
    session.busy = True
    monkeypatch.setattr("camssf_app.server.LAST_TASK", 0.0)
    assert client.order("find", {"photo": number})[0] == 409


def test_a_file_keeps_its_name(client: Client) -> None:
    """It is a name, not a path."""
    names = (
        ("photo", "photo.jpg", "photo.jpg"), ("photo", "IMG.CR3", "IMG.CR3"), ("photo", "no_ending", "no_ending"),
        ("photo", "%C3%A4%20b.dng", "ä b.dng"), ("photo", f"{'x' * 300}.dng", f"{'x' * 56}.dng"),
        ("photo", "", "photo"),
        ("photo", "...", "photo"), ("photo", "..%2F..%5Ca:b%00.dng", "_.._a_b_.dng"), ("photo", "x.dng.%20", "x.dng"),
        ("table", "mine.txt", "mine.txt"), ("table", "mine", "mine"), ("layout", "card.JSON", "card.JSON"),
        ("layout", "card.txt", "card.txt.json"),
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


# -- in a browser -------------------------------------------------------------------------------------------------


@pytest.mark.full
def test_from_a_dropped_photo_to_a_report_a_colour_an_export_and_a_passport(server: Server, browser: Browser) -> None:
    dropped(browser, chart())
    browser.js("document.querySelector('.lamp').value = 'D55'")
    browser.press(".read")
    browser.wait("document.querySelector('.card .problem').textContent")
    assert "Calibrate first" in text(browser, ".card .problem")

    before = corners(browser)
    browser.js("document.querySelector('.handle.corner').focus()")  # by keyboard ...
    for _ in range(3):
        browser.key("ArrowRight", shift=True)
    browser.key("ArrowUp")
    moved = corners(browser)
    assert moved[0][0] > before[0][0] + 5
    assert moved[0][1] < before[0][1]
    assert moved[1:] == before[1:]
    x, y = browser.middle(".handle.corner:nth-of-type(3)")  # ... and by hand: the bottom right one
    browser.mouse("Pressed", x, y)
    browser.mouse("Moved", x - 8, y - 6)
    browser.mouse("Released", x - 8, y - 6)
    dragged = corners(browser)
    assert [a == b for a, b in zip(dragged, moved, strict=True)] == [True, True, False, True]

    assert calibrated(browser) == ("", "accepted")
    (folder,) = server.folders()
    (shot,) = Result.load(folder / "result" / "result.json").capture.shots
    assert shot.pose.method == "by hand"
    assert shot.lamp.name == "D55"
    assert abs(shot.pose.corners[0][0] - before[0][0]) < 3  # found again from the moved ones
    until(lambda: any("report.html" in url for url in frames(browser)), 30.0)

    centre = shot.pose.patches[14].mean(axis=0).tolist()  # red
    browser.middle(".card image")
    at = f"new DOMPoint({centre[0]}, {centre[1]}).matrixTransform(document.querySelector('.card g').getScreenCTM())"
    browser.click(*browser.js(f"(p => [p.x, p.y])({at})"))
    browser.wait("['.colour', '.card .problem'].some(each => document.querySelector(each).textContent)")
    lab = [float(value) for value in re.findall(r"[Lab]\* (-?[\d.]+)", text(browser, ".colour"))]
    assert lab == pytest.approx([42, 55, 28], abs=6)  # red of a ColorChecker
    browser.wait("document.querySelector('.spectrum').naturalWidth > 100")

    browser.press("#export")
    browser.wait("document.querySelector('#exported a')")
    url = browser.js("document.querySelector('#exported a').href")
    assert json.loads(server.ask(urlsplit(url).path)[1])["spectral_data"]
    browser.js("document.querySelector('details').open = true")
    browser.press("#make-key")
    browser.wait("document.querySelectorAll('#signed a').length == 2")
    browser.choose("#key", folder / "result" / "result.json")
    browser.press("#sign")
    browser.wait("document.querySelector('#export-problem').textContent")
    for words in ("result.json is not a private key", "the button in the page"):
        assert words in text(browser, "#export-problem")
    browser.choose("#key", folder / "passport-key.pem")
    browser.press("#sign")
    browser.wait("document.querySelectorAll('#signed a').length == 1")
    words = ["passport", "verify", str(folder / "camera.jws"), "--key", str(folder / "passport-key.pub.pem")]
    assert main([*words, "--result", str(folder / "result" / "result.json")]) == 0
    assert not (folder / ".signing-key.pem").exists()


@pytest.mark.full
def test_a_chart_of_the_users_own(server: Server, browser: Browser, tmp_path: Path) -> None:
    write_card(tmp_path)
    table, _ = photographed(tmp_path, f"{tmp_path / 'card.json'}:{tmp_path / 'mine.csv'}")
    note = tmp_path / "note.csv"
    note.write_text("no table")

    def add(*files: Path) -> str:
        browser.js("document.querySelector('#upload-problem').textContent = ''")
        browser.drop("#drop", *files)
        browser.wait("document.querySelector('#upload-problem').textContent")
        return text(browser, "#upload-problem")

    assert add(tmp_path / "mine.csv").startswith("mine.csv holds 35 patches.")  # without the layout
    assert "note.csv is not a table of reflectances" in add(tmp_path / "card.json", note)
    assert "card.json is the layout of a chart. Now add the table" in add(tmp_path / "card.json")
    browser.choose("#chart-files", tmp_path / "mine.csv")
    browser.wait("document.querySelector('#chart').value == 'card.json, mine.csv'")
    assert "garden card, 35 patches" in text(browser, "#chart")
    dropped(browser, tmp_path / "chart.dng")
    assert text(browser, ".card .problem") == ""
    browser.js("document.querySelector('.lamp').value = 'D55'")
    assert calibrated(browser)[0] == ""
    (folder,) = server.folders()
    file = folder / "result" / "result.json"
    result = Result.load(file)
    assert result.verdict.status == text(browser, "#status") != "refused"
    assert (result.capture.chart.layout.name, result.capture.chart.patches) == ("garden card", table.patches)
    assert str(folder) not in file.read_text("utf-8")


@pytest.mark.full
def test_files_that_are_added_before_the_page_is_ready_are_kept(browser: Browser) -> None:
    def paused(pattern: str) -> None:
        browser.events.clear()
        browser.do("Fetch.enable", patterns=[{"urlPattern": pattern}])
        browser.js("document.documentElement.dataset.old = 'yes'")
        browser.do("Page.reload")
        browser.wait("document.querySelector('#files') && !document.documentElement.dataset.old")

    def go_on() -> None:
        browser.wait("1")
        for each in [event["params"] for event in browser.events if event["method"] == "Fetch.requestPaused"]:
            browser.do("Fetch.continueRequest", requestId=each["requestId"])
        browser.do("Fetch.disable")

    paused("*/app.js")  # nothing listens yet
    for name in ("files", "chart-files", "chart"):
        assert browser.js(f"document.querySelector('#{name}').disabled")
    go_on()
    browser.wait("document.documentElement?.dataset.ready")

    paused("*/sessions")  # the server is slow
    browser.wait("!document.querySelector('#files').disabled")
    assert "starting" in text(browser, "#session")
    assert not browser.js("document.querySelector('#session').hidden")
    browser.choose("#files", chart())
    browser.drop("#drop", chart())
    go_on()
    browser.wait("document.querySelectorAll('.card').length == 2")
    assert browser.js("document.querySelector('#session').hidden")
    assert text(browser, "#upload-problem") == ""


@pytest.mark.full
def test_the_colour_is_read_after_a_calibration_in_unknown_light(browser: Browser) -> None:
    """The default path: no lamp is chosen, for the chart or for another photo in other light."""
    dropped(browser, *(Path(str(photos(lamp, "Demo phone").shots[0].chart)) for lamp in ("D55", "LED-B3")))
    browser.js("document.querySelectorAll('.role')[1].value = 'none'")
    browser.js("document.querySelectorAll('.role')[1].dispatchEvent(new Event('change'))")
    unknown = "[...document.querySelectorAll('.lamp')].map(each => each.selectedOptions[0].text)"
    assert browser.js(unknown) == ["I do not know (phones only)", "I do not know"]
    assert calibrated(browser) == ("", "accepted")
    browser.js("document.querySelectorAll('.read').forEach(each => each.click())")
    read = "[...document.querySelectorAll('.card')].map(each => each.querySelector('%s').textContent)"
    browser.wait(f"{read % '.colour'}.every((each, i) => each || {read % '.problem'}[i])")
    assert browser.js(read % ".problem") == ["", ""]
    assert all(each.startswith("L*") and "was not named" in each for each in browser.js(read % ".colour"))


def frames(browser: Browser) -> list[str]:
    """The addresses of the page's frames, which load after it."""
    found = browser.do("Target.getTargets")["targetInfos"]
    return [each["url"] for each in found if each["type"] == "iframe"]


def corners(browser: Browser) -> list[list[float]]:
    words = browser.js("document.querySelector('.outline').getAttribute('points')")
    return [[float(number) for number in point.split(",")] for point in words.split()]


@pytest.mark.full
def test_bad_files_a_cancelled_task_a_refusal_and_a_second_tab(
    server: Server, browser: Browser, tmp_path: Path
) -> None:
    content = chart().read_bytes()
    damaged, large, huge, note = (tmp_path / f"{name}.dng" for name in ("damaged", "large", "huge", "note"))
    damaged.write_bytes(content[: len(content) // 2])
    note.write_text("no photo")
    large.write_bytes(content)
    for path, size in ((large, 100_000_000), (huge, 2 << 30)):
        with path.open("ab") as stream:
            stream.truncate(size)
    browser.drop("#drop", damaged, note, huge, large)
    browser.wait("document.querySelector('.card') && document.querySelector('#upload-problem').textContent")
    problem = text(browser, "#upload-problem")
    for words in ("damaged.dng is truncated", "note.dng is not a DNG", "huge.dng is larger than 512 MB"):
        assert words in problem
    assert str(tmp_path) not in problem
    assert "large.dng" in text(browser, ".card h3")

    browser.press("#calibrate")
    browser.wait("!document.querySelector('#progress').hidden")
    browser.press("#cancel")  # at once: the calibration takes less than a second
    browser.wait("document.querySelector('#problem').textContent")
    assert text(browser, "#problem") == "Cancelled."
    assert browser.js("document.querySelector('#result').hidden")

    first, session = server.folders()[0], browser.session
    second = open_page(browser, server)
    assert len(server.folders()) == 2
    assert browser.js("document.querySelectorAll('.card').length") == 0
    browser.do("Target.closeTarget", targetId=second)
    browser.session = session
    left(server, [first])

    assert calibrated(browser) == ("", "refused")  # a camera, and no lamp was chosen
    assert text(browser, "#reasons") != ""
    assert browser.js("document.querySelector('#curves').hidden")


@pytest.mark.full
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_no_serious_fault_in_the_app(browser: Browser, scheme: str) -> None:
    dropped(browser, chart())
    browser.js("for (const each of document.querySelectorAll('[hidden]')) each.hidden = false")
    browser.js("document.querySelector('details').open = true")
    browser.js("for (const each of document.querySelectorAll('.problem')) each.textContent = 'A problem.'")
    assert serious_faults(browser, scheme) == []
    browser.js("document.querySelector('#drop').replaceWith(document.querySelector('#files'))")  # it can find one
    assert "label" in [each[0] for each in faults(browser, scheme)]
