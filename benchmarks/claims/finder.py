"""Does camssf's own finder find the chart where OpenCV's does?

The pictures are the 18 rendered scenes of tests/photo/test_chart.py, those of `finder_drawings`, and the real photo.
A chart is found if every patch centre lies within a quarter of a pitch of the truth and the mirror is recognised;
any other pose is wrong. "Refined" is the pose moved to the borders on the mosaic; "search" is what `find_chart`
makes of both. Bars: the finder and the search find at least as many charts as cv2.mcc, the finder has no wrong pose
and the search no more than cv2.mcc, and the two refined poses agree within 0.1 pitch. `--kotlin` also searches the
drawings as previews of 640 × 480 in a warm JVM and compares with Python (bar: 1e-9 px; 25 ms by the fastest of the
rounds). `--docs` writes the table into docs/finder.md.
"""

from __future__ import annotations

import re
import subprocess
import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.claim import Run
from benchmarks.claims.finder_drawings import DRAWINGS, EMPTY, Drawing, as_mosaic, as_preview, truth
from benchmarks.kernels.turns import Unavailable
from camssf.grid import Floats
from camssf.photo.find.candidates import FoundCharts, find_candidates
from camssf.photo.find.geometry import block_corners, homography, map_points
from camssf.photo.find.picture import codes_of_bytes, codes_of_mosaic
from camssf.photo.find.search import ACCEPT, OPENCV, OWN, Detector, Match, matches_in, plain_signals, refine_closely
from camssf.photo.read.dng import Mosaic, read_dng
from camssf.spectra import read_chart
from camssf.spectra.layouts import LAYOUTS
from tools.pages import filled, write_or_check

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "finder.md"
COMMAND = "python -m benchmarks finder --docs"
OPTIONS = {
    "docs": (False, "write the table into docs/finder.md"),
    "kotlin": (False, "also Kotlin's, on previews"),
}
NEAR, SAME, QUICK, EQUAL = 0.25, 0.1, 25.0, 1e-9
Row = tuple[str, str, str, str, str, str]


def centres(match: Match, layout: str) -> Floats:
    """(n, 2) px of the patches, in the chart's order."""
    chart = LAYOUTS[layout]
    index = np.arange(chart.columns * chart.rows)
    column = index % chart.columns
    column = chart.columns - 1 - column if match.mirrored else column
    lattice = homography(block_corners(chart, match.side), match.corners)
    return map_points(lattice, np.stack([column, index // chart.columns], axis=1).astype(np.float64))


def off(found: Floats, real: Floats) -> float:
    """Largest distance in pitches; infinite for another chart."""
    if found.shape != real.shape:
        return np.inf
    return float(np.linalg.norm(found - real, axis=1).max() / np.linalg.norm(real[1:] - real[:-1], axis=1).min())


def scenes() -> Iterator[tuple[str, str, Mosaic, Floats | None, bool]]:
    """Name, layout, photo, true centres (none where no whole chart is in view), mirrored."""
    from tests.photo.test_chart import DNG, SCENES, photo_of

    for name, (scene, sensor, lamp) in SCENES.items():
        frames, photo = photo_of(scene, sensor, lamp)
        yield name, "classic24", photo, frames.pose.patches.mean(axis=1), False
    for drawing in DRAWINGS:
        yield drawing.name, drawing.chart, as_mosaic(drawing), truth(drawing)[1], drawing.mirrored
    for drawing in EMPTY:
        yield drawing.name, drawing.chart or "classic24", as_mosaic(drawing), None, False
    yield "real photo", "passport24", read_dng(DNG / "colorchart.dng"), None, False
    yield "real photo, no chart", "classic24", read_dng(DNG / "blackmagic_ljpeg.dng"), None, False


def verdict(found: Floats | None, mirrored: bool, real: Floats | None, truly: bool) -> tuple[str, float]:
    """One of found, none and wrong; the largest distance in pitches."""
    if found is None:
        return "none", np.nan
    if real is None:
        return "wrong", np.nan
    away = off(found, real)
    return ("found" if away < NEAR and mirrored == truly else "wrong"), away


def judge(name: str, layout: str, photo: Mosaic, real: Floats | None, mirrored: bool) -> tuple[Row, list[str], float]:
    """A row of the table; the verdicts on finder, cv2.mcc and both; distance of the two refined poses, pitches."""
    from tools.chart_colours import semi_gloss

    chart = LAYOUTS[layout]
    expected = plain_signals(semi_gloss() if layout == "sg140" else read_chart(layout))

    def searched(*detectors: Detector) -> tuple[Floats | None, bool]:
        best = next(iter(matches_in(photo, chart, expected, detectors)), None)
        if best is None or best.score < ACCEPT:
            return None, False
        return centres(refine_closely(photo, best, chart), layout), best.mirrored

    candidate = next(iter(find_candidates(codes_of_mosaic(photo)).candidates), None)
    own, opencv, both = searched(OWN), searched(OPENCV), searched(OWN, OPENCV)
    if name == "real photo":
        real = opencv[0]  # OpenCV is the judge: nobody measured it better
    ours, away = verdict(*((candidate.patches, candidate.mirrored) if candidate else (None, False)), real, mirrored)
    theirs, theirs_away = verdict(*opencv, real, mirrored)
    final, final_away = verdict(*both, real, mirrored)
    apart = np.nan if own[0] is None or opencv[0] is None or theirs != "found" else off(own[0], opencv[0])
    number = lambda x: "" if np.isnan(x) else f"{x:.3f}"  # noqa: E731
    words = [f"{word} {number(x)}".strip() for word, x in ((theirs, theirs_away), (final, final_away))]
    return (name, ours, number(away), words[0], number(apart), words[1]), [ours, theirs, final], apart


def kotlin(rounds: int = 10) -> tuple[float, float, float]:
    """Largest difference from Python's corners, px; median and largest ms of the drawings as previews.

    Raises:
        OSError, Unavailable: there is no Java, or no build.
    """
    from benchmarks.kernels.turns import class_path

    ours: dict[str, FoundCharts] = {}
    with tempfile.TemporaryDirectory() as folder:
        for number, drawing in enumerate((*DRAWINGS, *EMPTY)):
            small: Drawing = replace(drawing, size=(640, 480), blur=0.4 * drawing.blur)
            shown = as_preview(small)
            path = Path(folder) / f"{number:03d}.640x480.rgb"
            path.write_bytes(shown.tobytes())
            ours[path.name] = find_candidates(codes_of_bytes(shown))
        command = ["java", "-Xmx256m", "-XX:+UseSerialGC", "-cp", class_path(), "org.camssf.golden.Finding"]
        files = [str(Path(folder) / name) for name in ours]
        done = subprocess.run([*command, str(rounds), *files], stdout=subprocess.PIPE, text=True, check=False)
    lines = done.stdout.splitlines()
    if done.returncode or len(lines) != len(ours):
        raise Unavailable("Kotlin's finder failed; its error is above.")
    worst, times = 0.0, []
    for line in lines:
        cells = line.split("\t")
        seen = ours[cells[0]].candidates
        times.append(float(cells[14]))
        if bool(seen) != (cells[2] != "none"):
            return np.inf, np.nan, np.nan
        if seen:
            corners = np.array([float(x) for x in cells[6:14]]).reshape(4, 2)
            worst = max(worst, float(np.abs(corners - seen[0].corners).max()))
    return worst, float(np.median(times)), max(times)


GROUPS = {
    "no chart, or half of one": r"no chart|half out|cut off",
    "real photo": r"real photo$",
    "Semi Gloss, Nano, Mini, Passport": r"sg140|nano24|mini24|passport24",
    "several faults at once": r"all at once|rotated, tilted",
    "blurred, σ 2.5 to 8 px": r"blur",
    "10 to 90 % of the width": r"% wide|% of the width|frontal",
    "mirrored, rotated, tilted by up to 55°": r"mirrored|rotated|tilt",
    "coloured, dark or uneven light, noise": r"",
}
"""What a picture's name begins with or holds, the first that fits."""


def in_groups(rows: list[Row]) -> str:
    """The table of docs/finder.md: a group of pictures a row; what is not found in all of them is counted."""
    groups: dict[str, list[Row]] = {name: [] for name in GROUPS}
    for row in rows:
        groups[next(name for name, words in GROUPS.items() if re.search(words, row[0]))].append(row)

    def cells(texts: list[str], offs: list[str]) -> str:
        found = Counter(text.split()[0] for text in texts)
        farthest = max((float(off) for off in offs if off), default=None)
        words = ", ".join(f"{count} {verdict}" for verdict, count in found.items())
        return words if farthest is None else f"{words}; {farthest:.3f}"

    lines = ["| pictures | finder | cv2.mcc, refined | search |", "| --- | --- | --- | --- |"]
    for name, group in groups.items():
        ours = cells([row[1] for row in group], [row[2] for row in group])
        others = [cells([row[at] for row in group], [row[at].partition(" ")[2] for row in group]) for at in (3, 5)]
        lines.append(f"| {name} | {ours} | {others[0]} | {others[1]} |")
    return "\n".join(lines)


def claim(run: Run) -> None:
    """A row a picture; Kotlin's on request."""
    rows: list[Row] = []
    counts: Counter[str] = Counter()
    apart = 0.0
    for scene in run.track(list(scenes()), "scenes"):
        row, verdicts, refined = judge(*scene)
        rows.append(row)
        counts.update(f"{who} {word}" for who, word in zip(("ours", "cv2", "search"), verdicts, strict=True))
        apart = max(apart, 0.0 if np.isnan(refined) else refined)
    head = ("picture", "finder", "off, pitches", "cv2.mcc, refined", "refined, apart", "search")
    run.table("camssf's finder, OpenCV's, and the search with both", dict.fromkeys(head, ""), rows)
    summary = (
        f"Of {len(rows)} pictures the finder found the chart in {counts['ours found']}, cv2.mcc in "
        f"{counts['cv2 found']}, the search in {counts['search found']}; wrong poses: {counts['ours wrong']}, "
        f"{counts['cv2 wrong']} and {counts['search wrong']}. Refined on the mosaic, finder and cv2.mcc lie at most "
        f"{apart:.1g} pitch apart."
    )
    run.bar(
        "charts found, by finder and search",
        min(counts["ours found"], counts["search found"]),
        least=counts["cv2 found"],
    )
    run.bar("wrong poses of the finder", counts["ours wrong"], most=0)
    run.bar("wrong poses of the search", counts["search wrong"], most=counts["cv2 wrong"])
    run.bar("refined poses apart, pitches", apart, most=SAME)
    if run.options.kotlin:
        worst, median, slowest = kotlin()
        summary += (
            f" Kotlin on {len(DRAWINGS) + len(EMPTY)} previews of 640 × 480: corners within {worst:.1g} px of "
            f"Python's; {median:.1f} ms a picture (median), {slowest:.1f} ms at most."
        )
        run.bar("Kotlin: corners off Python's, px", worst, most=EQUAL)
        run.bar("Kotlin: ms of a picture", slowest, most=QUICK)
    run.say(summary)
    if run.options.docs:
        page = filled(PAGE.read_text("utf-8"), {COMMAND: f"{summary}\n\n{in_groups(rows)}"})
        write_or_check(COMMAND, PAGE.parent, {PAGE.name: page}, check=False)
