"""A browser without a window, driven by the DevTools protocol over a pipe; needs no library."""

import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = (
    "headless no-sandbox disable-gpu disable-quic no-first-run disable-background-networking disable-sync "
    "disable-component-update hide-scrollbars remote-debugging-pipe window-size=1280,1000"
)
BEGIN = """
import fcntl, os, sys
pipes = [fcntl.fcntl(int(each), fcntl.F_DUPFD, 10) for each in sys.argv[1:3]]
for number, pipe in enumerate(pipes, 3):
    os.dup2(pipe, number)
os.execv(sys.argv[3], sys.argv[3:])
"""
"""Becomes the browser, which reads its pipe as 3 and writes it as 4."""


class Browser:
    """One tab at a time; `open` makes another and moves to it."""

    def __init__(self, profile: Path) -> None:
        found = next(filter(None, map(shutil.which, NAMES)), None)
        if found is None or os.name != "posix":
            pytest.skip("no Chromium on this machine: the page is not checked in a browser")
        (theirs, self._to), (self._from, back) = os.pipe(), os.pipe()
        words = [found, *(f"--{flag}" for flag in FLAGS.split()), f"--user-data-dir={profile}"]
        with open(f"{profile}.log", "wb") as log:
            words = [sys.executable, "-c", BEGIN, str(theirs), str(back), *words]
            self._process = subprocess.Popen(words, pass_fds=(theirs, back), stderr=log)
        os.close(theirs), os.close(back)
        self._rest, self._last, self.session, self.events = b"", 0, "", list[dict[str, Any]]()

    def close(self) -> None:
        os.close(self._to)  # the browser ends with its pipe
        self._process.wait(30)
        os.close(self._from)

    def do(self, method: str, **parameters: Any) -> dict[str, Any]:
        """The result of a command; events that come before it are kept in `events`."""
        self._last += 1
        order: dict[str, Any] = {"id": self._last, "method": method, "params": parameters}
        if self.session and not method.startswith(("Target.", "Browser.")):
            order["sessionId"] = self.session
        os.write(self._to, json.dumps(order).encode() + b"\0")
        while True:
            while b"\0" not in self._rest:
                part = os.read(self._from, 1 << 20)
                assert part, "the browser is gone"
                self._rest += part
            line, _, self._rest = self._rest.partition(b"\0")
            message = json.loads(line)
            if message.get("id") == self._last:
                assert "error" not in message, (method, message["error"])
                return dict(message["result"])
            if message.get("method") == "Page.javascriptDialogOpening":  # "Leave the page?": yes
                yes = {"id": 0, "method": "Page.handleJavaScriptDialog", "params": {"accept": True}}
                os.write(self._to, json.dumps(yes | {"sessionId": message["sessionId"]}).encode() + b"\0")
            if "method" in message:
                self.events.append(message)

    def open(self, address: str) -> str:
        """A new tab; returns its target, for `Target.closeTarget`."""
        target = str(self.do("Target.createTarget", url="about:blank")["targetId"])
        self.session = self.do("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "DOM", "Log", "Network"):
            self.do(f"{domain}.enable")
        self.do("Page.navigate", url=address)
        self.wait("location.href != 'about:blank' && document.readyState == 'complete'")
        return target

    def js(self, expression: str) -> Any:
        found = self.do("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def wait(self, expression: str, seconds: float = 90.0) -> None:
        """Wait until the expression is true."""
        end = time.monotonic() + seconds
        while not self.js(f"!!({expression})"):
            assert time.monotonic() < end, f"{expression} within {seconds:g} s; the page: {self.js(PAGE)}"
            time.sleep(0.1)

    def middle(self, selector: str) -> tuple[float, float]:
        """Where an element is in the window, once scrolled into view."""
        element = f"document.querySelector({json.dumps(selector)})"
        self.js(f"{element}.scrollIntoView({{block: 'center', behavior: 'instant'}})")
        x, y, w, h = self.js(f"(r => [r.x, r.y, r.width, r.height])({element}.getBoundingClientRect())")
        return x + w / 2, y + h / 2

    def mouse(self, kind: str, x: float, y: float) -> None:
        self.do(
            "Input.dispatchMouseEvent",
            type=f"mouse{kind}", x=x, y=y, button="left", buttons=int(kind != "Released"), clickCount=1,
        )  # fmt: skip

    def click(self, x: float, y: float) -> None:
        self.mouse("Pressed", x, y)
        self.mouse("Released", x, y)

    def press(self, selector: str) -> None:
        self.click(*self.middle(selector))

    def key(self, name: str, shift: bool = False) -> None:
        for kind in ("keyDown", "keyUp"):
            self.do("Input.dispatchKeyEvent", type=kind, key=name, code=name, modifiers=8 if shift else 0)

    def drop(self, selector: str, *files: Path) -> None:
        """Drop files from the desktop."""
        x, y = self.middle(selector)
        data = {"items": [], "files": [str(file) for file in files], "dragOperationsMask": 1}
        for kind in ("dragEnter", "dragOver", "drop"):
            self.do("Input.dispatchDragEvent", type=kind, x=x, y=y, data=data)

    def choose(self, selector: str, file: Path) -> None:
        """Choose a file in a dialogue."""
        root = self.do("DOM.getDocument")["root"]["nodeId"]
        field = self.do("DOM.querySelector", nodeId=root, selector=selector)["nodeId"]
        self.do("DOM.setFileInputFiles", nodeId=field, files=[str(file)])


PAGE = "document.body.innerText.slice(0, 2000)"
