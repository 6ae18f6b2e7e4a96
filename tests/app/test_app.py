"""The page in a real browser: from a dropped photo to a report, a colour, an export and a passport."""

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from camssf.cli import main
from camssf.result import Result
from tests.spectra.test_layouts import photographed, write_card
from tests.support.axe import serious_faults
from tests.support.browser import Browser
from tests.support.captures import photos
from tests.support.processes import until

pytestmark = pytest.mark.full
EVENTS = ("Runtime.exceptionThrown", "Log.entryAdded", "Network.requestWillBeSent")


class Server:
    """`camssf app` in a process of its own, whose temporary folder is watched."""

    def __init__(self, temporary: Path) -> None:
        self.temporary, self.home = temporary, temporary.with_name("home")
        self.home.mkdir()
        words = [sys.executable, "-m", "camssf", "app", "--no-browser"]
        environment = os.environ | {"TMPDIR": str(temporary), "HOME": str(self.home)}
        self.process = subprocess.Popen(words, stderr=subprocess.PIPE, text=True, env=environment)
        self.address = re.findall(r"http://\S+", self.process.stderr.readline())[0]

    def folders(self) -> list[Path]:
        return list(self.temporary.glob("camssf-*/*"))


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    running = Server(tmp_path_factory.mktemp("temporary"))
    yield running
    running.process.send_signal(signal.SIGINT)
    output = running.process.communicate(timeout=30)[1]
    assert "ERROR" not in output, output
    assert [*running.temporary.iterdir(), *running.home.rglob("*")] == []


@pytest.fixture
def browser(server: Server, tmp_path: Path) -> Iterator[Browser]:
    """One for each test: a tab behind another one asks nothing before it is left."""
    running = Browser(tmp_path / "profile")
    with closing(running):
        open_page(running, server)
        yield running
        running.do("Page.navigate", url="about:blank")  # leaves the page: its files go
        running.wait("location.href === 'about:blank'")  # its question is answered while something is asked of it
        until(lambda: server.folders() == [], 60.0)
    events = {name: [event["params"] for event in running.events if event["method"] == name] for name in EVENTS}
    thrown, logged, sent = events.values()
    assert thrown == []
    assert [event["entry"]["text"] for event in logged if event["entry"]["level"] == "error"] == []
    urls = [event["request"]["url"] for event in sent]
    assert [url for url in urls if not url.startswith((server.address, "data:", "about:"))] == []


def open_page(browser: Browser, server: Server) -> str:
    target = browser.open(server.address)
    browser.wait("document.documentElement?.dataset.ready")
    return target


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


def corners(browser: Browser) -> list[list[float]]:
    points = browser.js("document.querySelector('.outline').getAttribute('points')")
    return [[float(number) for number in point.split(",")] for point in points.split()]


def shows_report(browser: Browser) -> bool:
    """In a frame, which loads after the page."""
    targets = browser.do("Target.getTargets")["targetInfos"]
    return any(target["type"] == "iframe" and "report.html" in target["url"] for target in targets)


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
    assert (moved[0][0] > before[0][0] + 5, moved[0][1] < before[0][1], moved[1:]) == (True, True, before[1:])
    x, y = browser.middle(".handle.corner:nth-of-type(3)")  # ... and by hand: the bottom right one
    for kind, by in (("Pressed", 0), ("Moved", 7), ("Released", 7)):
        browser.mouse(kind, x - by, y - by)
    dragged = corners(browser)
    assert [a == b for a, b in zip(dragged, moved, strict=True)] == [True, True, False, True]

    assert calibrated(browser) == ("", "accepted")
    (folder,) = server.folders()
    (shot,) = Result.load(folder / "result" / "result.json").capture.shots
    assert (shot.pose.method, shot.lamp.name) == ("by hand", "D55")
    assert abs(shot.pose.corners[0][0] - before[0][0]) < 3  # found again from the moved ones
    until(lambda: shows_report(browser), 30.0)

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
    exported = "fetch(document.querySelector('#exported a').href).then(answer => answer.json())"
    assert browser.js(exported)["spectral_data"]
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
    result, key = folder / "result" / "result.json", folder / "passport-key.pub.pem"
    assert main(["passport", "verify", f"{folder / 'camera.jws'}", "--key", f"{key}", "--result", f"{result}"]) == 0
    assert not (folder / ".signing-key.pem").exists()


def test_a_chart_of_the_users_own(server: Server, browser: Browser, tmp_path: Path) -> None:
    write_card(tmp_path)
    table, _ = photographed(tmp_path, f"{tmp_path / 'card.json'}:{tmp_path / 'mine.csv'}")
    (tmp_path / "note.csv").write_text("no table")
    for files, problem in (
        (["mine.csv"], "mine.csv holds 35 patches."),  # without the layout
        (["card.json", "note.csv"], "note.csv is not a table of reflectances"),
        (["card.json"], "card.json is the layout of a chart. Now add the table"),
    ):
        browser.js("document.querySelector('#upload-problem').textContent = ''")
        browser.drop("#drop", *(tmp_path / name for name in files))
        browser.wait("document.querySelector('#upload-problem').textContent")
        assert problem in text(browser, "#upload-problem")
    browser.choose("#chart-files", tmp_path / "mine.csv")
    browser.wait("document.querySelector('#chart').value == 'card.json, mine.csv'")
    assert "garden card, 35 patches" in text(browser, "#chart")
    dropped(browser, tmp_path / "chart.dng")
    assert text(browser, ".card .problem") == ""
    browser.js("document.querySelector('.lamp').value = 'D55'")
    assert calibrated(browser)[0] == ""
    (folder,) = server.folders()
    result = Result.load(folder / "result" / "result.json")
    assert result.verdict.status == text(browser, "#status") != "refused"
    assert (result.capture.chart.layout.name, result.capture.chart.patches) == ("garden card", table.patches)
    assert str(folder) not in (folder / "result" / "result.json").read_text("utf-8")


def test_files_that_are_added_before_the_page_is_ready_are_kept(browser: Browser) -> None:
    def paused(pattern: str) -> None:
        browser.events.clear()
        browser.do("Fetch.enable", patterns=[{"urlPattern": pattern}])
        browser.js("document.documentElement.dataset.old = 'yes'")
        browser.do("Page.reload")
        browser.wait("document.querySelector('#files') && !document.documentElement.dataset.old")

    def go_on() -> None:
        browser.wait("1")
        for event in [event for event in browser.events if event["method"] == "Fetch.requestPaused"]:
            browser.do("Fetch.continueRequest", requestId=event["params"]["requestId"])
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


def test_bad_files_cancelling_a_refusal_and_a_second_tab(server: Server, browser: Browser, tmp_path: Path) -> None:
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
    browser.do("Page.bringToFront")
    until(lambda: server.folders() == [first], 60.0)

    assert calibrated(browser) == ("", "refused")  # a camera, and no lamp was chosen
    assert text(browser, "#reasons") != ""
    assert browser.js("document.querySelector('#curves').hidden")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_no_serious_fault_in_the_app(browser: Browser, scheme: str) -> None:
    dropped(browser, chart())
    browser.js("for (const each of document.querySelectorAll('[hidden]')) each.hidden = false")
    browser.js("document.querySelector('details').open = true")
    browser.js("for (const each of document.querySelectorAll('.problem')) each.textContent = 'A problem.'")
    assert serious_faults(browser, scheme) == []
