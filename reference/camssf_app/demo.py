"""The command `demo`: a simulated phone photographs a chart; its curves are recovered twice, and compared.

Another simulated phone does the same, and both photograph the chart under a bulb.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from camssf.cli.options import OutFolder
from camssf.cli.terminal import finish, product_of, progress_bar, say, summarise
from camssf.errors import InvalidArgument
from camssf.files import local_folder, write_file, write_together
from camssf.progress import Progress, part_of

if TYPE_CHECKING:
    from camssf.photo.shot import Shot
    from camssf.result import Result

SIZE, SCENE_SIZE = (1800, 1350), (900, 675)
LAMP, BULB = "D55", "LED-B1"
PAGE = "pictures.html"
NAMED = "lamp named, white and dark frame"
SHOTS = ("chart.dng", "white.dng", "dark.dng", "truth.csv", "corners.json")
CHARTS, SCENES = ("", "other"), ("scene", "scene-other")
"""In `shots`, of both phones: the chart that they are calibrated from, and the chart under the bulb."""
COLOURED = 18
"""Patches of the chart that are compared: the first ones, which are not grey."""


def demo(out: OutFolder = Path("out")) -> None:
    """Simulate a phone, calibrate, compare with truth.

    From one photo in unnamed light, and with the lamp named; and without any photo. And one scene by two phones.
    """
    with progress_bar() as progress:
        from camssf.photo.shot import Shot
        from camssf.report.build import report
        from camssf.report.provenance import read_provenance
        from camssf.spectra.cameras import DEMO_PHONES
        from camssf_lab.simulation.frames import check_replaced, simulate
        from camssf_lab.simulation.scene import Scene

        _check_replaced(out)
        for folder in (*CHARTS, *SCENES):
            check_replaced(out / "shots" / folder, SHOTS)
        progress("simulating", 0.0)
        scene = Scene(size=SIZE, vignetting=0.3, tilt=10.0, rotation=5.0)
        with write_together(out) as aside:
            shot, other = (
                simulate(phone, [LAMP], aside / "shots" / folder, scene=scene).shots[0]
                for phone, folder in zip(DEMO_PHONES, CHARTS, strict=True)
            )
            truth = str(aside / "shots" / "truth.csv")
            first = _calibrated(Shot(shot.chart), truth, out, part_of(progress, 0.1, 0.4))
            named = _calibrated(shot.shot, truth, out / "named", part_of(progress, 0.4, 0.65))
            result_of_other = _calibrated(Shot(other.chart), None, out, part_of(progress, 0.65, 0.8))
            progress("comparing two phones", 0.8)
            write_file(aside / PAGE, _pictures(first, result_of_other, aside / "shots"))
            progress("writing the reports", 0.9)
            taken = read_provenance([shot.chart])
            report(named, named.previews, provenance=taken).save(aside / "named")
            report(first, first.previews, provenance=taken).save(aside)
    say("", f"A simulated phone photographed a chart under {LAMP}. Its curves are those of no known phone.")
    summarise(first, out / "report.html", other=named, other_name=NAMED)
    say("", f"with the lamp named: {out / 'named' / 'report.html'}")
    say("", f"one scene under {BULB} by two such phones, by their files' matrices and through curves: {out / PAGE}")
    finish(first)


def _calibrated(shot: Shot, truth: str | None, out: Path, progress: Progress) -> Result:
    from camssf.calibration import attempt

    return product_of(attempt(shot, truth=truth, progress=progress), out, [str(shot.photo)])


def _pictures(first: Result, other: Result, shots: Path) -> str:
    """The page of the chart under the bulb by both phones."""
    import numpy as np

    from camssf.photo.read.dng import read_dng
    from camssf.spectra import read_chart
    from camssf.spectra.cameras import DEMO_PHONES
    from camssf_colour.picture_comparison import ScenePhoto, comparison_page
    from camssf_lab.simulation.frames import simulate
    from camssf_lab.simulation.scene import Scene

    chart = read_chart("classic24")
    scenes = []
    for phone, result, folder in zip(DEMO_PHONES, (first, other), SCENES, strict=True):
        made = simulate(phone, [BULB], shots / folder, scene=Scene(size=SCENE_SIZE))
        corner, size = made.pose.patches.min(axis=1), np.ptp(made.pose.patches, axis=1)
        middle = np.concatenate([corner + 0.25 * size, 0.5 * size], axis=1)
        rectangles = [(x, y, width, height) for x, y, width, height in middle.tolist()]
        white = rectangles[chart.white], float(chart.values[chart.white].mean())
        photo = read_dng(made.shots[0].chart)
        scenes.append(ScenePhoto(f"{phone} (simulated), {BULB}", result, photo, BULB, rectangles[:COLOURED], white))
    return comparison_page(*scenes)


def _check_replaced(out: Path) -> None:
    """Raise InvalidArgument if a demo would replace the result of a real capture, or somebody's page."""
    from camssf.documents.document import Document, read_document
    from camssf.report.build import holds_result
    from camssf_lab.simulation.dng import MAKE

    if (out / PAGE).exists() and not holds_result(local_folder(out)):
        raise InvalidArgument(
            f"{out / PAGE} is not from a demo; it would be replaced.", "Choose another folder with -o."
        )
    for folder in (out, out / "named"):
        if not holds_result(local_folder(folder)):
            continue
        with suppress(InvalidArgument):
            capture = read_document(folder / "result.json", Document).capture
            if capture is not None and capture.photos and capture.photos[0].make == MAKE:
                continue
        raise InvalidArgument(
            f"{folder} holds a result that is not from a demo; it would be replaced.",
            "Choose another folder with -o.",
        )
