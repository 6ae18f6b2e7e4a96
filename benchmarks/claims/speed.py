"""How long does a calibration take, a picture, and the colours of a live preview?

`python`: a whole calibration, from file to verdict, beside LibRaw's bare decode of the same file: a simulated chart
of 12 megapixels as lossless JPEG, with its lamp named; its picture with the uncertainty of each pixel, beside that
which LibRaw renders. `kotlin`: Kotlin's beside Python's, from the file to the
result document as JSON, also uncompressed and with the lamp not named; their curves must agree. `colour`: a mosaic
of 200 × 200 samples, a pixel a colour-filter cell, read and turned into Lab by Kotlin, under a lamp that is named and
under one that is weighed among four kinds.

One thread but for pictures, contenders in turn; a ratio is the median of each turn's. Imports, first calls and what
the JVM compiles are not counted. The last two parts need `mvn -f android-bindings package`.
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

import numpy as np
import rawpy

from benchmarks.claim import Run
from benchmarks.turns import Jvm, Unavailable, clocked, in_turn, ratio
from camssf import Options, Shot, calibrate
from camssf.documents.document import document_bytes
from camssf.photo.read.raw import read_raw
from camssf.spectra.cameras import DEMO_PHONES
from camssf_colour.picture import standard_picture
from camssf_lab.simulation.camera import Sensor
from camssf_lab.simulation.frames import simulate
from camssf_lab.simulation.scene import Scene
from golden.forms import ROOT

OPTIONS = {"runs": (9, "turns that count")}
LARGE = Scene(size=(4000, 3000))
CLOSE = 1e-9
"""Largest difference of two curves of peak 1 that is none."""
WARM = 8
"""Turns that are not counted where a JVM takes part."""
COLOURS = {"named": "colour/named", "auto": "colour/auto"}
SIDE = 200


def decode(path: Path) -> int:
    """The yardstick: LibRaw's samples and nothing else."""
    with rawpy.imread(str(path)) as raw:
        return int(raw.raw_image[-1, -1])


def rendering(path: Path) -> int:
    """LibRaw's own picture, by its default method."""
    with rawpy.imread(str(path)) as raw:
        return int(raw.postprocess(output_bps=16, use_camera_wb=True).nbytes)


def python(run: Run, folder: Path) -> None:
    """Python's calibration over a bare decode, and its picture over LibRaw's."""
    sensor, options = Sensor(compression="ljpeg"), Options(basis="cameras")
    photo = simulate("Nikon 5100 (NPL)", "D55", folder, scene=LARGE, sensor=sensor).shots[0].chart
    result = calibrate(photo, "D55", options=options)

    def picture() -> int:
        return sum(numbers.nbytes for numbers, _ in standard_picture(result, "D55", read_raw(str(photo))).strips())

    contenders = {
        "bare decode": clocked(lambda: decode(photo)),
        "calibrate": clocked(lambda: calibrate(photo, "D55", options=options)),
        "LibRaw's picture": clocked(lambda: rendering(photo)),
        "picture": clocked(picture),
    }
    taken = in_turn(contenders, run.options.runs, warm=1)
    rows = [(name, np.median(seconds)) for name, seconds in taken.items()]
    run.table("12 megapixels, lossless JPEG, Python", {"": "", "s": ".3f"}, rows)
    run.bar("calibrate over bare decode", ratio(taken["calibrate"], taken["bare decode"]), most=2.0)
    run.bar("picture over LibRaw's", ratio(taken["picture"], taken["LibRaw's picture"]), most=3.0)


def kotlin(run: Run, folder: Path) -> None:
    """Kotlin's calibration over Python's."""
    rows = []
    with Jvm("org.camssf.golden.Calibrate") as jvm:
        for storage in ("ljpeg", None):
            sensor = Sensor(compression=storage)
            made = simulate(DEMO_PHONES[0], "D55", folder / str(storage), scene=LARGE, sensor=sensor)
            for lamp in ("D55", "auto"):
                shot = Shot(made.shots[0].chart, lamp, corners=made.pose.corners)
                ours, theirs = compared(jvm, shot, folder, run.options.runs)
                words = f"{storage or 'uncompressed'}, lamp {'not ' * (lamp == 'auto')}named"
                rows.append((words, np.median(theirs), np.median(ours)))
                run.bar(f"Kotlin over Python, {words}", ratio(ours, theirs), most=0.6)
    run.table("12 megapixels, from file to document", {"": ""} | dict.fromkeys(("Python s", "Kotlin s"), ".3f"), rows)


def compared(jvm: Jvm, shot: Shot, folder: Path, runs: int) -> tuple[list[float], list[float]]:
    """Seconds of Kotlin and of Python, whose curves are the same."""
    out, documents = folder / "kotlin.json", {}
    shots = [{"photo": str(shot.photo), "lamp": shot.lamp, "corners": np.ravel(shot.corners).tolist()}]
    line = json.dumps({"shots": shots, "output": str(out)})

    def theirs() -> None:
        documents["python"] = document_bytes(calibrate([shot]))

    def ours() -> float:
        status, seconds = jvm.ask(line)
        if status != "0":
            raise Unavailable("Kotlin gave no curves; its error is above.")
        return float(seconds)

    taken = in_turn({"python": clocked(theirs), "kotlin": ours}, runs, WARM)
    one, other = (json.loads(data)["answer"]["curves"] for data in (documents["python"], out.read_bytes()))
    apart = max(float(np.abs(np.subtract(one[c], other[c])).max()) for c in ("red", "green", "blue"))
    if apart > CLOSE:
        raise Unavailable(f"The curves differ by {apart:.1e} of the peak.")
    return taken["kotlin"], taken["python"]


def colour(run: Run, _: Path) -> None:
    """Kotlin's colours of a preview."""
    rows = []
    for name, case in COLOURS.items():
        with Jvm("org.camssf.golden.Preview", str(ROOT), case, str(SIDE), "200", heap=256) as jvm:
            read, lab, pixels = map(float, jvm.ask(""))
        rows.append((name, int(pixels), read, lab))
        run.bar(f"lamp {name}: ms of reading and Lab", read + lab, most=5.0)
    run.table("Colours in Kotlin", {"lamp": "", "pixels": "d", "read, ms": ".2f", "Lab, ms": ".2f"}, rows)


def claim(run: Run) -> None:
    """A table a part."""
    with tempfile.TemporaryDirectory() as place:
        for part in (python, kotlin, colour):
            if run.wants(part.__name__):
                part(run, Path(place) / part.__name__)
