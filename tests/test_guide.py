"""Kotlin's guide: its page says the limits that its code has, and its benchmark judges rightly. No JVM starts."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from benchmarks.claims import guide
from camssf.simulation.scene import Scene, project
from camssf.spectra import read_chart
from camssf.spectra.layouts import LAYOUTS

ROOT = Path(__file__).parents[1]
KOTLIN = ROOT / "android-bindings" / "finder" / "src" / "main" / "kotlin" / "org" / "camssf" / "guide"
ROWS = {
    "CUT": ["MARGIN"], "TOO_FAR": ["SIZE"], "TILTED": ["TILT"], "MOVING": ["SPEED"], "TOO_DARK": ["DARK"],
    "TOO_BRIGHT": ["CLIPPED", "BRIGHT"], "OUT_OF_FOCUS": ["BLUR_PIXELS", "BLUR_PITCHES"], "SHADOW": ["SHADOW"],
    "UNEVEN": ["GRADIENT"], "TINTED": ["TINT"],
}  # fmt: skip


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
    assert {sequence.wanted for sequence in guide.sequences()} <= set(names)


def test_frames_are_full_range_planes() -> None:
    grey = np.full((4, 6, 3), 77, dtype=np.float32)
    assert guide.yuv(grey) == bytes([77] * 24 + [128] * 12)
    red = np.zeros((2, 2, 3), dtype=np.float32)
    red[..., 0] = 255
    assert list(guide.yuv(red)) == [76] * 4 + [85, 255]


def test_the_chart_moves_with_its_corners(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guide, "SIZE", (96, 72))
    monkeypatch.setattr(guide, "FRAMES", 4)
    guide.noise.cache_clear()
    still = guide.Sequence("none", "NOW", Scene(size=(96, 72), fill=0.5))
    fast = guide.Sequence("moving", "MOVING", Scene(size=(96, 72), fill=0.5), speed=5)
    table = read_chart("classic24")
    (frame, corners), *_, (_, last) = guide.frames(fast, table)
    assert last[0, 0] - corners[0, 0] == pytest.approx(15, abs=2)
    (other, calm), *_ = guide.frames(still, table)
    guide.noise.cache_clear()
    shift = np.rint(corners[0] - calm[0]).astype(int)
    planes = [np.frombuffer(each[: 96 * 72], np.uint8).reshape(72, 96).astype(float) for each in (frame, other)]
    back = np.roll(planes[0], tuple(-shift[::-1]), axis=(0, 1))
    assert np.abs(back - planes[1])[10:60, 25:70].mean() < 4  # noise alone
    assert np.abs(planes[0] - planes[1])[10:60, 25:70].mean() > 8


def test_shades_do_what_they_say() -> None:
    scene = Scene(size=(64, 48), fill=0.6)
    view = project(scene, np.ones((24, 3)), np.ones(3), "RGGB")
    u, v = view.u.astype(float), view.v.astype(float)
    light = np.ones((48, 64, 3))
    assert guide.shadow(0, 0.0, 0.4, 0.05)(light, u, v).min() == pytest.approx(0.4)
    assert guide.shadow(0, 0.0, 0.4, 0.05)(light, u, v).max() == pytest.approx(1.0)
    sloped = guide.slope(0, 1.0)(light, u, v)[24, :, 0]
    half = (LAYOUTS["classic24"].columns - 1 + 0.88) / 2
    ends = [sloped[np.argmin(np.abs(u[24] - place))] for place in (2.5 - half, 2.5 + half)]
    assert np.log2(ends[0] / ends[1]) == pytest.approx(1.0, abs=0.1)
    spotted = guide.spot(2.5, 1.5, 0.5, 0.3)(light, u, v)
    assert spotted.max() == pytest.approx(1.3, abs=0.01)
    walled = guide.wall((0.6, 0.1, 0.1), 0.5)(light, u, v)
    assert walled[0, 0].tolist() == [0.6, 0.1, 0.1]
    assert walled[0, 63].tolist() == walled[24, 32].tolist() == [1, 1, 1]


def test_a_wrong_answer_is_called_wrong() -> None:
    asked = guide.Sequence("tilt of 40°", "TILTED", Scene(), number=(40, 4.0))

    def said(*words: str, amount: float = 41.0) -> list[dict[str, object]]:
        return [{"advice": word, "amount": amount, "milliseconds": 1.0, "bytes": 2} for word in words]

    good = guide.judged(asked, said("NO_CHART", "TILTED", "TILTED"))
    assert (good["right"], good["number_right"], good["changes"]) == (True, True, 1)
    assert guide.judged(asked, said("TILTED", amount=50.0))["number_right"] is False
    wrong = guide.judged(asked, said("TILTED", "NOW"))
    assert (wrong["right"], wrong["number_right"]) == (False, None)
