"""The registry: every acknowledged row once, whoever writes, dies, gathers or reads; and what is compared is true."""

import csv
import json
import os
import subprocess
import sys
import time
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from documents import document, refused
from registries import START, bells, made, plain

from camssf import cli
from camssf.documents.result_json import document_bytes
from camssf.errors import InvalidArgument
from camssf.photo.read.unit import Unit

pytest.importorskip("duckdb", reason="duckdb is not here")

from camssf.fleet import compare, registry
from camssf.fleet.drift import FALSE_ALARMS, FEATURES, drift_of, drifts, features
from camssf.fleet.registry import MARK, Registry, Wanted
from camssf.fleet.rows import STRIDE, Origin, Row, Task, columns, row
from camssf.grid import CHANNELS

HERE = Path(__file__).parent
SEARCH = os.pathsep.join(str(Path(path).absolute()) for path in [*sys.path, str(HERE)] if path)


@pytest.fixture
def one(tmp_path: Path) -> Registry:
    return Registry(tmp_path / "phones", new=True)


def keys(each: Registry) -> list[str]:
    return [str(found["key"]) for found in each.query("SELECT key FROM rows ORDER BY key")]


# One row a result


def test_a_result_s_row_comes_back_as_it_was(one: Registry) -> None:
    data = document_bytes(document("D55", "A"))
    unit = Unit(camera_id="2", serial="A1", lens="24 mm", focal_length=24.7, aperture=1.8)
    origin = Origin(unit, "2026-11-20T10:00:00+01:00", "cam", "m" * 64, "p" * 32, "x/result.json", {"site": "Ω '\";"})
    mine = row(data, document("D55", "A"), origin)
    one.add([mine])
    (found,) = one.query("SELECT * FROM rows")
    for name in columns(Row):
        value = getattr(mine, name)
        if name in CHANNELS or name.endswith("_std"):
            given = document("D55", "A")["ssf_std" if "_" in name else "ssf"][name.partition("_")[0]]
            assert found[name] == pytest.approx(given[::STRIDE], rel=1e-6)
        elif name == "code_covariance":
            assert found[name] == pytest.approx(document("D55", "A")[name], rel=1e-6)
        else:
            assert found[name] == (list(value) if isinstance(value, tuple) else value), name
    assert found["captured"] == datetime(2026, 11, 20, 9)
    assert json.loads(found["extra"]) == {"site": "Ω '\";"}
    assert found["lamps"] == ["D55", "A"]
    assert sorted(found["inputs"]) == sorted(document("D55", "A")["hashes"]["inputs"].values())


def test_no_name_of_a_photo_is_kept(one: Registry, tmp_path: Path) -> None:
    """A file's name may tell the place and the hour; the row has its hash."""
    one.add([row(document_bytes(document()), document(), Origin())])
    photo = document()["shots"][0]["photo"]["name"]
    assert photo
    (found,) = one.query("SELECT * FROM rows")
    assert photo not in str({name: value for name, value in found.items() if name != "reason"})


def test_a_refused_result_has_a_row_without_curves(one: Registry) -> None:
    one.add([row(document_bytes(refused()), refused(), Origin())])
    (found,) = one.query("SELECT status, red, blue_std, gap, captured FROM rows")
    assert found == {"status": "refused", "red": [], "blue_std": [], "gap": None, "captured": None}


def test_the_same_result_twice_is_there_once_and_the_newer_counts(one: Registry) -> None:
    one.add([made(1), made(2)])
    one.add([made(1, serial="B2", added=START + timedelta(days=1)), made(3)])
    assert len(keys(one)) == 3
    assert [each["serial"] for each in one.listing(Wanted(Unit(serial="B2")))] == ["B2"]
    assert one.count() == {"accepted": 3}
    one.gather()
    assert one.files() == 1
    assert len(keys(one)) == 3
    assert one.query("SELECT count(*) AS n FROM every") == [{"n": 3}]
    assert len(one.listing(Wanted(Unit(serial="B2")))) == 1


def test_nothing_of_nothing(one: Registry) -> None:
    one.add([])
    assert not one.folder.exists()
    one.note([])
    one.gather()
    with pytest.raises(InvalidArgument, match="There is no folder"):
        Registry(one.folder)
    one.note([Task("t", "", START, "name", "failed", "", "", "")])
    assert Registry(one.folder).listing() == []
    assert Registry(one.folder).count() == {}
    assert one.query("SELECT name, deaths FROM rows", table=Task) == [{"name": "name", "deaths": 0}]


def test_lists(one: Registry) -> None:
    one.add(
        [
            made(1, model="One"), made(2, model="Two", status="doubtful"), made(3, model="Two", status="refused"),
            made(4, model="Two' OR '1'='1", serial="", make="Other"),
        ]
    )  # fmt: skip
    assert [found["key"][-1] for found in one.listing()] == ["4", "3", "2", "1"]
    for wanted, expected in (
        (Wanted(Unit(model="Two")), "32"), (Wanted(Unit(make="Other")), "4"), (Wanted(Unit(serial="A1")), "321"),
        (Wanted(Unit(model="Two"), statuses=("accepted",)), ""), (Wanted(statuses=("refused", "doubtful")), "32"),
        (Wanted(Unit(model="Two' OR '1'='1")), "4"), (Wanted(name="x"), ""),
    ):  # fmt: skip
        assert "".join(found["key"][-1] for found in one.listing(wanted)) == expected
    assert [found["key"][-1] for found in one.listing(limit=2)] == ["4", "3"]


# What may go wrong


@pytest.mark.requirement("R-REGISTRY")
def test_a_writer_that_was_killed_leaves_it_readable(one: Registry) -> None:
    """What it leaves is not in its place yet."""
    one.add([made(1)])
    whole = next((one.folder / "results").glob("*.parquet")).read_bytes()
    (one.folder / "results" / ".camssf-77").write_bytes(whole[: len(whole) // 2])
    (one.folder / "results" / ".camssf-78.parquet").write_bytes(whole[: len(whole) // 2])
    (one.folder / ".camssf-79").write_bytes(b"{")
    one.add([made(2)])
    one.gather()
    assert len(keys(Registry(one.folder))) == 2


def flipped(data: bytes, start: int, count: int = 400) -> bytes:
    return data[:start] + bytes(byte ^ 0x5A for byte in data[start : start + count]) + data[start + count :]


def test_a_damaged_file_is_named(one: Registry, tmp_path: Path) -> None:
    """Whatever DuckDB says of it: near the file's end stands what it reads first."""
    one.add([made(n, bells()) for n in range(50)])
    one.add([made(n, bells()) for n in range(100, 150)])
    files = sorted((one.folder / "results").glob("*.parquet"))
    whole = files[1].read_bytes()
    spoilt = [whole[:-9], b"", b"PAR", b"x" * 99]
    spoilt += [flipped(whole, len(whole) - back) for back in range(500, 3500, 500)]
    for number, data in enumerate(spoilt):
        files[1].write_bytes(data)
        attempts = (one.listing, one.gather, lambda: one.export(tmp_path / "all.parquet"))
        for attempt in attempts if number in (0, 4) else attempts[number % 3 :][:1]:
            with pytest.raises(InvalidArgument, match=files[1].name) as caught:
                attempt()
            assert "Move it away" in caught.value.advice, number
        assert sorted((one.folder / "results").iterdir()) == files, number


def test_a_file_of_another_kind_is_named(one: Registry) -> None:
    one.add([made(1)])
    one.note([Task("t", "", START, "name", "failed", "", "", "")])
    for folder, table in (("results", Row), ("tasks", Task)):
        file = one.folder / folder / "foreign.parquet"
        with registry.connection() as con:
            con.execute(f"COPY (SELECT 1 AS n, 'x' AS status) TO '{file}' (FORMAT parquet)")
        with pytest.raises(InvalidArgument, match=r"foreign.parquet is no file of a registry: it lacks (key|task)"):
            one.query("SELECT * FROM rows", table=table)
        file.unlink()


def test_curves_that_cannot_be_are_named(tmp_path: Path) -> None:
    for wrong in (float("nan"), float("inf"), -1e30, 7.0):
        one = Registry(tmp_path / f"{wrong}", new=True)
        curves = bells()
        curves[1, 30] = wrong
        one.add([*history(5, 0), made(77, curves, captured=START, serial="A1"), made(78, bells(), serial="B2")])
        (place,) = (one.folder / "results").glob("*.parquet")
        attempts = [
            lambda one=one: compare.spread(one, Unit(model="Model")),
            lambda one=one: drift_of(one, Unit(serial="A1")),
            lambda one=one: compare.nearest(one, bells()),
        ]
        for attempt in attempts if wrong == 7.0 else attempts[:1]:
            with pytest.raises(InvalidArgument, match=f"{place.name} is damaged: of the result 00000000000"):
                attempt()


def test_curves_of_another_length_are_named(one: Registry) -> None:
    one.add([made(1, bells()), made(2, bells()[:, :60], serial="B2")])
    for attempt in (lambda: compare.spread(one, Unit(model="Model")), lambda: compare.nearest(one, bells())):
        with pytest.raises(InvalidArgument, match="the curves cannot be right"):
            attempt()


def test_an_export_s_place_is_to_blame_for_itself(one: Registry, tmp_path: Path) -> None:
    one.add([made(1)])
    (tmp_path / "folder.csv").mkdir()
    for name in ("nodir/x.parquet", "folder.csv"):
        with pytest.raises(InvalidArgument, match=f"{name} cannot be written") as caught:
            one.export(tmp_path / name)
        assert str(one.folder) not in caught.value.message
    assert sorted(path.name for path in tmp_path.iterdir()) == ["folder.csv", "phones"]


def test_a_file_of_an_older_release_lacks_a_column(one: Registry) -> None:
    one.add([made(1)])
    with registry.connection() as con:
        file = one.folder / "results" / "old.parquet"
        con.execute(
            f"COPY (SELECT '{'a' * 64}' AS key, 'accepted' AS status, TIMESTAMP '2026-01-01' AS added, 7 AS gone) "
            f"TO '{file}' (FORMAT parquet)"
        )
    assert len(keys(one)) == 2
    found = {each["key"]: each for each in one.listing()}
    assert found["a" * 64]["lamps"] is None
    one.gather()
    assert len(keys(one)) == 2


def test_a_folder_of_something_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "letter.txt").write_text("dear")
    for new in (True, False):
        with pytest.raises(InvalidArgument, match="no registry"):
            Registry(tmp_path, new=new)
    (tmp_path / MARK).write_text('{"format": "camssf-registry/9"}')
    with pytest.raises(InvalidArgument, match="no registry"):
        Registry(tmp_path, new=True)
    with pytest.raises(InvalidArgument, match=r"letter\.txt is a file"):
        Registry(tmp_path / "letter.txt", new=True)
    with pytest.raises(InvalidArgument, match="There is no folder"):
        Registry(tmp_path / "missing")


def test_two_writers_that_begin_a_registry_together(one: Registry, monkeypatch: pytest.MonkeyPatch) -> None:
    """The other one makes it between this one's look for the mark and its look whether anything else is there."""
    real = registry._empty

    def late(folder: Path) -> bool:
        monkeypatch.setattr(registry, "_empty", real)
        one.add([made(1)])
        return real(folder)

    monkeypatch.setattr(registry, "_empty", late)
    Registry(one.folder, new=True).add([made(2)])
    assert len(keys(one)) == 2


def test_a_disk_that_is_full_adds_nothing(one: Registry, monkeypatch: pytest.MonkeyPatch) -> None:
    one.add([made(1)])

    def full(handle: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(registry.os, "fsync", full)
    for attempt in (lambda: one.add([made(2)]), lambda: one.note([Task("t", "", START, "", "", "", "", "")])):
        with pytest.raises(InvalidArgument, match="No space"):
            attempt()
    monkeypatch.undo()
    assert len(keys(one)) == 1
    assert not [path for path in one.folder.rglob("*") if path.name.startswith(".camssf")]


def test_a_file_that_vanishes_while_it_is_read(one: Registry, monkeypatch: pytest.MonkeyPatch) -> None:
    """As when somebody gathers between the look into the folder and the reading."""
    for number in range(4):
        one.add([made(number)])
    real, calls = Registry._files, []

    def late(self: Registry, table: Any) -> list[Path]:
        found = real(self, table)
        if len(calls) < 2 and table is Row:
            calls.append(1)
            Registry(self.folder).gather() if len(calls) == 1 else None
        return found

    monkeypatch.setattr(Registry, "_files", late)
    assert len(keys(one)) == 4
    assert calls


def test_without_the_library_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "duckdb", None)
    with pytest.raises(InvalidArgument, match=r"camssf\[fleet\]"):
        Registry(tmp_path)


# Many at once


@pytest.mark.requirement("R-REGISTRY")
@pytest.mark.full
def test_six_writers_two_of_them_killed(one: Registry) -> None:
    """Somebody reads and somebody gathers meanwhile. All that was acknowledged is there, once."""
    rows = {number: 100 if number > 2 else 1_000_000 for number in range(1, 7)}  # victims never end by themselves
    writers = [
        subprocess.Popen(
            [sys.executable, str(HERE / "registries.py"), str(one.folder), str(number), str(count), "5"],
            stdout=subprocess.PIPE, env=os.environ | {"PYTHONPATH": SEARCH},
        )
        for number, count in rows.items()
    ]  # fmt: skip
    told: list[list[str]] = []
    try:
        deadline = time.monotonic() + 240
        while not (one.folder / MARK).exists() and time.monotonic() < deadline:
            time.sleep(0.01)
        reader = Registry(one.folder)
        for number, victim in enumerate(writers[:2], 1):
            theirs, found = f"{number * 1_000_000:064x}"[:-4], keys(reader)
            while not any(key.startswith(theirs) for key in found) and time.monotonic() < deadline:
                assert len(found) == len(set(found))
                reader.gather()
                found = keys(reader)
            victim.kill()
        for process in writers:
            out, _ = process.communicate(timeout=240)
            told.append(out.decode().splitlines())
    finally:
        for process in writers:
            process.kill()
            process.wait()
    assert [process.returncode != 0 for process in writers] == [True] * 2 + [False] * 4
    assert [len(lines) for lines in told[2:]] == [100] * 4
    assert all(told[:2])
    found = keys(reader)
    assert len(found) == len(set(found))
    acknowledged = {line for lines in told for line in lines}
    assert acknowledged <= set(found)
    assert len(set(found) - acknowledged) <= 10  # a task of each victim that was safe, and he did not live to say so
    reader.gather()
    assert keys(reader) == found


# Comparing


def fleet(one: Registry, units: int, repeats: int, between: float, within: float, seed: int = 0) -> None:
    """Units whose curves differ by a bump of so many parts of the peak, and results of each that do by another."""
    dice = np.random.default_rng(seed)
    bump = np.exp(-0.5 * ((compare.NM - 550) / 40) ** 2)
    rows = []
    for unit in range(units):
        own = between * dice.standard_normal((3, 1)) * bump
        for repeat in range(repeats):
            curves = bells() + own + within * dice.standard_normal((3, 1)) * bump
            rows.append(made(1000 * unit + repeat, curves, serial=f"u{unit}"))
    one.add(rows)


def rms(bump: float = 1.0) -> float:
    return float(bump * np.sqrt(np.mean(np.exp(-(((compare.NM[compare.COMPARED] - 550) / 40) ** 2)))))


def test_the_spread_of_a_model(one: Registry) -> None:
    fleet(one, units=60, repeats=3, between=0.03, within=0.02)
    one.add([made(900_000, bells(20.0), serial=""), made(900_001, bells(50.0), status="refused", serial="r")])
    found = compare.spread(one, Unit(model="Model"))
    assert (found.units, found.results, found.without_serial) == (60, 180, 1)
    assert found.repeat is not None
    assert found.between is not None
    assert found.repeat == pytest.approx(rms(0.02), rel=0.15)
    assert found.between == pytest.approx(rms(0.03), rel=0.25)
    assert (found.low < rms(0.03)).all()
    assert (found.high > rms(0.03)).all()
    assert found.observed == pytest.approx(rms(np.hypot(0.03, 0.02 / np.sqrt(3))), rel=0.25)


def test_the_interval_of_a_spread_covers() -> None:
    """0.95 of simulated fleets of six units, and not much more where one bump is all that differs."""
    dice, inside = np.random.default_rng(3), 0
    bump = np.exp(-0.5 * ((compare.NM[compare.COMPARED] - 550) / 40) ** 2)
    for _ in range(400):
        units = [0.03 * dice.standard_normal((3, 1)) * bump for _ in range(6)]
        _, repeat, between, low, high = compare.between_units([unit[None] for unit in units])
        assert repeat is between is None
        inside += int(np.sum((low <= rms(0.03)) & (rms(0.03) <= high)))
    assert 0.93 <= inside / 1200 <= 0.97


def test_units_that_are_equal_spread_by_nothing(one: Registry) -> None:
    """What repeats explain is not the units'."""
    fleet(one, units=30, repeats=4, between=0.0, within=0.02)
    found = compare.spread(one, Unit(model="Model"))
    assert (found.low == 0).all()
    assert (found.high < rms(0.015)).all()
    same = [np.ones((2, 3, 5))] * 3
    assert all((np.asarray(each) == 0).all() for each in compare.between_units(same))


def test_too_few_units(one: Registry) -> None:
    one.add([made(1, bells()), made(2, bells())])
    with pytest.raises(InvalidArgument, match="1 unit of Model"):
        compare.spread(one, Unit(model="Model"))
    with pytest.raises(InvalidArgument, match="no unit of Nothing"):
        compare.spread(one, Unit(model="Nothing"))


def history(count: int, drift: float, step: float = 0.0, noise: float = 0.3, seed: int = 0) -> list[Row]:
    """Results of one unit every month; red's centre drifts by so many nm a year, and steps before the last."""
    dice = np.random.default_rng(seed)
    rows = []
    for month in range(count):
        red = drift * month / 12 + step * (month == count - 1)
        curves = bells(np.array([red, 0, 0]) + noise * dice.standard_normal(3))
        rows.append(made(month, curves, captured=START + timedelta(days=30.4 * month)))
    return rows


@pytest.mark.parametrize(("drift", "step", "alarm"), [(0, 0, ""), (6, 0, "trend"), (-6, 0, "trend"), (0, 5, "step")])
def test_a_drift_raises_an_alarm(one: Registry, drift: float, step: float, alarm: str) -> None:
    one.add(history(13, drift, step))
    found = {each.feature: each for each in drift_of(one, Unit(serial="A1")).features}
    assert set(found) == set(FEATURES)
    assert found["red centre"].alarm == alarm
    assert not [each for name, each in found.items() if each.alarm and name != "red centre"]
    red = found["red centre"]
    assert (red.results, red.days) == (13, pytest.approx(364.8))
    if alarm == "trend":
        assert red.slope == pytest.approx(drift, abs=4 * red.slope_error)
        assert red.slope == pytest.approx(drift, abs=1.0)
    if alarm == "step":
        assert red.step == pytest.approx(step, abs=1.0)


def test_false_alarms_are_as_rare_as_they_say() -> None:
    dice, days = np.random.default_rng(5), np.arange(8) * 30.0
    alarms = 0
    for _ in range(2000):
        values = 500 + 20 * dice.standard_normal((8, len(FEATURES)))  # so loud that no limit hides one
        alarms += any(each.alarm for each in drifts(days, values))
    assert 0 < alarms / 2000 <= 1.5 * FALSE_ALARMS


def test_a_drift_that_is_certain_and_small_is_no_alarm() -> None:
    days = np.arange(10) * 36.5
    values = np.outer(days / 365, [0.5] * 6) + 500
    for each in drifts(days, values):
        assert each.p_trend < 1e-6
        assert not each.alarm
    still = drifts(days, np.full((10, 6), 500.0))
    assert [(each.change, each.p_trend, each.p_step, each.alarm) for each in still] == [(0, 1, 1, "")] * 6
    at_once = drifts(np.zeros(5), np.arange(30.0).reshape(5, 6))
    assert all(each.slope == 0 for each in at_once)


def test_what_a_drift_needs(one: Registry) -> None:
    one.add([*history(3, 0), made(90, bells(), captured=None)])
    with pytest.raises(
        InvalidArgument, match=r"3 accepted results of the unit A1 have a time; a drift needs 4\. Left out: 1 no time"
    ):
        drift_of(one, Unit(serial="A1"))
    with pytest.raises(InvalidArgument, match="no result of a unit with the serial number none"):
        drift_of(one, Unit(serial="none"))
    one.add([replace(each, key=f"{i:064d}", model="Other") for i, each in enumerate(history(4, 0), 10)])
    with pytest.raises(InvalidArgument, match="Several units"):
        drift_of(one, Unit(serial="A1"))
    assert len(drift_of(one, Unit(serial="A1", model="Other")).features) == 6


def test_a_unit_is_one_however_much_its_rows_say(one: Registry) -> None:
    """`registry learn` counts it once, too. What is silent where several are named is of nobody."""
    one.add([made(1, bells(), lens="50mm"), made(2, bells()), made(3, bells(1.0), serial="B2"),
             made(4, bells(1.0), serial="B2", camera_id="2", lens="50mm")])  # fmt: skip
    found = compare.spread(one, Unit(model="Model"))
    assert (found.units, found.results, found.without_serial) == (2, 4, 0)
    one.add([made(5, bells(), lens="24mm"), made(6, bells(), camera_id="1", lens="24mm")])
    found = compare.spread(one, Unit(model="Model"))
    assert (found.units, found.results, found.without_serial) == (3, 5, 1)
    assert compare.spread(one, Unit(model="Model", lens="50mm")).results == 3
    units = compare.units_of([["m", "p", c, "s", lens] for c, lens in (("1", "a"), ("2", ""), ("2", "b"), ("", "a"))])
    assert units == [("m", "p", "1", "s", "a"), ("m", "p", "2", "s", "b"), ("m", "p", "2", "s", "b"), None]


def test_what_several_units_of_a_number_differ_in_is_said(one: Registry) -> None:
    rows = history(4, 0)
    both = [replace(each, key=f"{i:064d}", lens="24mm") for i, each in enumerate(rows, 10)]
    one.add([replace(each, lens="50mm") for each in rows] + both)
    with pytest.raises(InvalidArgument, match="lens '24mm', '50mm'") as caught:
        drift_of(one, Unit(serial="A1", model="Model", make="Maker"))
    assert caught.value.advice == "Name one by --lens."
    assert drift_of(one, Unit(serial="A1", lens="24mm")).features[0].results == 4
    one.add([replace(each, key=f"{i:064d}", make="Other", lens="24mm") for i, each in enumerate(rows, 20)])
    with pytest.raises(InvalidArgument, match=r"make 'Maker', 'Other'; lens") as caught:
        drift_of(one, Unit(serial="A1"))
    assert caught.value.advice == "Name one by --make or --lens."
    assert run("compare", one.folder, "--serial", "A1", "--make", "Other") == 0
    assert run("compare", one.folder, "--serial", "A1", "--lens", "24mm") == InvalidArgument.exit_status
    assert run("compare", one.folder, "--serial", "A1", "--lens", "50mm", "--camera-id", "7") == 0


def test_features_are_centres_and_widths() -> None:
    found = features(bells(np.array([-3.0, 0.0, 4.0]), width=25.0)[None][..., compare.COMPARED])[0]
    assert found == pytest.approx([597, 25, 540, 25, 464, 25], abs=0.5)  # red and blue end a little inside


def test_the_nearest_models(one: Registry) -> None:
    dice = np.random.default_rng(1)
    rows = [
        made(100 * m + i, bells(5.0 * m + dice.normal()), model=f"Model {m}") for m in range(4) for i in range(5)
    ] + [made(9000, bells(10.0), model="Refused", status="refused"), made(9001, model="Empty")]
    one.add(rows)
    found = compare.nearest(one, bells(10.2), most=3)
    assert [near.model for near in found] == ["Model 2", "Model 3", "Model 1"]
    assert found[0].results == 5
    assert found[0].distance < 0.02 < found[1].distance
    inside = (
        bells(10.2)[:, compare.COMPARED]
        - np.mean([np.array([r.red, r.green, r.blue]) for r in rows if r.model == "Model 2"], axis=0)[
            :, compare.COMPARED
        ]
    )
    assert found[0].distance == pytest.approx(np.sqrt(np.mean(inside**2)), rel=1e-3)
    assert compare.nearest(one, bells(), statuses=("doubtful",)) == ()


# The command line


def validated(found: dict[str, Any], form: str) -> dict[str, Any]:
    """By the schema, under its own name: `camssf-nearest/1` is what `cameras --nearest` says."""
    jsonschema = pytest.importorskip("jsonschema")
    schema = json.loads((Path(registry.__file__).parents[1] / "data" / "registry.schema.json").read_text("utf-8"))
    jsonschema.Draft202012Validator(schema).validate(found)
    assert found["format"] == form
    return found


def run(*words: object) -> int:
    return cli.main(["registry", *map(str, words)])


def test_add_list_compare_export(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder, result = tmp_path / "phones", tmp_path / "out" / "result.json"
    result.parent.mkdir()
    result.write_bytes(document_bytes(document()))
    assert run("add", folder, result, "--serial", "=A1", "--captured", "2026-11-20T10:00:00+01:00") == 0
    assert run("add", folder, result, "--serial", "=A1", "--captured", "2026-11-20T10:00:00+01:00") == 0
    capsys.readouterr()
    assert run("list", folder, "--status", "doubtful") == 0
    out, err = capsys.readouterr()
    (found,) = csv.DictReader(out.splitlines())
    assert (found["serial"], found["captured"], found["status"]) == ("'=A1", "2026-11-20T09:00:00Z", "doubtful")
    assert "1 doubtful" in err
    assert run("list", folder, "--model", "another") == 0
    assert "no results" in capsys.readouterr().err
    assert run("list", folder, "--status", "acepted") == InvalidArgument.exit_status
    assert "accepted, doubtful, refused" in capsys.readouterr().err
    assert run("compare", folder, "--result", result, "--doubtful") == 0
    told = json.loads(capsys.readouterr().out)
    validated(told, "camssf-registry-nearest/1")
    (near,) = told["models"]
    assert near["model"] == document()["camera"]["model"]
    assert near["distance"] < 1e-6
    assert Registry(folder).query("SELECT place FROM rows") == [{"place": "../out/result.json"}]
    for name in ("all.parquet", "all.csv"):
        assert run("export", folder, "-o", tmp_path / name) == 0
    with registry.connection() as con:
        (count,) = con.execute(f"SELECT count(*) FROM '{tmp_path / 'all.parquet'}' WHERE len(red) = 69").fetchone()
    assert count == 1
    (cells,) = csv.DictReader((tmp_path / "all.csv").read_text("utf-8").splitlines())
    assert cells["serial"] == "'=A1"
    assert "red" not in cells
    assert sorted(path.name for path in tmp_path.iterdir()) == ["all.csv", "all.parquet", "out", "phones"]


def test_what_is_added_is_called_what_it_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for data, word in ((b"II*\0" + bytes(99), "DNG"), (b"\x89PNG\r\n", "PNG"), (b"name,photo\nx,y\n", "text"),
                       (bytes(9) + b"..", "binary")):  # fmt: skip
        (tmp_path / "chart.dng").write_bytes(data)
        for more in ((), ("--serial", "x")):
            assert run("add", tmp_path / "phones", tmp_path / "chart.dng", *more) == InvalidArgument.exit_status
            told = capsys.readouterr().err
            assert word in told
            assert "no passport" in " ".join(told.split())
    assert not (tmp_path / "phones").exists()


def test_add_a_passport(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("cryptography", reason="cryptography is not here")
    from camssf.documents.keys import PUBLIC, make_key, read_private
    from camssf.documents.passport import PassportRequest, as_document, create_passport, sign
    from camssf.documents.revocations import sign_revocations

    make_key(tmp_path)
    drawn = create_passport(
        document_bytes(document()), PassportRequest(Unit(serial="S"), "2026-01-02"), now=datetime.now(UTC)
    )
    file, folder = tmp_path / "a.jws", tmp_path / "phones"
    file.write_bytes(sign(drawn, read_private(tmp_path / "passport-key.pem")))
    assert run("add", folder, file) == 2
    assert run("add", folder, file, "--key", tmp_path / PUBLIC, "--serial", "x") == 2
    lists = sign_revocations([drawn.id], read_private(tmp_path / "passport-key.pem"))
    (tmp_path / "revoked").write_bytes(lists)
    assert run("add", folder, file, "--key", tmp_path / PUBLIC, "--revoked", tmp_path / "revoked") == 10
    assert not folder.exists()
    capsys.readouterr()
    assert run("add", folder, file, "--key", tmp_path / PUBLIC) == 0
    assert "without its covariance" in capsys.readouterr().err
    (found,) = Registry(folder).query("SELECT * FROM rows")
    assert (found["passport"], found["serial"], found["key"]) == (drawn.id, "S", drawn.result_sha256)
    assert found["captured"] == datetime(2026, 1, 2)
    assert not found["code_covariance"]
    # With the whole result, or with what `passport verify` printed: the same row, and nothing of it is lost.
    (tmp_path / "y.json").write_text(json.dumps(as_document(file.read_bytes(), drawn)), "utf-8")
    (tmp_path / "result.json").write_bytes(document_bytes(document()))
    assert run("add", folder, tmp_path / "y.json") == 2  # a passport wants a key, in this form, too
    capsys.readouterr()
    assert run("add", folder, tmp_path / "result.json", tmp_path / "y.json", "--key", tmp_path / PUBLIC) == 0
    told = capsys.readouterr().err
    assert "1 result added" in told
    assert "covariance" not in told
    (found,) = Registry(folder).query("SELECT * FROM rows")
    assert (found["passport"], found["serial"], found["key"]) == (drawn.id, "S", drawn.result_sha256)
    assert list(found["code_covariance"]) == pytest.approx(document()["code_covariance"], abs=1e-6)


def test_a_drift_on_the_command_line_ends_with_1(
    one: Registry, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one.add([*history(13, 6), *(replace(each, key=each.key[::-1], serial="B2") for each in history(13, 0))])
    assert run("compare", one.folder, "--serial", "A1") == cli.PARTED
    out, err = capsys.readouterr()
    assert validated(json.loads(out), "camssf-drift/1")["alarm"] is True
    assert "red centre" in err
    assert run("compare", one.folder, "--serial", "B2") == 0
    out, err = capsys.readouterr()
    assert json.loads(out)["alarm"] is False
    assert run("compare", one.folder, "--model", "Model") == 0
    assert validated(json.loads(capsys.readouterr().out), "camssf-spread/1")["units"] == 2


def last(**more: Any) -> Row:
    """A result of the unit of `history`, newer than its first five; so far off that it is doubtful."""
    row_ = made(50, bells(np.array([0.0, 0.0, 12.0])), captured=START + timedelta(days=200), status="doubtful")
    row_ = replace(row_, inputs=("b" * 64,))
    return replace(row_, **{"code": "lamp_unfit", "reason": "The photo fits D:4300 better."} | more)


def test_a_newest_result_that_was_left_out_is_not_no_drift(one: Registry, capsys: pytest.CaptureFixture[str]) -> None:
    one.add([*history(5, 0), last()])
    assert run("compare", one.folder, "--serial", "A1") == cli.UNDECIDED
    out, err = capsys.readouterr()
    found = validated(json.loads(out), "camssf-drift/1")
    assert (found["outcome"], found["alarm"], found["doubtful"]) == ("undecided", False, 0)
    (left,) = found["left_out"]
    assert (left["key"], left["captured"], left["why"]) == (f"{50:064x}", "2026-07-20T00:00:00Z", "doubtful")
    assert left["newest"]
    assert left["steps"]["blue centre"] == pytest.approx(11, abs=2)
    err = " ".join(err.split())
    for words in ("2026-07-20T00:00:00Z, doubtful (lamp_unfit: The photo fits", "blue centre +1", "undecided"):
        assert words in err
    assert run("compare", one.folder, "--serial", "A1", "--doubtful") == cli.PARTED
    out, err = capsys.readouterr()
    found = json.loads(out)
    assert (found["outcome"], found["doubtful"], found["left_out"]) == ("drift", 1, [])
    assert "6 results, 1 of them doubtful," in err
    one.add([replace(each, key=f"f{each.key[1:]}", serial="B2") for each in history(3, 0)])
    assert run("compare", one.folder, "--serial", "B2") == InvalidArgument.exit_status


@pytest.mark.parametrize(
    ("more", "outcome", "why"),
    [
        ({"captured": START + timedelta(days=45)}, "no_drift", "doubtful"),
        ({"red": (), "green": (), "blue": (), "status": "refused"}, "undecided", "no curves"),
        ({"captured": None, "status": "accepted"}, "no_drift", "no time"),  # it was added before the last photo
        ({"captured": None, "status": "accepted", "added": START + timedelta(days=300)}, "undecided", "no time"),
        ({"camera_id": "1", "lens": "", "status": "accepted"}, "undecided", "unit not certain"),
        ({"lens": "24mm"}, "no_drift", None),  # of another unit
        ({"inputs": ("a" * 64,)}, "no_drift", "doubtful"),  # the same photos count, in another result
        ({"model": "Other"}, "no_drift", None),
    ],
)
def test_what_is_left_out_of_a_drift_is_named(
    one: Registry, more: dict[str, Any], outcome: str, why: str | None
) -> None:
    rows = [replace(each, camera_id="1", lens="50mm") for each in history(5, 0)]
    rows[-1] = replace(rows[-1], inputs=("a" * 64,))
    other = [replace(rows[0], key="e" * 64, lens="35mm")] if why == "unit not certain" else []
    one.add([*rows, *other, last(**{"camera_id": "1", "lens": "50mm"} | more)])
    found = drift_of(one, Unit(serial="A1", lens="50mm", model="Model" if "model" in more else ""))
    assert (found.outcome, [each.why for each in found.left_out]) == (outcome, [] if why is None else [why])
    assert all((each.steps is None) == (why == "no curves") for each in found.left_out)
    assert found.features[0].results == 5


def test_an_older_result_that_was_left_out_is_listed(one: Registry, capsys: pytest.CaptureFixture[str]) -> None:
    one.add([*history(5, 0), last(captured=START + timedelta(days=45))])
    assert run("compare", one.folder, "--serial", "A1") == 0
    found = validated(json.loads(capsys.readouterr().out), "camssf-drift/1")
    assert [each["newest"] for each in found["left_out"]] == [False]


def test_a_time_to_come_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "result.json").write_bytes(document_bytes(document()))
    words = ("add", tmp_path / "new", tmp_path / "result.json", "--serial", "A", "--captured", "9000-01-01")
    assert run(*words) == InvalidArgument.exit_status
    assert "lies in the future" in capsys.readouterr().err
    assert not (tmp_path / "new").exists()


def test_what_a_spread_and_the_nearest_leave_out_is_counted(
    one: Registry, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    fleet(one, units=3, repeats=1, between=0.03, within=0.0)
    one.add([last(serial="r"), last(key="a" * 64, status="refused", red=(), green=(), blue=())])
    assert run("compare", one.folder, "--model", "Model") == 0
    out, err = capsys.readouterr()
    assert validated(json.loads(out), "camssf-spread/1")["left_out"] == {"doubtful": 1, "refused": 1}
    assert "left out: 1 doubtful, 1 refused" in err
    (tmp_path / "result.json").write_bytes(document_bytes(document()))
    assert run("compare", one.folder, "--result", tmp_path / "result.json") == 0
    out, err = capsys.readouterr()
    assert validated(json.loads(out), "camssf-registry-nearest/1")["left_out"] == {"doubtful": 1, "refused": 1}
    assert "left out: 1 doubtful, 1 refused" in err


WRONG = [
    (["list", "missing"], "There is no folder missing. Name the folder that `camssf registry add`"),
    (["list", "else"], "else is no registry: it holds no registry.json."),
    (["add", "else", "result.json"], "Name a new or an empty folder."),
    (["list", "newer"], "its format is 'camssf-registry/9', not 'camssf-registry/1'."),
    (["list", "phones", "--status", "bad"], "'bad' is not a status of a result. Use one of accepted, doubtful,"),
    (["compare", "phones"], "Nothing to compare was named. Give --model to compare its units, --serial to"),
    (["compare", "phones", "--serial", "none"], "The registry has no result of a unit with the serial number none."),
    (["compare", "phones", "--model", "Model"], "There is 1 unit of Model with a serial number and accepted results"),
    (["learn", "phones", "-o", "x.npz", "--leave", "day"], "--leave takes model or maker; got 'day'."),
    (["learn", "phones", "-o", "x.txt"], "The basis file x.txt does not end in .npz."),
    (["export", "phones", "-o", "x.txt"], "x.txt ends in neither .parquet nor .csv."),
    (["compare", "phones", "--model", "x", "--result", "y"], ""),
    (["add", "phones", "no.json"], ""),
    (["add", "phones", "empty.json"], ""),
    (["add", "phones", "result.json", "--captured", "soon"], ""),
    (["compare", "phones", "--result", "refused.json"], ""),
    (["export", "phones", "-o", "no/where.csv"], ""),
    (["compare", "phones", "--result", "result.json", "--make", "foo"], ""),
]
"""Calls that are wrong, and words of the message."""


def test_messages_say_what_is_wrong_and_nothing_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Registry("phones", new=True).add([made(1, bells())])
    Path("empty.json").write_text("{}")
    Path("result.json").write_bytes(document_bytes(document()))
    Path("refused.json").write_bytes(document_bytes(refused()))
    for folder, mark in (("else", "letter.txt"), ("newer", MARK)):
        Path(folder).mkdir()
        (Path(folder) / mark).write_text('{"format": "camssf-registry/9"}')
    before = sorted(str(path) for path in tmp_path.rglob("*"))
    for words, message in WRONG:
        assert run(*words) == InvalidArgument.exit_status, words
        assert message in " ".join(capsys.readouterr().err.split()), words
        assert sorted(str(path) for path in tmp_path.rglob("*")) == before, words


def test_rows_know_what_they_must() -> None:
    """The words of the issue: verdict, unit, scores, lamp, hashes, times, place, curves and bands."""
    assert {
        "status", "reason", "make", "model", "serial", "delta_e00", "evidence", "odds", "lamps", "inputs", "onnx",
        "captured", "added", "place", *CHANNELS, *(f"{colour}_std" for colour in CHANNELS),
    } <= set(columns(Row))  # fmt: skip
    assert not [name for name in columns(Row) if "gps" in name or "photo" in name]
    assert plain().key
