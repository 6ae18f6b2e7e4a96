"""Kotlin's guide: its page says the limits that its code has. No JVM starts."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
KOTLIN = ROOT / "android-bindings" / "finder" / "src" / "main" / "kotlin" / "org" / "camssf" / "guide"
ROWS = {
    "CUT": ["MARGIN"], "TOO_FAR": ["SIZE"], "TILTED": ["TILT"], "MOVING": ["SPEED"], "TOO_DARK": ["DARK"],
    "TOO_BRIGHT": ["CLIPPED", "BRIGHT"], "OUT_OF_FOCUS": ["BLUR_PIXELS", "BLUR_PITCHES"], "SHADOW": ["SHADOW"],
    "UNEVEN": ["GRADIENT"], "TINTED": ["TINT"],
}  # fmt: skip

pytestmark = pytest.mark.repository


def numbers(text: str) -> list[float]:
    """In a cell of the page, shares for percent."""
    return [float(n) / (100 if percent else 1) for n, percent in re.findall(r"(\d+(?:\.\d+)?)( %)?", text)]


def test_the_page_says_the_code_s_limits() -> None:
    code = (KOTLIN / "Limits.kt").read_text("utf-8")
    found = {name: float(begin) for name, begin in re.findall(r"val (\w+) = Limit\(([\d.]+), [\d.]+", code)}
    page = (ROOT / "docs" / "guide.md").read_text("utf-8")
    rows = {
        cells[1].strip(" `"): cells for cells in (line.split("|") for line in page.splitlines()) if len(cells) > 5
    }
    for advice, names in ROWS.items():
        assert numbers(rows[advice][3]) == [found[name] for name in names], advice


def test_the_page_names_every_advice() -> None:
    code = (KOTLIN / "Advice.kt").read_text("utf-8")
    names = re.findall(r"^    ([A-Z_]+)\(\"", code, re.MULTILINE)
    page = (ROOT / "docs" / "guide.md").read_text("utf-8")
    assert len(names) == 16
    assert all(f"`{name}`" in page for name in names)
