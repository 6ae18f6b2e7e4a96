"""Does camssf's own chart finder find what OpenCV's does? `python -m benchmarks.claims.finder [--docs] [--kotlin]`

The 18 rendered scenes of tests/test_chart.py, the pictures of `finder_drawings` and the real photo. A chart is found
where every patch centre lies within a quarter of a pitch of the truth and the mirror is told; a pose that is further
off, of another kind or where there is no whole chart is wrong. "Refined" is the finder's pose moved to the borders on
the mosaic (`match_near`, `finer`) against cv2.mcc's, refined by the same rule. Bars: at least as many as cv2.mcc, no
wrong pose, refined within 0.1 patch. `--kotlin` also searches the drawings as previews of 640 × 480 in a warm JVM and
compares with Python (bar: 1e-9 px; 25 ms by the least of the rounds). `--docs` writes the table into docs/finder.md.
Exit status 1 where a bar is missed.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.claims.finder_drawings import DRAWINGS, EMPTY, Drawing, as_mosaic, as_preview, truth
from benchmarks.shared import command_parser, console, progress, save, table, versions
from camssf.grid import Floats
from camssf.photo.find.layouts import LAYOUTS, block_corners, homography, map_points
from camssf.photo.find.picture import codes_of_bytes, codes_of_mosaic
from camssf.photo.find.search import ACCEPT, Match, finer, match_near, matches_in, plain_signals
from camssf.photo.find.sightings import FoundCharts, find_sightings
from camssf.photo.read.dng import Mosaic, read_dng
from camssf.spectra import read_chart

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "finder.md"
BEGIN, END = "<!-- python -m benchmarks.claims.finder --docs -->", "<!-- end -->"
NEAR, SAME, QUICK, EQUAL = 0.25, 0.1, 25.0, 1e-9
Row = tuple[str, str, str, str, str]


def centres(match: Match, layout: str) -> Floats:
    """(n, 2) px of the patches, in the chart's order."""
    known = LAYOUTS[layout]
    index = np.arange(known.columns * known.rows)
    column = index % known.columns
    column = known.columns - 1 - column if match.mirrored else column
    lattice = homography(block_corners(known, match.side), match.corners)
    return map_points(lattice, np.stack([column, index // known.columns], axis=1).astype(np.float64))


def off(found: Floats, real: Floats) -> float:
    """Largest distance in pitches; infinite for another chart."""
    if found.shape != real.shape:
        return np.inf
    return float(np.linalg.norm(found - real, axis=1).max() / np.linalg.norm(real[1:] - real[:-1], axis=1).min())


def scenes() -> Iterator[tuple[str, str, Mosaic, Floats | None, bool]]:
    """Name, layout, photo, true centres (none where no whole chart is in view), mirrored."""
    from tests.test_chart import DNG, SCENES, photo_of

    for name, (scene, sensor, lamp) in SCENES.items():
        frames, photo = photo_of(scene, sensor, lamp)
        yield name, "classic24", photo, frames.pose.patches.mean(axis=1), False
    for drawing in DRAWINGS:
        yield drawing.name, drawing.chart, as_mosaic(drawing), truth(drawing)[1], drawing.mirrored
    for drawing in EMPTY:
        yield drawing.name, drawing.chart or "classic24", as_mosaic(drawing), None, False
    yield "real photo", "passport24", read_dng(DNG / "colorchart.dng"), None, False
    yield "real photo, no chart", "classic24", read_dng(DNG / "blackmagic_ljpeg.dng"), None, False


def verdict(found: Floats | None, mirrored: bool, real: Floats | None, told: bool) -> tuple[str, float]:
    """One of found, none and wrong; how far off."""
    if found is None:
        return "none", np.nan
    if real is None:
        return "wrong", np.nan
    away = off(found, real)
    return ("found" if away < NEAR and mirrored == told else "wrong"), away


def judge(name: str, layout: str, photo: Mosaic, real: Floats | None, told: bool) -> tuple[Row, str, str, float]:
    """A row of the table, both verdicts, and how far the refined poses lie from each other."""
    sighting = next(iter(find_sightings(codes_of_mosaic(photo)).sightings), None)
    from tools.chart_colours import semi_gloss

    expected = plain_signals(semi_gloss() if layout == "sg140" else read_chart(layout))
    known = LAYOUTS[layout]
    best = next(iter(matches_in(photo, known, expected)), None)
    best = best if best is not None and best.score >= ACCEPT else None
    theirs = None if best is None else centres(finer(photo, best, known), layout)
    if name == "real photo":
        real = theirs  # OpenCV is the judge: nobody measured it better
    ours, away = verdict(
        None if sighting is None else sighting.patches, sighting is not None and sighting.mirrored, real, told
    )
    cv2, theirs_away = verdict(theirs, best is not None and best.mirrored, real, told)
    refined = np.nan
    if ours == "found" and cv2 == "found" and sighting is not None and theirs is not None:
        match = match_near(photo, sighting.corners, known, expected)
        refined = off(centres(finer(photo, match, known), layout), theirs)
    number = lambda x: "" if np.isnan(x) else f"{x:.3f}"  # noqa: E731
    return (name, ours, number(away), f"{cv2} {number(theirs_away)}".strip(), number(refined)), ours, cv2, refined


def kotlin(rounds: int = 10) -> tuple[float, float, float]:
    """Largest difference from Python's corners, px; median and largest ms of the drawings as previews.

    Raises:
        OSError, benchmarks.kernels.kotlin_calibrate.Unavailable: there is no Java, or no build.
    """
    from benchmarks.kernels.kotlin_calibrate import Unavailable, class_path

    ours: dict[str, FoundCharts] = {}
    with tempfile.TemporaryDirectory() as folder:
        for number, drawing in enumerate((*DRAWINGS, *EMPTY)):
            small: Drawing = replace(drawing, size=(640, 480), blur=0.4 * drawing.blur)
            shown = as_preview(small)
            path = Path(folder) / f"{number:03d}.640x480.rgb"
            path.write_bytes(shown.tobytes())
            ours[path.name] = find_sightings(codes_of_bytes(shown))
        command = ["java", "-Xmx256m", "-XX:+UseSerialGC", "-cp", class_path(), "org.camssf.golden.Finding"]
        files = [str(Path(folder) / name) for name in ours]
        done = subprocess.run([*command, str(rounds), *files], stdout=subprocess.PIPE, text=True, check=False)
    lines = done.stdout.splitlines()
    if done.returncode or len(lines) != len(ours):
        raise Unavailable("Kotlin's finder failed; its error is above.")
    worst, times = 0.0, []
    for line in lines:
        cells = line.split("\t")
        seen = ours[cells[0]].sightings
        times.append(float(cells[14]))
        if bool(seen) != (cells[2] != "none"):
            return np.inf, np.nan, np.nan
        if seen:
            corners = np.array([float(x) for x in cells[6:14]]).reshape(4, 2)
            worst = max(worst, float(np.abs(corners - seen[0].corners).max()))
    return worst, float(np.median(times)), max(times)


def main() -> int:
    """Runs, prints, saves; 1 where a bar is missed."""
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("--docs", action="store_true", help="write the table into docs/finder.md")
    parser.add_argument("--kotlin", action="store_true", help="also Kotlin's, on previews")
    options = parser.parse_args()
    rows: list[Row] = []
    counts: Counter[str] = Counter()
    apart = 0.0
    with progress() as bar:
        for scene in bar.track(list(scenes()), description="scenes"):
            row, ours, cv2, refined = judge(*scene)
            rows.append(row)
            counts[f"ours {ours}"] += 1
            counts[f"cv2 {cv2}"] += 1
            apart = max(apart, 0.0 if np.isnan(refined) else refined)
    head = ("picture", "finder", "off, pitches", "cv2.mcc, refined", "refined, apart")
    console().print(table("camssf's finder and OpenCV's", head, rows))
    said = (
        f"Of {len(rows)} pictures the finder found the chart in {counts['ours found']}, cv2.mcc in "
        f"{counts['cv2 found']}; wrong poses: {counts['ours wrong']} and {counts['cv2 wrong']}. "
        f"Refined on the mosaic, the two lie at most {apart:.1g} pitch apart."
    )
    print(said)
    good = counts["ours found"] >= counts["cv2 found"] and counts["ours wrong"] == 0 and apart < SAME
    result: dict[str, object] = {"versions": versions(), "counts": dict(counts), "apart": apart}
    if options.kotlin:
        worst, median, slowest = kotlin()
        spoken = (
            f"Kotlin on {len(DRAWINGS) + len(EMPTY)} previews of 640 × 480: corners within {worst:.1g} px of "
            f"Python's; {median:.1f} ms a picture (median), {slowest:.1f} ms at most."
        )
        print(spoken)
        said += " " + spoken
        good = good and worst <= EQUAL and slowest <= QUICK
        result["kotlin"] = {"worst": worst, "median": median, "slowest": slowest}
    if options.docs:
        lines = ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
        lines += ["| " + " | ".join(row) + " |" for row in rows]
        page = PAGE.read_text("utf-8")
        before, rest = page.split(BEGIN)
        after = rest.split(END, 1)[1]
        body = "\n".join(lines)
        PAGE.write_text(f"{before}{BEGIN}\n{said}\n\n{body}\n{END}{after}", "utf-8")
    print(save("finder", result))
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
