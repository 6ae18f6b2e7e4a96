"""The command `demo`: a simulated phone photographs a chart; its curves are recovered twice, and compared."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from camssf.cli.options import OutFolder
from camssf.cli.terminal import finish, product_of, progress_bar, say, summarise
from camssf.errors import InvalidArgument
from camssf.files import local_folder, write_together
from camssf.progress import Progress, part_of

if TYPE_CHECKING:
    from camssf.photo.shot import Shot
    from camssf.result import Result

SIZE = (1800, 1350)
LAMP = "D55"
NAMED = "lamp named, white and dark frame"
SHOTS = ("chart.dng", "white.dng", "dark.dng", "truth.csv", "corners.json")


def demo(out: OutFolder = Path("out")) -> None:
    """Simulate a phone, calibrate, compare with truth.

    From one photo in unnamed light, and with the lamp named; and without any photo.
    """
    with progress_bar() as progress:
        from camssf.photo.shot import Shot
        from camssf.report.build import report
        from camssf.report.provenance import read_provenance
        from camssf.spectra.cameras import DEMO_PHONE
        from camssf_lab.simulation.frames import check_replaced, simulate
        from camssf_lab.simulation.scene import Scene

        _check_replaced(out)
        check_replaced(out / "shots", SHOTS)
        progress("simulating", 0.0)
        scene = Scene(size=SIZE, vignetting=0.3, tilt=10.0, rotation=5.0)
        with write_together(out) as aside:
            made = simulate(DEMO_PHONE, [LAMP], aside / "shots", scene=scene)
            shot, truth = made.shots[0], str(made.truth)
            first = _calibrated(Shot(shot.chart), truth, out, part_of(progress, 0.1, 0.5))
            second = _calibrated(shot.shot, truth, out / "named", part_of(progress, 0.5, 0.9))
            progress("writing the reports", 0.9)
            taken = read_provenance([shot.chart])
            report(second, second.previews, provenance=taken).save(aside / "named")
            report(first, first.previews, provenance=taken).save(aside)
    say("", f"A simulated phone photographed a chart under {LAMP}. Its curves are those of no known phone.")
    summarise(first, out / "report.html", other=second, other_name=NAMED)
    say("", f"with the lamp named: {out / 'named' / 'report.html'}")
    finish(first)


def _calibrated(shot: Shot, truth: str, out: Path, progress: Progress) -> Result:
    from camssf.calibration import attempt

    return product_of(attempt(shot, truth=truth, progress=progress), out, [str(shot.photo)])


def _check_replaced(out: Path) -> None:
    """Raise InvalidArgument if a demo would replace the result of a real capture."""
    from camssf.documents.document import Document, read_document
    from camssf.report.build import holds_result
    from camssf_lab.simulation.dng import MAKE

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
