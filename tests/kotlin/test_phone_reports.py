"""The table of the self-test app's reports."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tools import phone_reports

SELFTEST = Path(__file__).parents[2] / "android-bindings" / "selftest" / "src" / "main" / "kotlin" / "org" / "camssf"
DEVICE = {"manufacturer": "Maker", "model": "Seven", "android": "15", "page_size": "16384"}
WHOLE: dict[str, Any] = {
    "format": phone_reports.FORMAT,
    "device": DEVICE,
    "golden": {"ran": 440, "faults": ["case: too far"]},
    "calibration": {
        "milliseconds": 812,
        "memory": {"java": 40_000_000, "native": 61_000_000},
        "result": {"verdict": {"status": "accepted"}},
    },
    "guide": {"frames": 300, "median_ms": 12.34, "slowest_twentieth_ms": 20.0},
}
EMPTY = WHOLE | {"device": DEVICE | {"model": "Six"}, "golden": None, "calibration": None, "guide": None}


def test_each_report_is_a_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    files = [tmp_path / "seven.json", tmp_path / "six.json"]
    for file, report in zip(files, (WHOLE, EMPTY), strict=True):
        file.write_text(json.dumps(report), encoding="utf-8")
    monkeypatch.setattr("sys.argv", ["phone_reports", *map(str, files)])
    phone_reports.main()
    lines = capsys.readouterr().out.splitlines()
    assert lines[2] == "| Maker Seven, 15 | 16384 | 440, 1 | accepted | 812 | 101 | 300, 12.3, 20.0 |"
    assert lines[3] == "| Maker Six, 15 | 16384 | not run | not run |  |  | not run |"


def test_another_file_is_no_report() -> None:
    with pytest.raises(ValueError, match="camssf-result/1"):
        phone_reports.row({"format": "camssf-result/1"})


def test_the_app_writes_what_the_table_reads() -> None:
    source = "".join(path.read_text("utf-8") for path in (SELFTEST / "selftest").glob("*.kt"))
    names = [*DEVICE, *WHOLE, *WHOLE["golden"], *WHOLE["guide"], "milliseconds", "memory", "java", "native", "result"]
    assert [name for name in names if f'"{name}"' not in source] == []
