"""docs/paper.json and its pictures, from the last run's numbers, and the site's page: `python -m tools.paper_page`.

`python -m benchmarks paper` measures them. Every number of the page is in docs/paper.json, but for the paper's own.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
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
    parts = (colours, correlation, methods, families, direct, phones, lamps, bars)
    return template("paper.md", found=found, number=number, **{part.__name__: part(found) for part in parts})


def counted(counts: Sequence[Any], unit: str) -> list[str]:
    """Heads of columns, the first with its unit."""
    return [f"{count}{f' {unit}' * (i == 0)}" for i, count in enumerate(counts)]


def colours(found: dict[str, Any]) -> dict[str, Any]:
    """Fig. 3a to e."""
    rows, shown = found["colours"], [3, 6, 9, 12, 18]
    at = [rows["counts"].index(count) for count in shown]
    body = [
        [label, noise_word(noise), *(number(rows[key][noise]["mean"][i]) for i in at)]
        for label, key in (("l1 on Gaussians", "paper"), ("camssf", "product"))
        for noise in NOISES[:2]
    ]
    refused = sum(rows[key][noise]["refused"] for key in ("paper", "product") for noise in NOISES[:2])
    table = markdown_table(["method", "noise", *counted(shown, "patches")], body)
    return {"table": table, "runs": rows["paper"]["0.0"]["runs"], "refused": refused}


def correlation(found: dict[str, Any]) -> dict[str, Any]:
    """Fig. 3f."""
    body = [[name, number(row["mean"])] for name, row in found["correlation"]["tables"].items()]
    coherence = f"{found['correlation']['coherence_below_1']:.1e}"
    return {
        "table": markdown_table(["table, patches", "mean of &#124;r&#124; over pairs"], body),
        "coherence": coherence,
    }


def methods(found: dict[str, Any]) -> str:
    """Fig. 4."""
    body = [
        [name.replace(" with non-negativity", ""), *(number(row[noise]) for noise in NOISES)]
        for name, row in found["figure_4"].items()
    ]
    return markdown_table(["method", *map(noise_word, NOISES)], body)


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
    first = min(quiet, key=quiet.__getitem__)
    return {"table": markdown_table(["method", *lights], body), "ratio": ratio, "first": first, "quiet": quiet[first]}


def direct(found: dict[str, Any]) -> dict[str, Any]:
    """Sec. 4."""
    rows, roles = found["direct"], ("rgb", "mono")
    body = [
        [light, str(row["cameras"]), number(row["rmse"], 4), number(row["rmse_worst"], 4)]
        + [number(row[role][key], 2) for key in ("wavelength_error_worst_nm", "residual_nm") for role in roles]
        + [", ".join(str(row[role]["fewest_lines"]) for role in roles)]
        for light, row in rows.items()
    ]
    head = [
        "light", "cameras", "RMSE", "worst channel", "worst wavelength: colour", "mono", "residual: colour", "mono",
        "fewest lines",
    ]  # fmt: skip
    return {"table": markdown_table(head, body), "refused": sum(row["refused"] for row in rows.values())}


def _phone_cells(answer: dict[str, Any]) -> list[str]:
    """RMSRE, ΔE00, RMSE with the verdict."""
    if "refused" in answer:
        return ["", "", f"refused: `{answer['refused']}`"]
    relative, rmse = (" ".join(number(v, n) for v in answer[key]) for key, n in (("rmsre_percent", 2), ("rmse", 3)))
    doubt = "" if answer["verdict"] == "accepted" else f" ({answer['verdict']})"
    return [relative, number(answer["delta_e00"], 2), rmse + doubt]


def phones(found: dict[str, Any]) -> dict[str, Any]:
    """Sec. 5."""
    worlds = [(name, *world) for name, row in found["phones"].items() for world in row["worlds"].items()]
    body = [
        [name, world, *_phone_cells(answers["gaussian"]), *_phone_cells(answers["cameras"])]
        for name, world, answers in worlds
    ]
    answers = [answer for *_, methods in worlds for answer in methods.values()]
    score = ["RMSRE, %", "mean ΔE00", "RMSE"]
    head = ["camera", "world", f"l1: {score[0]}", *score[1:], f"camssf: {score[0]}", *score[1:]]
    worst = {name: max(v for a in answers for v in a.get(name, [0])) for name in ("rmsre_percent", "rmse")}
    return {"table": markdown_table(head, body), **worst}


def lamps(found: dict[str, Any]) -> dict[str, Any]:
    """The lamp ignored."""
    rows = found["lamps"]
    body, both = [], []
    for light in rows[PAPER]["known"]:
        pairs = [[rows[name][case][light] for case in ("known", "ignored")] for name in (PAPER, PRODUCT)]
        both += pairs
        scores = (("rmse", 3), ("rmsre_percent", 2))
        body.append([light, *(", ".join(number(row[key], n) for row in pair) for key, n in scores for pair in pairs)])
    head = ["lamp", *(f"{score}: {who}" for score in ("RMSE", "RMSRE, %") for who in ("l1 on Gaussians", "camssf"))]
    worst = max(ignored["rmse"] / known["rmse"] for known, ignored in both)
    largest = max(ignored["rmsre_percent"] for _, ignored in both)
    return {"table": markdown_table(head, body), "worst": worst, "largest": largest}


def bars(found: dict[str, Any]) -> dict[str, Any]:
    """What is met."""
    body = [[bar["bar"], f"{bar['value']:.3f}", bar["limit"]] for bar in found["bars"] if not bar["met"]]
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
        print("The last run left cameras out: run python -m benchmarks paper without --every.", file=sys.stderr)
        return 2
    draw(found, DOCS / "images")
    write_file(DOCS / "paper.json", json.dumps(light_copy(found), indent=1, ensure_ascii=False) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
