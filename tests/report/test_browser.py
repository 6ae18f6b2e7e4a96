"""The pages in a browser: widths, paper, what axe finds; and text that would be code stays text."""

import html
import re
from collections import Counter
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camssf.documents import forms
from camssf.documents.document import ADVICE, Document, read_document
from camssf.photo.read.unit import Unit
from camssf.report.build import report
from camssf.report.provenance import Provenance, Signature
from camssf.result import Result
from camssf_fleet.drift import LastChange
from camssf_fleet.page import FleetDrift, FleetModel, FleetUnit, NotAccepted, fleet_html
from tests.report.conftest import TAGS, Page, html_of
from tests.support.axe import serious_faults
from tests.support.browser import Browser
from tests.support.documents import changed, document, known, preview, refused, unnamed, unplaced

HOSTILE = (
    "<script>alert(1)</script>\"'>&$\\frac{<img src=x onerror=alert(2)>]]>--> \x00\x1b\u202e漢\U0001f4f7\ud800 ${x}"
)


def hostile(made: Document, words: str) -> Result:
    """The result with every free text replaced."""
    kept = {"format", "kind", "engine", "method", "status", "beyond", "sha256", "layout", "lens_shading"}

    def spoilt(value: Any) -> Any:
        if isinstance(value, dict):
            names = kept | ({"model"} if "basis" in value else set())
            return {key: entry if key in names else spoilt(entry) for key, entry in value.items()}
        if isinstance(value, list):
            return [spoilt(entry) for entry in value]
        return words if isinstance(value, str) else value

    return forms.from_plain(spoilt(forms.to_plain(made)), Result, "", ADVICE)


SPOKEN = ("Runtime.consoleAPICalled", "Runtime.exceptionThrown", "Log.entryAdded")
"""Events of what a page writes to the console."""
WIDTHS = (360, 1280)
SHEET, SHEET_HEIGHT = 703, 1039
"""CSS pixels between the margins of an A4 sheet, 186 mm x 275 mm."""
MEASURE = Path(__file__).with_name("measure.js").read_text("utf-8")


def on_paper(page: str) -> str:
    """The page as its rules for paper make it, to be measured on a screen."""
    assert "@media print" in page
    return page.replace("@media print", "@media all").replace("@media screen", "@media speech")


def opened(page: str) -> str:
    return page.replace("<details>", "<details open>")


@cache
def shown() -> dict[str, str]:
    """Pages of all kinds: one shot and two, signed and compared, refused with and without a photo, long names."""
    return {
        "one shot": html_of(document(), [preview()], provenance=known(document())),
        "two shots": html_of(document("D55", "A"), [preview(), None]), "refused": html_of(refused()),
        "an unnamed light": html_of(unnamed(), [preview()]),
        "refused, with its photo": html_of(unplaced(), [preview()]),
        "refused, measured": html_of(refused(shots=True), [preview()]), "a fleet": fleet(),
        "long names": html_of(hostile(document(), "A_name_without_a_gap_" * 20), [preview()]),
    }  # fmt: skip


def fleet() -> str:
    """The page of a fleet that has all of its tables."""
    at, names = datetime(2026, 11, 1, tzinfo=UTC), ("Google Pixel 9 Pro", "NIKON D850", "Apple iPhone 17")
    drift = FleetDrift("green centre", -4.2, "trend", 12, 700.0)
    change = LastChange("green centre", -4.2, 1.4, warns=True)
    last = [at - timedelta(days=200 * i) for i in range(3)]
    units = (
        *(FleetUnit(f"S{i} 2", time, at, "accepted", 0, 4, (drift,) * (i == 1)) for i, time in enumerate(last)),
        FleetUnit("SERIAL3 2", None, at, "refused"), FleetUnit("SERIAL4", at, at, "accepted", timed=2, change=change),
    )  # fmt: skip
    spread = np.array([[0.012, 0.02, 0.011], [0.008, 0.015, 0.0], [0.03, 0.04, 0.05]])
    statuses = Counter(accepted=120, doubtful=7, refused=12)
    models = [FleetModel(name, statuses, units, spread) for name in names]
    reasons = [("chart_not_found", 0, 12), ("of_a_later_release", 7, 0)]
    captures = [NotAccepted("Google Pixel 9 Pro SERIAL3 2", "a.dng, b.dng", "refused", "blurred", "It is blurred.")]
    return fleet_html(models, reasons, (captures, 3), days=365.0, now=at, false_alarms=0.01)


@pytest.mark.full
def test_the_page_at_every_width_and_on_paper(browser: Browser, tmp_path: Path) -> None:
    """No sideways scrolling, no broken word, no text beyond its box or over another, nothing on the console."""
    pages = {(name, width): opened(page) for name, page in shown().items() for width in WIDTHS}
    pages |= {(f"{name}, on paper", SHEET): on_paper(page) for name, page in shown().items()}
    frames = "".join(
        f'<iframe title="{name}" style="border:0;width:{width}px;height:900px" srcdoc="{html.escape(page)}"></iframe>'
        for (name, width), page in pages.items()
    )
    harness = tmp_path / "harness.html"
    harness.write_text(f"<!DOCTYPE html><meta charset=utf-8><title>widths</title>{frames}", "utf-8")
    browser.open(harness.as_uri())
    measured = {(name, width): rest for name, width, *rest in browser.js(f"({MEASURE})()")}
    ours = [event for event in browser.events if event.get("sessionId") == browser.session]
    assert not [event for event in ours if event["method"] in SPOKEN]
    assert set(measured) == set(pages)
    for (name, width), (wide, height, broken, out, certificate_ends) in measured.items():
        assert wide <= width, f"{name} at {width} px is {wide} px wide"
        assert not broken, f"{name} at {width} px breaks {broken}"
        assert not out or name.startswith("long names"), f"{name} at {width} px: {out}"
        assert name.startswith(("refused", "a fleet")) or height > 1500
        if name in ("one shot, on paper", "two shots, on paper", "an unnamed light, on paper"):
            assert 700 < certificate_ends < SHEET_HEIGHT, (name, certificate_ends)


@pytest.mark.full
@pytest.mark.parametrize(("name", "scheme"), [
    ("one shot", "light"), ("two shots", "light"), ("an unnamed light", "light"),
    ("refused, with its photo", "light"), ("a fleet", "light"), ("two shots", "dark"),
])  # fmt: skip
def test_axe_finds_no_serious_fault(name: str, scheme: str, browser: Browser, tmp_path: Path) -> None:
    (tmp_path / "page.html").write_text(opened(shown()[name]), "utf-8")
    browser.open((tmp_path / "page.html").as_uri())
    assert serious_faults(browser, scheme) == []


def test_hostile_text_stays_text(tmp_path: Path) -> None:
    """Also what stands beside the document: names of units, passports and files are not ours."""
    made = changed(hostile(document("D55", "A"), HOSTILE), capture__files={HOSTILE: "0" * 64})
    result = report(made, [preview()])
    signature = known(document()).signature
    spoilt = replace(signature.passport, unit=Unit(*[HOSTILE] * 5), captured=HOSTILE, chart_serial=HOSTILE)
    signed = html_of(document(), provenance=Provenance(signature=Signature(spoilt, HOSTILE, False)))
    shown = re.sub("[\x00\x1b\u202e\ud800]", "\ufffd", HOSTILE)
    for text, times in ((result.html, 30), (signed, 3)):
        page = Page(text)
        assert page.open == []
        assert {tag for tag, _ in page.tags} <= TAGS
        assert not [key for _, attributes in page.tags for key in attributes if key.startswith("on")]
        assert page.text.count(shown) >= times
        assert not re.search("[\x00\x1b\u202e\ud800]", text)
    result.save(tmp_path)
    again = read_document(tmp_path / "result.json", Result).capture
    assert again.shots[0].photo.make == HOSTILE.replace("\ud800", "\ufffd")
