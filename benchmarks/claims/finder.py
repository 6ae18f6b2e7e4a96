"""Does camssf's own finder find the chart where OpenCV's does?

The pictures are the 18 rendered scenes of tests/photo/test_chart.py, those of `finder_drawings`, and the real photo.
A chart is found if every patch centre lies within a quarter of a pitch of the truth and the mirror is recognised;
any other pose is wrong. "Refined" is the pose moved to the borders on the mosaic; "search" is what `find_chart`
makes of both. Bars: the finder and the search find at least as many charts as cv2.mcc, the finder has no wrong pose
and the search no more than cv2.mcc, and the two refined poses agree within 0.1 pitch.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator

import numpy as np

from benchmarks.claim import Run
from benchmarks.claims.finder_drawings import DRAWINGS, EMPTY, as_mosaic, truth
from camssf.grid import Floats
from camssf.photo.find.candidates import find_candidates
from camssf.photo.find.geometry import block_corners, homography, map_points
from camssf.photo.find.picture import codes_of_mosaic
from camssf.photo.find.search import ACCEPT, OPENCV, OWN, Detector, Match, matches_in, plain_signals, refine_closely
from camssf.photo.read.dng import Mosaic, read_dng
from camssf.spectra import read_chart
from camssf.spectra.layouts import LAYOUTS

NEAR, SAME = 0.25, 0.1
WAYS = ("finder", "cv2.mcc, refined", "search")
Verdict = tuple[str, float]
"""One of found, none and wrong; the largest distance of a patch centre from the truth, pitches, or nan."""


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


def verdict(found: Floats | None, mirrored: bool, real: Floats | None, truly: bool) -> Verdict:
    """On one pose."""
    if found is None:
        return "none", np.nan
    if real is None:
        return "wrong", np.nan
    away = off(found, real)
    return ("found" if away < NEAR and mirrored == truly else "wrong"), away


def judge(
    name: str, layout: str, photo: Mosaic, real: Floats | None, mirrored: bool
) -> tuple[tuple[Verdict, ...], float]:
    """The verdicts on finder, cv2.mcc and both; how far the two refined poses are apart, pitches."""
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
    first = (candidate.patches, candidate.mirrored) if candidate else (None, False)
    ours, theirs, final = (verdict(*pose, real, mirrored) for pose in (first, opencv, both))
    apart = 0.0 if own[0] is None or opencv[0] is None or theirs[0] != "found" else off(own[0], opencv[0])
    return (ours, theirs, final), apart


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


def summed(verdicts: list[Verdict]) -> str:
    """How many of each, and the largest distance."""
    found = Counter(word for word, _ in verdicts)
    farthest = max((away for _, away in verdicts if not np.isnan(away)), default=None)
    words = ", ".join(f"{count} {word}" for word, count in found.items())
    return words if farthest is None else f"{words}; {farthest:.3f}"


def claim(run: Run) -> None:
    """A row a group of pictures."""
    groups: dict[str, list[tuple[Verdict, ...]]] = {name: [] for name in GROUPS}
    apart = 0.0
    for scene in run.track(list(scenes()), "scenes"):
        verdicts, away = judge(*scene)
        groups[next(name for name, words in GROUPS.items() if re.search(words, scene[0]))].append(verdicts)
        apart = max(apart, away)
    rows = [(name, len(own), *map(summed, map(list, zip(*own, strict=True)))) for name, own in groups.items()]
    columns = {"pictures": "", "how many": "d"} | dict.fromkeys(WAYS, "")
    run.table("Charts, and the largest distance of a patch centre in pitches", columns, rows)
    every = [row for own in groups.values() for row in own]
    counts = Counter((way, one[0]) for row in every for way, one in zip(WAYS, row, strict=True))
    finder, opencv, search = WAYS
    run.say(f"found of {len(every)}: " + ", ".join(f"{way} {counts[way, 'found']}" for way in WAYS))
    found = min(counts[finder, "found"], counts[search, "found"])
    run.bar("charts found, by finder and search", found, least=counts[opencv, "found"])
    run.bar("wrong poses of the finder", counts[finder, "wrong"], most=0)
    run.bar("wrong poses of the search", counts[search, "wrong"], most=counts[opencv, "wrong"])
    run.bar("refined poses apart, pitches", apart, most=SAME)
