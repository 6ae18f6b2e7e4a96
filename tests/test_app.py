"""The page in the browser: a stranger's requests are refused, and a real browser gets from a photo to a colour."""

from __future__ import annotations

import http.client
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from browser import Browser
from captures import photos
from test_layouts import photographed, write_card

from camssf.app.tasks import perform
from camssf.cli import main

SCREENSHOTS = os.environ.get("CAMSSF_SCREENSHOTS", "")
"""A folder for pictures of the page, to be looked at."""


class Server:
    """`camssf app` in a process of its own, whose temporary folder is watched."""

    def __init__(self, temporary: Path) -> None:
        self.temporary = temporary
        words = [sys.executable, "-m", "camssf", "app", "--no-browser"]
        self.home = temporary.with_name("home")
        self.home.mkdir()
        environment = os.environ | {"TMPDIR": str(temporary), "HOME": str(self.home)}
        self.process = subprocess.Popen(words, stderr=subprocess.PIPE, text=True, env=environment)
        assert self.process.stderr is not None
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

    def task(self, session: str, name: str, order: dict[str, Any]) -> dict[str, Any]:
        status, lines = self.ask(f"sessions/{session}/tasks/{name}", "POST", json.dumps(order))
        assert status == 200, lines
        return dict(json.loads(lines.splitlines()[-1]))


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    pytest.importorskip("starlette", reason="starlette is not installed")
    pytest.importorskip("uvicorn", reason="uvicorn is not installed")
    running = Server(tmp_path_factory.mktemp("temporary"))
    yield running
    output = running.stop()
    assert "ERROR" not in output, output
    assert [*running.temporary.iterdir(), *running.home.rglob("*")] == []


@pytest.fixture
def browser(server: Server, tmp_path: Path) -> Iterator[Browser]:
    running = Browser(tmp_path / "profile")
    open_page(running, server)
    yield running
    running.do("Page.navigate", url="about:blank")  # leaves the page: its files go
    left(server, [])
    faults = [each for each in running.events if each["method"] == "Runtime.exceptionThrown"]
    logged = [each["params"]["entry"] for each in running.events if each["method"] == "Log.entryAdded"]
    sent = [each["params"] for each in running.events if each["method"] == "Network.requestWillBeSent"]
    running.close()
    assert faults == []
    assert [entry["text"] for entry in logged if entry["level"] == "error"] == []
    outside = [each["request"]["url"] for each in sent]
    assert [url for url in outside if not url.startswith((server.address, "data:", "about:"))] == []


def open_page(browser: Browser, server: Server) -> str:
    target = browser.open(server.address)
    browser.wait("document.documentElement?.dataset.ready")
    return target


def left(server: Server, folders: list[Path]) -> None:
    """Wait until only these sessions' folders are left."""
    for _ in range(600):
        if server.folders() == folders:
            break
        time.sleep(0.1)
    assert server.folders() == folders


def chart() -> Path:
    return Path(str(photos().shots[0].chart))


def text(browser: Browser, selector: str) -> str:
    return str(browser.js(f"document.querySelector({json.dumps(selector)}).textContent"))


def picture(browser: Browser, name: str) -> None:
    if SCREENSHOTS:
        browser.picture(Path(SCREENSHOTS) / f"{name}.png")


def calibrated(browser: Browser) -> None:
    browser.press("#calibrate")
    browser.wait("!document.querySelector('#result').hidden || document.querySelector('#problem').textContent")


# -- requests -----------------------------------------------------------------------------------------------------


def test_without_the_extra_it_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "starlette", None)
    assert main(["app", "--no-browser"]) == 2
    assert "pip install 'camssf[app]'" in capsys.readouterr().err


@pytest.mark.full
def test_a_port_that_is_taken_is_an_error_in_words(server: Server, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["app", "--no-browser", "--port", str(urlsplit(server.address).port)]) == 2
    assert "--port" in capsys.readouterr().err


def test_without_room_for_temporary_files_it_is_an_error_in_words(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "none"))
    assert main(["app", "--no-browser"]) == 2
    assert "no room for temporary files" in capsys.readouterr().err


def test_a_calibration_that_fails_keeps_the_result(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "result").mkdir()
    (tmp_path / "result" / "result.json").write_text("good")
    found = perform("calibrate", {"shots": []}, lambda stage, part: None)
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
    assert (
        server.ask(f"{ours}/files/..%2fphoto", "POST", b"")[0] == server.ask(f"{ours}/files/x", "POST", b"")[0] == 404
    )
    for path in (
        "files/photo-1",
        "files/_.._a_b__IMG_1.dng",
        "files/photo-1%2f_.._a_b__IMG_1.dng",
        "files/table.csv",
        "files/..%2fresult.json",
        "../../static/..%2fresult.schema.json",
    ):
        assert server.ask(f"{ours}/{path}")[0] == 404, path
    for shot, words in (
        ({"photo": "../../x"}, "no photo"),
        ({"photo": 2}, "no photo"),
        ({"photo": 1, "lamp": str(chart())}, "no lamp"),
    ):
        assert words in server.task(session, "calibrate", {"shots": [shot]})["error"]["words"]
    for own, words in (
        (str(chart()), "no chart"),
        ({"table": "../x"}, "no table"),
        ({"layout": 2, "table": 2}, "no layout"),
    ):
        assert words in server.task(session, "find", {"photo": 1, "chart": own})["error"]["words"]
    assert "no task" in server.task(session, "perform", {})["error"]["words"]
    assert server.ask(f"{ours}/tasks/find", "POST", b"[" * 100_000)[0] == 400
    for task in ("export", "colour", "passport"):
        found = server.task(session, task, {"to": "csv", "key": "", "photos": [1], "photo": 1})
        assert "Calibrate first" in found["error"]["words"]
    (folder,) = server.folders()
    assert [path.name for path in folder.glob("photo-1/*")] == ["_.._a_b__IMG_1.dng"]
    assert folder.stat().st_mode & 0o77 == 0

    huge = tmp_path / "huge.dng"
    with huge.open("wb") as stream:
        stream.truncate(2 << 30)
    with huge.open("rb") as stream:  # of stated length, then in pieces
        for body in (stream, iter(lambda: stream.read(1 << 20), b"")):
            assert server.ask(f"{ours}/files/table", "POST", body)[0] in (413, 0)
            stream.seek(0)
    assert sum(path.stat().st_size for path in folder.iterdir()) < 4 << 20
    assert server.ask(ours, "DELETE")[0] == 204
    assert server.folders() == []
    assert server.ask(f"{ours}/tasks/find", "POST", "{}")[0] == 404


# -- in a browser -------------------------------------------------------------------------------------------------


@pytest.mark.full
def test_from_a_dropped_photo_to_a_report_a_colour_an_export_and_a_passport(server: Server, browser: Browser) -> None:
    browser.drop("#drop", chart())
    browser.wait("document.querySelector('.card')")
    picture(browser, "dropped")
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
    picture(browser, "chart")

    calibrated(browser)
    assert text(browser, "#problem") == ""
    assert text(browser, "#status") == "accepted"
    (folder,) = server.folders()
    document = json.loads((folder / "result" / "result.json").read_text())
    assert document["shots"][0]["pose"]["method"] == "by hand"
    assert document["shots"][0]["lamp"]["name"] == "D55"
    assert abs(document["shots"][0]["pose"]["corners"][0][0] - before[0][0]) < 3  # found again from the moved ones
    end = time.monotonic() + 30
    while not any("report.html" in url for url in frames(browser)):
        assert time.monotonic() < end, frames(browser)
        time.sleep(0.1)
    picture(browser, "result")

    patches = document["shots"][0]["pose"]["patches"][14]  # red
    centre = [sum(corner[i] for corner in patches) / 4 for i in (0, 1)]
    browser.middle(".card image")
    at = f"new DOMPoint({centre[0]}, {centre[1]}).matrixTransform(document.querySelector('.card g').getScreenCTM())"
    browser.click(*browser.js(f"(p => [p.x, p.y])({at})"))
    browser.wait(
        "document.querySelector('.colour').textContent || document.querySelector('.card .problem').textContent"
    )
    lab = [float(value) for value in re.findall(r"[Lab]\* (-?[\d.]+)", text(browser, ".colour"))]
    assert lab == pytest.approx([42, 55, 28], abs=6)  # red of a ColorChecker
    browser.wait("document.querySelector('.spectrum').naturalWidth > 100")
    picture(browser, "colour")

    browser.press("#export")
    browser.wait("document.querySelector('#exported a')")
    url = browser.js("document.querySelector('#exported a').href")
    assert json.loads(server.ask(urlsplit(url).path)[1])["spectral_data"]
    browser.js("document.querySelector('details').open = true")
    browser.press("#make-key")
    browser.wait("document.querySelectorAll('#signed a').length == 2")
    root = browser.do("DOM.getDocument")["root"]["nodeId"]
    key = browser.do("DOM.querySelector", nodeId=root, selector="#key")["nodeId"]
    browser.do("DOM.setFileInputFiles", nodeId=key, files=[str(folder / "result" / "result.json")])
    browser.press("#sign")
    browser.wait("document.querySelector('#export-problem').textContent")
    assert "result.json is not a private key" in text(browser, "#export-problem")
    assert "the button in the page" in text(browser, "#export-problem")
    browser.do("DOM.setFileInputFiles", nodeId=key, files=[str(folder / "passport-key.pem")])
    browser.press("#sign")
    browser.wait("document.querySelectorAll('#signed a').length == 1")
    picture(browser, "passport")
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
    root = browser.do("DOM.getDocument")["root"]["nodeId"]
    chosen = browser.do("DOM.querySelector", nodeId=root, selector="#chart-files")["nodeId"]
    browser.do("DOM.setFileInputFiles", nodeId=chosen, files=[str(tmp_path / "mine.csv")])
    browser.wait("document.querySelector('#chart').value == 'card.json, mine.csv'")
    assert "garden card, 35 patches" in text(browser, "#chart")
    browser.drop("#drop", tmp_path / "chart.dng")
    browser.wait("document.querySelector('.card')")
    assert text(browser, ".card .problem") == ""
    browser.js("document.querySelector('.lamp').value = 'D55'")
    picture(browser, "own-chart")
    calibrated(browser)
    assert text(browser, "#problem") == ""
    (folder,) = server.folders()
    document = json.loads((folder / "result" / "result.json").read_text())
    assert document["verdict"]["status"] == text(browser, "#status") != "refused"
    assert document["chart"]["layout"] == "garden card"
    assert len(document["shots"][0]["patches"]) == len(table.patches)
    assert str(folder) not in json.dumps(document)
    picture(browser, "own-chart-result")


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
    picture(browser, "bad-files")

    browser.press("#calibrate")
    browser.wait("!document.querySelector('#progress').hidden")
    time.sleep(1)
    browser.press("#cancel")
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

    browser.press("#calibrate")  # a camera, and no lamp was chosen
    browser.wait("!document.querySelector('#result').hidden || document.querySelector('#problem').textContent")
    assert (text(browser, "#problem"), text(browser, "#status")) == ("", "refused")
    assert text(browser, "#reasons") != ""
    assert browser.js("document.querySelector('#curves').hidden")
    picture(browser, "refused")


@pytest.mark.full
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_no_serious_fault_in_the_app(browser: Browser, scheme: str) -> None:
    path = os.environ.get("CAMSSF_AXE", "")
    if not Path(path).is_file():
        pytest.skip("no axe-core on this machine (CAMSSF_AXE names no file): accessibility is not judged by axe")
    browser.do("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
    browser.drop("#drop", chart())
    browser.wait("document.querySelector('.card')")
    browser.js("for (const each of document.querySelectorAll('[hidden]')) each.hidden = false")
    browser.js("document.querySelector('details').open = true")
    browser.js("for (const each of document.querySelectorAll('.problem')) each.textContent = 'A problem.'")
    browser.js(Path(path).read_text("utf-8") + "; 0")
    judge = "axe.run(document, {resultTypes: ['violations'], iframes: false}).then(r => r.violations.map(v => %s))"
    faults = browser.js(judge % "[v.id, v.impact, v.nodes.map(n => n.html.slice(0, 90))]")
    picture(browser, f"axe-{scheme}")
    assert [each for each in faults if each[1] in ("serious", "critical")] == []
    browser.js("document.querySelector('#drop').replaceWith(document.querySelector('#files'))")  # it can find one
    assert "label" in [each[0] for each in browser.js(judge % "[v.id]")]
