"""Whole pages in a browser without a window: what it prints of them, and what axe-core finds in them."""

import html
import json
import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from tests.support.browser import NAMES

AXE = "4.14.1"
"""Of axe-core (MPL 2.0), which only judges: CAMSSF_AXE says where its axe.min.js lies; .ci/run gets it."""
FLAGS = (
    "headless no-sandbox disable-gpu disable-quic no-first-run disable-background-networking "
    "disable-component-update disable-sync enable-logging=stderr v=0"
)
JUDGE = """
addEventListener("load", () => setTimeout(async () => {
  const judged = await axe.run(document, {resultTypes: ["violations"]});
  const dark = matchMedia("(prefers-color-scheme: dark)").matches;
  const faults = judged.violations.map(v => [v.id, v.impact, v.nodes.map(n => n.html.slice(0, 90)).slice(0, 3)]);
  document.getElementById("told").textContent = JSON.stringify([axe.version, dark, judged.passes.length, faults]);
}, 500));"""


def chromium(page: Path, profile: Path, *flags: str) -> tuple[str, str]:
    """What a browser prints of a page: its stdout, and its log."""
    browser = next(filter(None, map(shutil.which, NAMES)), None)
    if browser is None:
        pytest.skip("no Chromium on this machine: the page is not checked in a browser")
    words = [*(f"--{flag}" for flag in (*FLAGS.split(), *flags)), f"--user-data-dir={profile}", page.as_uri()]
    run = subprocess.run([browser, *words], capture_output=True, text=True, check=True, timeout=180)
    return run.stdout, run.stderr


def browse(page: Path, profile: Path, *flags: str) -> tuple[str, list[str]]:
    """The page's DOM after loading and what it wrote to the console."""
    dom, log = chromium(page, profile, "virtual-time-budget=10000", "dump-dom", *flags)
    return dom, [line for line in log.splitlines() if "CONSOLE" in line]


def told(dom: str) -> Any:
    """What a script left in the element `told`."""
    left = re.search(r'<pre id="told"[^>]*>(.*?)</pre>', dom)
    assert left is not None
    return json.loads(html.unescape(left[1]))


def serious_faults(text: str, copy: Path, profile: Path, scheme: str) -> list[Any]:
    """What axe finds in a page, in a copy of it that holds the judge."""
    axe = Path(os.environ.get("CAMSSF_AXE", ""))
    if not axe.is_file():
        pytest.skip("no axe-core on this machine (CAMSSF_AXE names no file): accessibility is not judged by axe")
    end = f'<pre id="told" hidden></pre><script>{axe.read_text("utf-8")}</script><script>{JUDGE}</script></body>'
    copy.write_text(text.replace("</body>", end), "utf-8")
    dom, _ = browse(copy, profile, f"blink-settings=preferredColorScheme={0 if scheme == 'dark' else 1}")
    version, dark, passes, faults = told(dom)
    assert (version, dark) == (AXE, scheme == "dark")
    assert passes > 10
    return [fault for fault in faults if fault[1] in ("serious", "critical")]
