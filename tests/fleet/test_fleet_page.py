"""The fleet's page: what it counts is what the registry holds, and no name breaks it."""

import html
import re
from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest

from camssf import cli
from camssf.grid import CHANNELS
from camssf.photo.read.unit import Unit
from camssf_fleet import page as page_module
from camssf_fleet.compare import spread
from camssf_fleet.overview import fleet_page
from camssf_fleet.records import JobEnd
from camssf_fleet.registry import Registry
from tests.support.registries import START, bells, made

pytestmark = pytest.mark.full  # pages on many units

MOST_ROWS = 6
NOW = START + timedelta(days=400)
NOT_ACCEPTED = "Captures without an accepted result, refused ones first, the newest first"


@pytest.fixture(autouse=True)
def few_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page_module, "MOST_ROWS", MOST_ROWS)


def tables(page: str) -> dict[str, list[list[str]]]:
    """The cells of a page's tables by their captions."""
    found: dict[str, list[list[str]]] = {}
    for table in re.findall(r"<table.*?</table>", page, re.DOTALL):
        caption, *rows = re.findall(r"<(?:caption|tr)\b.*?>(.*?)</(?:caption|tr)>", table, re.DOTALL)
        cells = [re.findall(r"<t[hd]\b.*?>(.*?)</t[hd]>", row, re.DOTALL) for row in rows]
        found.setdefault(caption, []).extend([[html.unescape(re.sub("<.*?>", "", c)) for c in row] for row in cells])
    return found


@pytest.fixture
def phones(one: Registry) -> Registry:
    """Four units of one model, of which the first drifts, and one unit of another, last calibrated long ago."""
    rng, rows = np.random.default_rng(4), []
    for number in range(24):
        unit, month = number % 4, number // 4
        shift = rng.normal(size=3) * 0.1 + unit + (month if unit == 0 else 0)
        rows.append(made(number, bells(shift), serial=f"S{unit}", captured=START + timedelta(days=60 * month)))
    rows += [made(30, bells(), model="Old", serial="O1", captured=START - timedelta(days=9))]
    rows += [made(40 + i, status="refused", code="overexposed", serial="S9", captured=NOW) for i in range(3)]
    one.add([*rows, made(50, bells(), status="doubtful", code="of_a_later_release", serial="", captured=NOW)])
    return one


def test_what_the_page_counts(phones: Registry) -> None:
    shown = tables(fleet_page(phones, days=365.0, now=NOW))
    (models,) = (rows for caption, rows in shown.items() if caption.startswith("Units with a serial"))
    assert models == [
        ["", "Units", "Accepted", "Doubtful", "Refused"], ["Maker Model", "5", "24", "1", "3"],
        ["Maker Old", "1", "1", "0", "0"],
    ]  # fmt: skip
    units = {row[0]: row[1:] for row in shown["One row a phone"][1:]}
    names = ["S0, Maker Model", "S9, Maker Model", "O1, Maker Old", *(f"S{i}, Maker Model" for i in (1, 2, 3))]
    assert list(units) == names
    last, drift = units["S0, Maker Model"]
    assert last == "accepted, 2026-10-28, 100 days ago; next 2027-10-28"
    assert drift.startswith("drifts, below: red centre, green centre, blue centre")
    untested = "not testable yet: {} of 2 calibrations"
    assert units["S9, Maker Model"] == ["refused, 2027-02-05, 0 days ago; next now", untested.format(0)]
    assert units["O1, Maker Old"] == ["accepted, 2025-12-23, 409 days ago; next now", untested.format(1)]
    assert all(units[name][1].startswith("none found; smaller than 1.") for name in names[3:])
    refused = shown[NOT_ACCEPTED][1:]
    assert [row[:4] for row in refused[:1]] == [["Maker Model S9", "", "refused", "overexposed"]]
    assert len(refused) == 4
    drifts = shown["Features that drift"][1:]
    assert {(row[0], row[1], row[4]) for row in drifts} == {("S0", "Maker Model", "6 in 300 days")}
    assert {row[2] for row in drifts} == {f"{colour} centre" for colour in CHANNELS}
    assert all(float(row[3].removesuffix(" nm, trend")) == pytest.approx(5, abs=1) for row in drifts)
    (_, later, over) = sorted(shown["Results by the first reason of their verdict"], key=lambda row: row[0])
    assert (later[:3], over[:3]) == (["of_a_later_release", "1", "0"], ["overexposed", "0", "3"])
    assert over[3].startswith("Expose less")


def test_what_cannot_be_tested_is_not_called_without_drift(phones: Registry, tmp_path: Path) -> None:
    """None of the units with too few results is said not to drift."""
    page = fleet_page(phones, now=NOW)
    assert '<span class="number">1</span><span>of 4 tested units changed</span>' in page
    young = Registry(tmp_path / "young", new=True)
    young.add([made(i, bells(), serial=f"S{i}", captured=START) for i in range(MOST_ROWS + 2)])
    page = fleet_page(young, now=NOW)
    assert '<span class="number">not testable</span>' in page
    assert "not testable yet: 1 of 2 calibrations" in page
    assert "And 2 more." in page
    assert "changed" not in page.replace("those that changed first", "")


@pytest.mark.parametrize(("moved", "words"), [(0, "none found; smaller than"), (4, "changed against the first: ")])
def test_the_second_calibration_is_compared_with_the_first(one: Registry, moved: float, words: str) -> None:
    """By the scatter of other units' repeats; the page says what cannot be seen."""
    rng, rows = np.random.default_rng(1), []
    for unit in range(6):
        for time in range(2):
            shift = 0.2 * rng.standard_normal(3) + (moved if (unit, time) == (3, 1) else 0)
            captured = START + timedelta(days=30 * time + unit)
            rows.append(made(10 * unit + time, bells(shift), serial=f"S{unit}", captured=captured))
    one.add(rows)
    units = {row[0].partition(",")[0]: row[2] for row in tables(fleet_page(one, now=NOW))["One row a phone"][1:]}
    assert units["S3"].startswith(words), units["S3"]
    assert all(units[f"S{unit}"].startswith("none found; smaller than ") for unit in (0, 1, 2, 4, 5))


@pytest.mark.parametrize(("moved", "words"), [
    (2.0, "red centre +2.0 nm against the first; too few repeats to say what that means"),
    (7.0, "changed against the first: "),
])  # fmt: skip
def test_alone_only_a_large_change_is_warned_of(one: Registry, moved: float, words: str) -> None:
    shifts = (np.zeros(3), np.array([moved, 0.0, 0.0]))
    one.add([made(i, bells(shift), captured=START + timedelta(days=i)) for i, shift in enumerate(shifts)])
    _, row = tables(fleet_page(one, now=NOW))["One row a phone"]
    assert row[2].startswith(words), row


def test_refused_jobs_are_shown_with_unit_and_photo(one: Registry) -> None:
    blurred = ("refused", "blurred", "Too blurred.")
    ends = [
        JobEnd("t1", "j1", "", START, "a", *blurred, "", "", "", "S1", ("a.dng", "b.dng")),
        JobEnd("t2", "j2", "", START, "b", *blurred, "", photos=("c.dng",)),
        JobEnd("t3", "j2", "", START + timedelta(days=1), "b", "accepted", "", "", "1" * 64),
    ]
    one.append([made(1, bells())], ends)
    assert tables(fleet_page(one, now=NOW))[NOT_ACCEPTED][1:] == [["S1", "a.dng, b.dng", *blurred]]


def test_the_spread_is_that_of_compare(phones: Registry) -> None:
    found = spread(phones, Unit(make="Maker", model="Model"))
    (_, row) = tables(fleet_page(phones, now=NOW))["Spread of each model and channel, as a fraction of the peak"]
    assert row[0] == "Maker Model"
    for cell, *values in zip(row[1:], found.between, found.low, found.high, strict=True):
        numbers = re.findall(r"[\d.]+", cell)
        assert [float(number) for number in numbers] == pytest.approx(values, rel=0.05)


def test_rows_beyond_the_most_are_counted_and_names_are_escaped(one: Registry) -> None:
    one.add([made(i, bells(), model=f"<b>{i}</b>", serial=f"&{i}") for i in range(MOST_ROWS + 2)])
    page = fleet_page(one, now=NOW)
    assert ("<b>" in page, "&lt;b&gt;" in page) == (False, True)
    assert page.count("And 2 more.") == 2  # models, and units
    assert len(tables(page)["One row a phone"]) == 1 + MOST_ROWS


def test_the_command(phones: Registry, tmp_path: Path) -> None:
    out = tmp_path / "fleet.html"
    assert cli.main(["registry", "report", str(phones.folder), "-o", str(out), "--days", "30"]) == 0
    assert re.match("<!DOCTYPE html>.*is due 30 days after", out.read_text("utf-8"), re.DOTALL)
