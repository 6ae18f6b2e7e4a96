"""docs/faults.json, from the last run's numbers: `python -m tools.faults_table`.

`python -m benchmarks faults` counts them. The site shows the tables on docs/verdict.md.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from benchmarks.faults import FAULTS
from benchmarks.shared import RESULTS
from tools.pages import markdown_table, write_or_check

DOCS = Path(__file__).parents[1] / "docs"
COMMAND = "python -m tools.faults_table"


def summary(found: dict[str, Any]) -> str:
    """The counts in short, and every fault that was missed."""
    limits = {bar["bar"]: bar["value"] for bar in found["bars"]}
    clean, pair, causes_ = found["clean"], found["two_shots"], found["causes"]
    mild = {
        key: sum(degrees[0][key] for degrees in found["faults"].values())
        for key in ("missed", "captures", "refused", "doubtful")
    }
    spoilt = {key: sum(row[key] for row in pair["faults"].values()) for key in ("captures", "caught", "named")}
    missed = ", ".join(
        f"`{name}` {' and '.join(str(row['missed']) for row in degrees[1:])}"
        for name, degrees in found["faults"].items()
        if any(row["missed"] for row in degrees[1:])
    )
    bare = "; ".join(
        f"{name}: {row['harmful_caught']} of {row['harmful']}"
        for name, row in found["without_matrix"].items()
        if row["harmful"]
    )
    field = "; ".join(
        f"{name}: {row['accepted']} of {row['captures']} accepted, RMSE {row['rmse']:.3f}, "
        f"bands cover {row['coverage']:.1%}"
        for name, row in found["field"].items()
    )
    return "\n".join([
        f"- Good captures: {clean['accepted']} of {clean['captures']} accepted, {clean['doubtful']} doubtful, "
        f"{clean['refused']} refused; mean RMSE {clean['rmse']:.3f}.",
        f"- Harmful faults caught: {limits['severity 2: harmful caught']:.1%} at severity 2, "
        f"{limits['severity 3: harmful caught']:.1%} at severity 3. Missed, of "
        f"{found['captures_a_fault_and_severity']} each: {missed}.",
        f"- The 95 % bands of everything that was accepted, faults included, cover {found['coverage']:.1%}.",
        f"- Severity 1, the mildest: {mild['missed']} of {mild['captures']} captures missed, "
        f"{mild['refused'] + mild['doubtful']} refused or doubtful.",
        f"- The right group of [causes](#causes) first: {causes_['right']:.2f}, mean of the faults; light blamed for "
        f"another fault: {causes_['light_blamed']} of {causes_['not_light']}.",
        f"- **No colour matrix in the file**, harmful captures caught by fault and severity: {bare}.",
        f"- **Two shots**, daylight and a bulb, one spoilt at severity 3 ({', '.join(pair['faults'])}): of "
        f"{spoilt['captures']} pairs {spoilt['caught']} are caught, and in {spoilt['named']} only the right shot is "
        f"named. Of {pair['clean']} good pairs {pair['clean_caught']} were doubted.",
        "- **In the field** (no white frame, no dark frame, the lamp named as `daylight` or `bulb`), against the "
        f"same photo with all: {field}.",
    ])  # fmt: skip


def table(found: dict[str, Any]) -> str:
    """What the site shows: what became of every fault in severities 2 and 3."""
    refused = {
        name for name, rows in found["faults"].items() if all(row["refused"] == row["captures"] for row in rows[1:])
    }
    whats = "; ".join(f"`{name}`, {FAULTS[name].what}" for name in found["faults"] if name in refused)
    lines = [
        [f"`{name}`: {FAULTS[name].what}", *map(_cell, FAULTS[name].degrees[1:], rows[1:])]
        for name, rows in found["faults"].items()
        if name not in refused
    ]
    others = markdown_table(("fault", "severity 2", "severity 3"), lines)
    return f"All of both severities are refused: {whats}. The others:\n\n{others}"


def _cell(degree: Any, row: dict[str, Any]) -> str:
    """A severity, and what became of its captures."""
    counts = {"refused": row["refused"], "doubtful": row["doubtful"]}
    counts |= {"harmless": row["accepted"] - row["missed"], "**missed**": row["missed"]}
    all_of_them = [word for word, count in counts.items() if count == row["captures"]]
    return f"{degree}: " + ", ".join(all_of_them or [f"{count} {word}" for word, count in counts.items() if count])


def causes(found: dict[str, Any]) -> str:
    """What the site shows: which group of causes was said for which."""
    counts = found["causes"]["counts"]
    said = [*counts, *sorted({group for row in counts.values() for group in row} - set(counts))]
    rows = [
        [fault, *map(str, (sum(row.values()), *(row.get(group, "") for group in said)))]
        for fault, row in counts.items()
        if row
    ]
    return markdown_table(("fault", "caught", *said), rows)


def main() -> int:
    """The command."""
    found = json.loads((RESULTS / "faults.json").read_text("utf-8"))
    found.pop("versions")
    numbers = json.dumps(found, indent=1, ensure_ascii=False) + "\n"
    return write_or_check(COMMAND, DOCS, {"faults.json": numbers}, check=False)


if __name__ == "__main__":
    sys.exit(main())
