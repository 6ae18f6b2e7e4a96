"""docs/real.json and the picture of docs/real.md, from the last run's numbers: `python -m tools.real_page`.

`python -m benchmarks real` measures them. The site shows the tables.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.claims.real import (
    AUTO,
    CLAIM,
    DRAWS,
    LEFT_OUT,
    MEASURED,
    PAPER,
    PHONES,
    d70,
    line_of,
    scores_of,
    solve,
)
from benchmarks.shared import RESULTS
from camssf.grid import BAND, WAVELENGTHS
from tools.pages import markdown_table, write_or_check
from tools.pictures import RGB, legend, save_png, subplots

DOCS = Path(__file__).parents[1] / "docs"
PICTURE = "images/real-d70.png"

COMMAND = "python -m tools.real_page"


def _by_setting(rows: Sequence[Mapping[str, Any]]) -> str:
    """A row for each chart, tolerance and light of a patch, a column for each basis; z and weight are the claim's."""
    settings: dict[tuple[str, ...], dict[str, Mapping[str, Any]]] = {}
    for row in rows:
        settings.setdefault(tuple(line_of(row)[:3]), {})[row["basis"]] = row
    bases = [CLAIM, AUTO, PHONES, PAPER]
    lines = []
    for setting, each in settings.items():
        z, weight = line_of(each[CLAIM])[-2:]
        cells = [", ".join(scores_of(each[basis]["passes"])) if basis in each else "" for basis in bases]
        lines.append([*setting, *cells, z, weight])
    return markdown_table(("chart", "tolerance", "light of a patch", *bases, "z", "weight of `cameras`"), lines)


def _reasons(reasons: Sequence[tuple[str, str]]) -> str:
    """The codes, each once."""
    return " ".join(dict.fromkeys(f"`{code}`" for code, _ in reasons))


def markdown(found: Mapping[str, Any]) -> dict[str, str]:
    """What the site shows on the page: its tables by name."""
    shared = [
        [name, each, f"{100 * row['shared']:.1f} %", " ".join(f"{100 * v:.1f}" for v in row["rest"]) + " %"]
        for name, passes in found["scatter"].items()
        for each, row in passes.items()
    ]
    held = [[name, *scores_of(passes)] for name, passes in found["references"].items()]
    held += [[f"{row['basis']}, light evened out by pass 2011", *scores_of(row["passes"])] for row in found["mended"]]
    drawn = [f"{rmse:.3f} ({100 * kept:.0f})" for rmse, kept in zip(*found["simulated"].values(), strict=True)]
    held += [[f"{LEFT_OUT}, {DRAWS} simulated captures like it: median", drawn[1], ""]]
    held += [["their 5th and 95th percentiles", f"{drawn[0]}; {drawn[2]}", ""]]
    seen = []
    for row in found["photo"]:
        band = row.get("band")
        said = _reasons(row["reasons"])
        wide = "" if band is None else " ".join(f"±{value:.2f}" for value in band)
        seen.append([row["lamp"], f"{row['status']}: {said}", wide, f"{row['away']:.3f}" if row.get("away") else ""])
    missed = [[each["bar"], f"{each['value']:.3g}", each["limit"]] for each in found["bars"] if not each["met"]]
    limits = f"{len(found['bars']) - len(missed)} of {len(found['bars'])} bars are met (`bars` in `docs/real.json`)."
    if missed:
        limits += "\n\n" + markdown_table(("bar missed", "value", "limit"), missed)
    return {
        "curves": _by_setting(found["rows"]),
        "references": markdown_table(("for comparison", "2011", "2010"), held),
        "scatter": markdown_table(("chart", "pass", "shared by the channels", "left in red, green, blue"), shared),
        "photo": markdown_table(
            ("lamp given", "verdict", "95 % band, red, green, blue", "difference from `bulb`"), seen
        ),
        "bars": limits,
    }


def draw(path: Path) -> None:
    """The curves beside both passes."""
    figure, panels = subplots(1, 2, (11, 4.2), sharey=True)
    at = d70().at
    nm = WAVELENGTHS[at]
    titles = {CLAIM: "camssf, no Nikon in its basis", PAPER: "l1 on Gaussians (the paper)"}
    for panel, (basis, title) in zip(panels, titles.items(), strict=True):
        curves, std = solve(basis, MEASURED, 0.08)[1].peak()
        for c, shade in enumerate(RGB):
            panel.plot(WAVELENGTHS, curves[:, c], color=shade, linewidth=1.5)
            if std is not None:
                low, high = (curves[:, c] + way * BAND * std[:, c] for way in (-1, 1))
                panel.fill_between(WAVELENGTHS, low, high, color=shade, alpha=0.15, linewidth=0)
            for truth, mark in zip(d70().truth.values(), ("o", "x"), strict=True):
                panel.plot(nm, truth[at, c], mark, color=shade, markersize=3.5, markeredgewidth=0.8, fillstyle="none")
        panel.set_title(title, fontsize=10)
        panel.set(xlabel="nm", xlim=(390, 710), ylim=(-0.12, 1.3))
        panel.grid(alpha=0.3)
    point: dict[str, Any] = {"color": "black", "markersize": 3.5, "fillstyle": "none", "linestyle": ""}
    looks = {
        "recovered from the chart": {"color": "black"},
        "monochromator 2011": point | {"marker": "o"},
        "monochromator 2010": point | {"marker": "x"},
    }
    panels[0].set_ylabel("Nikon D70, peak 1")
    legend(panels[0], looks, loc="upper right")
    save_png(figure, path)


def main() -> int:
    """The command."""
    found = json.loads((RESULTS / "real.json").read_text("utf-8"))
    draw(DOCS / PICTURE)
    numbers = json.dumps(found, indent=1, ensure_ascii=False) + "\n"
    return write_or_check(COMMAND, DOCS, {"real.json": numbers}, check=False)


if __name__ == "__main__":
    sys.exit(main())
