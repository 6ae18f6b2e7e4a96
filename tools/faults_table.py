"""docs/faults.json, from the last run's numbers: `python -m tools.faults_table`.

`python -m benchmarks.claims.faults` counts them. The site shows the tables on docs/verdict.md.
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
    bars_ = {bar["bar"]: bar["value"] for bar in found["bars"]}
    clean, pair, causes_ = found["clean"], found["two_shots"], found["causes"]
    mild = [each[0] for each in found["faults"].values()]
    missed = [
        f"`{name}` {' and '.join(str(row['missed']) for row in each[1:])}"
        for name, each in found["faults"].items()
        if any(row["missed"] for row in each[1:])
    ]
    bare = [
        f"{name}: {row['harmful_caught']} of {row['harmful']}"
        for name, row in found["without_matrix"].items()
        if row["harmful"]
    ]
    spoilt = pair["faults"].values()
    field = [
        f"{name}: {row['accepted']} of {row['captures']} accepted, RMSE {row['rmse']:.3f}, "
        f"bands cover {row['coverage']:.1%}"
        for name, row in found["field"].items()
    ]
    lines = [
        f"- Good captures: {clean['accepted']} of {clean['captures']} accepted, {clean['doubtful']} doubtful, "
        f"{clean['refused']} refused; mean RMSE {clean['rmse']:.3f}.",
        f"- Harmful faults caught: {bars_['severity 2: harmful caught']:.1%} at severity 2, "
        f"{bars_['severity 3: harmful caught']:.1%} at severity 3. Missed, of "
        f"{found['captures_a_fault_and_severity']} each: {', '.join(missed)}.",
        f"- The 95 % bands of everything that was accepted, faults included, cover {found['coverage']:.1%}.",
        f"- Severity 1, the mildest: {sum(row['missed'] for row in mild)} of {sum(row['captures'] for row in mild)} "
        f"captures missed, {sum(row['refused'] + row['doubtful'] for row in mild)} refused or doubtful.",
        f"- The right group of [causes](#causes) first: {causes_['right']:.2f}, mean of the faults; light blamed for "
        f"another fault: {causes_['light_blamed']} of {causes_['not_light']}.",
        f"- **No colour matrix in the file**, harmful captures caught by fault and severity: {'; '.join(bare)}.",
        f"- **Two shots**, daylight and a bulb, one spoilt at severity 3 ({', '.join(pair['faults'])}): of "
        f"{sum(row['captures'] for row in spoilt)} pairs {sum(row['caught'] for row in spoilt)} are caught, and in "
        f"{sum(row['named'] for row in spoilt)} only the right shot is named. Of {pair['clean']} good pairs "
        f"{pair['clean_caught']} were doubted.",
        "- **In the field** (no white frame, no dark frame, the lamp named as `daylight` or `bulb`), against the "
        f"same photo with all: {'; '.join(field)}.",
    ]
    return "\n".join(lines)


def table(found: dict[str, Any]) -> str:
    """What the site shows: what became of every fault in severities 2 and 3."""
    refused = [
        name for name, each in found["faults"].items() if all(row["refused"] == row["captures"] for row in each[1:])
    ]
    whats = "; ".join(f"`{name}`, {FAULTS[name].what}" for name in refused)
    rows = []
    for name, each in found["faults"].items():
        if name in refused:
            continue
        cells = []
        for degree, row in list(zip(FAULTS[name].degrees, each, strict=True))[1:]:
            parts = {
                "refused": row["refused"],
                "doubtful": row["doubtful"],
                "harmless": row["accepted"] - row["missed"],
                "**missed**": row["missed"],
            }
            counted = [f"{count} {word}" for word, count in parts.items() if count]
            whole = [word for word, count in parts.items() if count == row["captures"]]
            cells.append(f"{degree}: " + ", ".join(whole or counted))
        rows.append([f"`{name}`: {FAULTS[name].what}", *cells])
    others = markdown_table(("fault", "severity 2", "severity 3"), rows)
    return f"All of both severities are refused: {whats}. The others:\n\n{others}"


def causes(found: dict[str, Any]) -> str:
    """What the site shows: which group of causes was said for which."""
    counts = found["causes"]["counts"]
    said = [*counts, *sorted({group for row in counts.values() for group in row} - set(counts))]
    rows = [
        [fault, sum(row.values()), *(row.get(group, "") for group in said)] for fault, row in counts.items() if row
    ]
    return markdown_table(("fault", "caught", *said), [[str(cell) for cell in row] for row in rows])


def main() -> int:
    """The command."""
    found = json.loads((RESULTS / "faults.json").read_text("utf-8"))
    found.pop("versions")
    numbers = json.dumps(found, indent=1, ensure_ascii=False) + "\n"
    return write_or_check(COMMAND, DOCS, {"faults.json": numbers}, check=False)


if __name__ == "__main__":
    sys.exit(main())
