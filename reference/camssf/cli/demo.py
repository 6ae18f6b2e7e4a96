"""The command `demo`: a simulated phone photographs a chart; its curves are recovered twice, and compared."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from camssf.cli.options import OutFolder
from camssf.cli.terminal import finish, product_of, progress_bar, say, summarise
from camssf.errors import InvalidArgument
from camssf.files import local_folder

if TYPE_CHECKING:
    from camssf.photo.shot import Shot
    from camssf.result import Calibration

SIZE = (1800, 1350)
NAMED = "lamp named, white and dark frame"


def demo(
    out: OutFolder = Path("out"),
    lamp: Annotated[str, typer.Option(metavar="SPEC", help="The light of the photo.")] = "D55",
    seed: Annotated[int, typer.Option(help="Seed of the simulated noise.")] = 0,
) -> None:
    """Simulate a phone, calibrate, compare with truth.

    From one photo in unnamed light, and with the lamp named; and without any photo.
    """
    from camssf.photo.shot import Shot
    from camssf.report.build import report
    from camssf.report.provenance import read_provenance
    from camssf.simulation.frames import simulate
    from camssf.simulation.scene import Scene
    from camssf.spectra.cameras import DEMO_PHONE

    _check_replaced(out)
    with progress_bar() as progress:
        progress("simulating", 0.0)
        scene = Scene(size=SIZE, vignetting=0.3, tilt=10.0, rotation=5.0)
        made = simulate(DEMO_PHONE, [lamp], out / "shots", scene=scene, seed=seed)
        shot, truth = made.shots[0], str(made.truth)
        progress("light not named", 0.1)
        first = _calibrated(Shot(shot.chart), truth, out)
        progress("lamp named", 0.5)
        second = _calibrated(shot.shot, truth, out / "named")
        progress("writing the reports", 0.9)
        taken = read_provenance([shot.chart])
        document, named = first.document(), second.document()
        report(named, second.previews, provenance=taken).save(out / "named")
        report(document, first.previews, provenance=replace(taken, other=named, other_name=NAMED)).save(out)
    say("", f"A simulated phone photographed a chart under {lamp}. Its curves are those of no known phone.")
    summarise(document, out / "report.html", other=named, other_name=NAMED)
    say("", f"with the lamp named: {out / 'named' / 'report.html'}")
    finish(document)


def _calibrated(shot: Shot, truth: str, out: Path) -> Calibration:
    from camssf.calibration import attempt

    return product_of(attempt(shot, truth=truth), out, [str(shot.photo)])


def _check_replaced(out: Path) -> None:
    """Raise InvalidArgument if a demo would replace the result of a real capture."""
    from camssf.documents.result_json import read_document
    from camssf.report.build import holds_result
    from camssf.simulation.dng import MAKE

    for folder in (out, out / "named"):
        if not holds_result(local_folder(folder)):
            continue
        with suppress(InvalidArgument):
            if read_document(folder / "result.json")["camera"]["make"] == MAKE:
                continue
        raise InvalidArgument(
            f"{folder} holds a result that is not from a demo; it would be replaced.",
            "Choose another folder with -o.",
        )
