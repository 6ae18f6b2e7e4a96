"""Reports of the self-test app as a table: `python -m tools.phone_reports REPORT.json ...`.

The reports of a release's phones are kept in `android-bindings/reports`, and the table is copied to VERIFICATION.md.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from tools.pages import markdown_table

FORMAT = "camssf-selftest/1"
HEAD = (
    "phone, Android", "page size, bytes", "golden cases: ran, failed", "calibration", "its time, ms",
    "memory after it, MB", "guide: frames, median and slowest twentieth, ms",
)  # fmt: skip
NONE = "not run"


def row(report: dict[str, Any]) -> list[str]:
    """One line of the table: what the report holds, "not run" for what the tester left out.

    Raises:
        ValueError: the report has another format.
    """
    if report.get("format") != FORMAT:
        raise ValueError(
            f"The report's format is {report.get('format')!r}, not {FORMAT}: save it from the self-test app."
        )
    device, golden, calibration, guide = (report[name] for name in ("device", "golden", "calibration", "guide"))
    phone = f"{device.get('manufacturer', '')} {device.get('model', '')}, {device.get('android', '')}".strip()
    cases = f"{golden['ran']}, {len(golden['faults'])}" if golden else NONE
    solved = [NONE, "", ""]
    if calibration:
        megabytes = sum(calibration["memory"][part] for part in ("java", "native")) / 1e6
        solved = [calibration["result"]["verdict"]["status"], str(calibration["milliseconds"]), f"{megabytes:.0f}"]
    frames = NONE
    if guide and guide["frames"]:
        frames = f"{guide['frames']}, {guide['median_ms']:.1f}, {guide['slowest_twentieth_ms']:.1f}"
    return [phone, str(device.get("page_size", "")), cases, *solved, frames]


def table(reports: Iterable[dict[str, Any]]) -> str:
    """The reports in the order of the phones' names, as a table in Markdown."""
    return markdown_table(HEAD, sorted(map(row, reports)))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("report", type=Path, nargs="+", help="JSON that the self-test app saved")
    print(table(json.loads(path.read_text("utf-8")) for path in parser.parse_args().report))


if __name__ == "__main__":
    main()
