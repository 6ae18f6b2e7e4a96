"""The fleet's page: what it counts is what the registry holds, and no name breaks it."""

from datetime import timedelta
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from registries import START, bells, made

from camssf import cli
from camssf.errors import InvalidArgument
from camssf.grid import CHANNELS
from camssf.photo.read.unit import Unit

pytest.importorskip("duckdb", reason="duckdb is not here")
pytest.importorskip("deltalake", reason="deltalake is not here")

from camssf_fleet.compare import spread
from camssf_fleet.overview import fleet_page
from camssf_fleet.page import MOST_ROWS
from camssf_fleet.registry import Registry

NOW = START + timedelta(days=400)


class Tables(HTMLParser):
    """The rows of a page's tables by their captions."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.rows: dict[str, list[list[str]]] = {}
        self._caption, self._in = "", ""
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._in = tag if tag in ("caption", "th", "td") else self._in
        if tag == "caption":
            self._caption = ""
        if tag == "tr":
            self.rows.setdefault(self._caption, []).append([])
        if tag in ("th", "td"):
            self.rows[self._caption][-1].append("")

    def handle_data(self, data: str) -> None:
        if self._in == "caption":
            self._caption += data
        elif self._in in ("th", "td"):
            self.rows[self._caption][-1][-1] += data

    def handle_endtag(self, tag: str) -> None:
        self._in = "" if tag in ("caption", "th", "td") else self._in


@pytest.fixture
def phones(tmp_path: Path) -> Registry:
    """Four units of one model, of which the first drifts, and one unit of another, last calibrated long ago."""
    one, rng, rows = Registry(tmp_path / "phones", new=True), np.random.default_rng(4), []
    for number in range(24):
        unit, month = number % 4, number // 4
        shift = rng.normal(size=3) * 0.1 + unit + (month if unit == 0 else 0)
        rows.append(made(number, bells(shift), serial=f"S{unit}", captured=START + timedelta(days=60 * month)))
    rows += [made(30, bells(), model="Old", serial="O1", captured=START - timedelta(days=9))]
    rows += [made(40 + i, status="refused", code="overexposed", serial="S9", captured=NOW) for i in range(3)]
    rows += [made(50, bells(), status="doubtful", code="of_a_later_release", serial="", captured=NOW)]
    one.add(rows)
    return one


def test_what_the_page_counts(phones: Registry) -> None:
    tables = Tables(fleet_page(phones, days=365.0, now=NOW)).rows
    (models,) = (rows for caption, rows in tables.items() if caption.startswith("Units with a serial"))
    assert models == [
        ["", "Units", "Accepted", "Doubtful", "Refused"], ["Maker Model", "5", "24", "1", "3"],
        ["Maker Old", "1", "1", "0", "0"],
    ]  # fmt: skip
    assert [row[:3] for row in tables["Units that are due"][1:]] == [
        ["S9", "Maker Model", "none with a time"], ["O1", "Maker Old", "2025-12-23"],
    ]  # fmt: skip
    drifts = tables["Features that drift"][1:]
    assert {(row[0], row[1], row[4]) for row in drifts} == {("S0", "Maker Model", "6 in 300 days")}
    assert {row[2] for row in drifts} == {f"{colour} centre" for colour in CHANNELS}
    assert all(float(row[3].removesuffix(" nm, trend")) == pytest.approx(5, abs=1) for row in drifts)
    (_, later, over) = sorted(tables["Results by the first reason of their verdict"], key=lambda row: row[0])
    assert (later[:3], over[:3]) == (["of_a_later_release", "1", "0"], ["overexposed", "0", "3"])
    assert over[3].startswith("Expose less")


def test_what_cannot_be_tested_is_not_called_without_drift(phones: Registry, tmp_path: Path) -> None:
    """Units with too few results are counted by their results; none of them is said not to drift."""
    page = fleet_page(phones, now=NOW)
    assert '<span class="number">1</span><span>of 4 tested units drift</span>' in page
    assert "Not testable: 1 unit has no calibration with a time, 1 unit has one calibration. A test needs 4" in page
    assert "Tested: 4 units;" in page
    young = Registry(tmp_path / "young", new=True)
    young.add([made(i, bells(), serial=f"S{i}", captured=START) for i in range(1200)])
    young.add([made(2000 + i, bells(), serial="S0", captured=START + timedelta(days=i)) for i in range(1, 3)])
    page = fleet_page(young, now=NOW)
    assert '<span class="number">not testable</span>' in page
    assert "Not testable: 1,199 units have one calibration, 1 unit has 3 calibrations. A test needs 4, each" in page
    assert "units that drift" not in page
    assert "Tested" not in page


def test_the_spread_is_that_of_compare(phones: Registry) -> None:
    found = spread(phones, Unit(make="Maker", model="Model"))
    assert found.between is not None
    tables = Tables(fleet_page(phones, now=NOW)).rows
    (_, row) = tables["Spread of each model and channel, as a fraction of the peak"]
    assert row[0] == "Maker Model"
    for cell, values in zip(row[1:], zip(found.between, found.low, found.high, strict=True), strict=True):
        numbers = cell.replace("(", "").replace(")", "").replace("to", "").split()
        assert [float(number) for number in numbers] == pytest.approx(values, rel=0.05)


def test_rows_beyond_the_most_are_counted_and_names_are_escaped(tmp_path: Path) -> None:
    one = Registry(tmp_path / "r", new=True)
    one.add([made(i, bells(), model=f"<b>{i}</b>", serial=f"&{i}") for i in range(MOST_ROWS + 7)])
    page = fleet_page(one, now=NOW)
    assert "<b>" not in page
    assert "&lt;b&gt;" in page
    assert page.count("And 7 more.") == 2  # models, and units that are due: their results have no time
    assert len(Tables(page).rows["Units that are due"]) == 1 + MOST_ROWS


def test_the_command(phones: Registry, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "fleet.html"
    assert cli.main(["registry", "report", str(phones.folder), "-o", str(out), "--days", "30"]) == 0
    assert out.read_text("utf-8").startswith("<!DOCTYPE html>")
    assert "of the last 30 days" in out.read_text("utf-8")
    wrong = ["registry", "report", str(phones.folder), "-o", str(tmp_path / "fleet.pdf")]
    assert cli.main(wrong) == InvalidArgument.exit_status
    assert "does not end in .html" in " ".join(capsys.readouterr().err.split())
    assert cli.main(["registry", "report", str(tmp_path / "none"), "-o", str(out)]) == InvalidArgument.exit_status
