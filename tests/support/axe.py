"""What axe-core (MPL 2.0, which only judges) finds in the page that a browser shows."""

import os
from pathlib import Path
from typing import Any

import pytest

from tests.support.browser import Browser

AXE = "4.14.1"
"""CAMSSF_AXE says where its axe.min.js lies; .ci/run gets it."""
JUDGE = """
axe.run(document, {resultTypes: ["violations"], iframes: false}).then(judged => [
  axe.version, matchMedia("(prefers-color-scheme: dark)").matches, judged.passes.length,
  judged.violations.map(v => [v.id, v.impact, v.nodes.map(n => n.html.slice(0, 90)).slice(0, 3)])
])"""


def serious_faults(browser: Browser, scheme: str = "light") -> list[Any]:
    """Identifier, impact and places of each serious or critical fault."""
    axe = Path(os.environ.get("CAMSSF_AXE", ""))
    if not axe.is_file():
        pytest.skip("no axe-core on this machine (CAMSSF_AXE names no file): accessibility is not judged by axe")
    browser.do("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
    browser.js(f"{axe.read_text('utf-8')}; 0")
    version, dark, passes, found = browser.js(JUDGE)
    assert (version, dark) == (AXE, scheme == "dark")
    assert passes > 10
    return [fault for fault in found if fault[1] in ("serious", "critical")]
