"""docs/paper.json and its pictures, from the last run's numbers, and the site's page: `python -m tools.paper_page`.

`python -m benchmarks.paper` measures them. Every number of the page is in docs/paper.json, but for the paper's own.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from benchmarks.shared import RESULTS
from camssf.files import write_file
from tools.pages import markdown_table, template
from tools.paper_figures import draw

DOCS = Path(__file__).parents[1] / "docs"
PAPER, TUNED = "l1 on Gaussians (the paper)", "l1 on Gaussians, γ tuned"
PRODUCT, WIENER = "elastic net on cameras (camssf)", "Wiener"
QUADRATIC, JIANG = "quadratic programme, smooth and non-negative", "PCA subspace (Jiang 2013, colour-science)"
QR, PINV = "QR with non-negativity", "pseudo-inverse with non-negativity"
NOISES = ("0.0", "0.005", "0.01")
THE_PAPERS = (0.3557, 0.1511, 0.0281, 0.579, 7.88, 6.95, 10.30)
"""What the paper prints: Fig. 4, Fig. 3f, Fig. 6."""


def number(value: float | None, digits: int = 3) -> str:
    """A number with so many decimals; a dash for none."""
    return "–" if value is None else f"{value:.{digits}f}"


def page(found: dict[str, Any]) -> str:
    """What the site shows on the page."""
    parts = (colours, correlation, methods, families, direct, phones, lamps, atoms, charts, bars)
    return template("paper.md", found=found, number=number, **{part.__name__: part(found) for part in parts})


def colours(found: dict[str, Any]) -> dict[str, Any]:
    """Fig. 3a to e."""
    rows = found["colours"]
    shown = [3, 6, 9, 12, 18]
    at = [rows["counts"].index(count) for count in shown]
    body = [
        [label, noise_word(noise), *(number(rows[key][noise]["mean"][i]) for i in at)]
        for label, key in (("l1 on Gaussians", "paper"), ("camssf", "product"))
        for noise in NOISES[:2]
    ]
    head = ["method", "noise", *(f"{count}{' patches' * (count == shown[0])}" for count in shown)]
    refused = sum(rows[key][noise]["refused"] for key in ("paper", "product") for noise in NOISES[:2])
    return {"table": markdown_table(head, body), "runs": rows["paper"]["0.0"]["runs"], "refused": refused}


def correlation(found: dict[str, Any]) -> dict[str, Any]:
    """Fig. 3f."""
    body = [[name, number(row["mean"])] for name, row in found["correlation"]["tables"].items()]
    coherence = found["correlation"]["coherence_below_1"]["18"]
    return {
        "table": markdown_table(["table, patches", "mean of &#124;r&#124; over pairs"], body),
        "coherence": f"{coherence:.1e}",
    }


def methods(found: dict[str, Any]) -> str:
    """Fig. 4."""
    body = [
        [name.replace(" with non-negativity", ""), *(number(row[noise]) for noise in NOISES)]
        for name, row in found["figure_4"].items()
    ]
    return markdown_table(["method", *(noise_word(noise) for noise in NOISES)], body)


def families(found: dict[str, Any]) -> dict[str, Any]:
    """Table 1."""
    rows = found["rivals"]
    lights = list(next(iter(rows.values()))["0.0"])
    body = [
        [name, *(" ".join(number(row[noise][light]["rmse"]) for noise in NOISES) for light in lights)]
        for name, row in rows.items()
    ]
    ours, theirs = rows[PRODUCT], rows[WIENER]
    ratio = [theirs[n][light]["rmse"] / ours[n][light]["rmse"] for n in NOISES[1:] for light in lights]
    quiet = {name: row["0.0"]["D55"]["rmse"] for name, row in rows.items()}
    first = min(quiet, key=lambda name: quiet[name])
    return {"table": markdown_table(["method", *lights], body), "ratio": ratio, "first": first, "quiet": quiet[first]}


def direct(found: dict[str, Any]) -> dict[str, Any]:
    """Sec. 4."""
    rows = found["direct"]
    body = [
        [
            light,
            str(row["cameras"]),
            number(row["rmse"], 4),
            number(row["rmse_worst"], 4),
            *(number(row[role]["wavelength_error_worst_nm"], 2) for role in ("rgb", "mono")),
            *(number(row[role]["residual_nm"], 2) for role in ("rgb", "mono")),
            f"{row['rgb']['fewest_lines']}, {row['mono']['fewest_lines']}",
        ]
        for light, row in rows.items()
    ]
    pairs = [f"{what}: colour" for what in ("worst wavelength", "residual")]
    head = ["light", "cameras", "RMSE", "worst channel", pairs[0], "mono", pairs[1], "mono", "fewest lines"]
    refused = sum(row["refused"] for row in rows.values())
    return {"table": markdown_table(head, body), "refused": refused}


def _phone_cells(answer: dict[str, Any]) -> list[str]:
    """RMSRE, ΔE00, RMSE with the verdict."""
    if "refused" in answer:
        return ["", "", f"refused: `{answer['refused']}`"]
    rmse = " ".join(number(v) for v in answer["rmse"])
    return [
        " ".join(number(v, 2) for v in answer["rmsre_percent"]),
        number(answer["delta_e00"], 2),
        rmse if answer["verdict"] == "accepted" else f"{rmse} ({answer['verdict']})",
    ]


def phones(found: dict[str, Any]) -> dict[str, Any]:
    """Sec. 5."""
    rows = found["phones"]
    body = [
        [name, world, *_phone_cells(answers["gaussian"]), *_phone_cells(answers["cameras"])]
        for name, row in rows.items()
        for world, answers in row["worlds"].items()
    ]
    answers = [answer for row in rows.values() for world in row["worlds"].values() for answer in world.values()]
    score = ["RMSRE, %", "mean ΔE00", "RMSE"]
    head = ["camera", "world", f"l1: {score[0]}", *score[1:], f"camssf: {score[0]}", *score[1:]]
    worst = {name: max(v for a in answers for v in a.get(name, [0])) for name in ("rmsre_percent", "rmse")}
    return {"table": markdown_table(head, body), **worst}


def lamps(found: dict[str, Any]) -> dict[str, Any]:
    """The lamp ignored."""
    rows = found["lamps"]
    body, both = [], []
    for light in rows[PAPER]["known"]:
        pairs = [(rows[name]["known"][light], rows[name]["ignored"][light]) for name in (PAPER, PRODUCT)]
        both += pairs
        body.append([
            light,
            *(", ".join(number(row["rmse"]) for row in pair) for pair in pairs),
            *(", ".join(number(row["rmsre_percent"], 2) for row in pair) for pair in pairs),
        ])  # fmt: skip
    head = ["lamp", *(f"{score}: {who}" for score in ("RMSE", "RMSRE, %") for who in ("l1 on Gaussians", "camssf"))]
    return {
        "table": markdown_table(head, body),
        "worst": max(ignored["rmse"] / known["rmse"] for known, ignored in both),
        "largest": max(ignored["rmsre_percent"] for _, ignored in both),
    }


def atoms(found: dict[str, Any]) -> dict[str, Any]:
    """How many Gaussians."""
    rows = found["atoms"]
    counts = list(rows["0.0"])
    body = [[noise_word(noise), *(number(rows[noise][count]["rmse"]) for count in counts)] for noise in NOISES[:2]]
    refused = {c: rows["0.0"][c]["refused"] + rows["0.005"][c]["refused"] for c in counts}
    head = ["noise", *(f"{count}{' Gaussians' * (count == counts[0])}" for count in counts)]
    return {
        "table": markdown_table(head, body),
        "refused": ", ".join(f"{n} with {c}" for c, n in refused.items() if n),
    }


def charts(found: dict[str, Any]) -> dict[str, Any]:
    """Another chart, further lamps."""
    rows = found["charts"]
    columns = [rows[who][table] for who, table in (
        ("paper", "same"), ("paper", "foreign"), ("product", "same"), ("product", "foreign"), ("diagonal", "foreign"),
    )]  # fmt: skip
    body = [
        [
            light,
            *(number(column.get(light)) for column in columns[:2]),
            *(number(column[light]) for column in columns[2:]),
        ]
        for light in rows["product"]["same"]
    ]
    head = ["lamps", "l1 on Gaussians, own table", "foreign table", "camssf, own table", "foreign table"]
    gain, diagonal = (100 * (1.0 - column["D55 + A"] / column["D55"]) for column in columns[3:])
    return {"table": markdown_table([*head, "foreign table, diagonal"], body), "gain": gain, "diagonal": diagonal}


def bars(found: dict[str, Any]) -> dict[str, Any]:
    """What is met."""
    body = [
        [b["bar"], f"{b['value']:.3f}", f"{'≥' if b['at_least'] else '≤'} {b['limit']:g}"]
        for b in found["bars"]
        if not b["met"]
    ]
    missed = markdown_table(["bar missed", "value", "limit"], body) if body else ""
    return {"missed": missed, "met": len(found["bars"]) - len(body)}


def noise_word(noise: str) -> str:
    """0.005 as words."""
    return "none" if float(noise) == 0 else f"{100 * float(noise):g} %"


HEAVY = ("curves", "std", "truth", "map", "measured_srgb", "synthetic_srgb", "direct_of_one")
"""What the pictures need and the page does not."""


def light_copy(content: Any) -> Any:
    """Without the pictures' arrays, five significant digits."""
    if isinstance(content, dict):
        return {key: light_copy(value) for key, value in content.items() if key not in HEAVY}
    if isinstance(content, list):
        return [light_copy(value) for value in content]
    return float(f"{content:.5g}") if isinstance(content, float) else content


def main() -> int:
    """The command: docs/paper.json and the pictures."""
    found = json.loads((RESULTS / "paper.json").read_text("utf-8"))
    if found["every"] != 1:
        print("The last run left cameras out: run python -m benchmarks.paper without --every.", file=sys.stderr)
        return 2
    short = light_copy(found)
    draw(found, DOCS / "images")
    numbers = json.dumps(short, indent=1, ensure_ascii=False) + "\n"
    write_file(DOCS / "paper.json", numbers)
    return 0


if __name__ == "__main__":
    sys.exit(main())
