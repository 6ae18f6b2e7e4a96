"""The command line: data on stdout, words and progress on stderr, one exit status for each error family."""

from __future__ import annotations

import errno
import json
import os
import re
import sys
import tempfile
import threading
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import typer

from camssf import __version__
from camssf.errors import CalibrationError, InvalidArgument

BATCH_FAILED = PARTED = 1
INTERRUPTED = 130
BUG = 70
"""Exit statuses beside those of `camssf.errors`: a batch with failures or two results that differ, Ctrl-C, and
sysexits' EX_SOFTWARE."""

PROGRESS_AFTER = 2.0
"""Seconds of silence before a progress bar appears."""

PATCHES, RESULT = "camssf-patches/1", "camssf-result/1"
"""The formats of the documents that travel down a pipe."""

_FAULTS = (
    "black, ceiling, cfa, clipped, clipped-channel, coarse, covered, dark-iso, dark-leak, defocus, demosaiced, "
    "faded, glare, hot-pixels, mirrored, motion, printed, shading, shadow, specular, swapped, tone-mapped, "
    "two-lamps, underexposed, upside-down, vignetting, vintage, wall, white-lamp, white-level, wrong-lamp, wrong-type"
)
"""Those of `camssf.simulation.faults`, which is not loaded to print the help."""
DEMO_SIZE = (1800, 1350)
DEMO_CAMERA = "Nikon 5100 (NPL)"

app = typer.Typer(
    name="camssf",
    help="Camera spectral sensitivities, with error bands, from RAW photos of a ColorChecker.",
    epilog="Example: camssf demo -o out/",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)

Photos: TypeAlias = Annotated[
    list[str], typer.Argument(metavar="PHOTO...", help="RAW photo (DNG) of the chart, one for each lamp.")
]
Lamps: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        "--lamp",
        metavar="SPEC",
        show_default=False,
        help="Light of a photo: a CIE name, 2856K, D:5500, equal-energy or a file (see `camssf lamps`). "
        "Repeat it in the order of the photos, as --white, --dark and --corners.",
    ),
]
Whites: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        "--white",
        metavar="DNG",
        show_default=False,
        help="White frame: same place, same exposure. `none` for a photo without.",
    ),
]
Darks: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        "--dark",
        metavar="DNG",
        show_default=False,
        help="Dark frame: lens cap on, same exposure. `none` for a photo without.",
    ),
]
Chart: TypeAlias = Annotated[
    str, typer.Option(metavar="NAME|FILE", help="The chart, or a table of its reflectances.")
]
Corners: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        metavar="'X,Y X,Y X,Y X,Y'",
        show_default=False,
        help="Outer corners of the patches by hand, px: the chart's top left, top right, bottom right, "
        "bottom left. `none` for a photo where it shall be searched.",
    ),
]
WhiteReflectance: TypeAlias = Annotated[
    str | None,
    typer.Option(
        metavar="SHARE",
        show_default=False,
        help="Reflectance of the white frame's target, 0 to 1; 1 unless given.",
    ),
]
LampTolerances: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        metavar="2%|300K",
        show_default=False,
        help="How well the lamp is known, one standard deviation: 2%, 300K, or 300K,2%. In the photos' order.",
    ),
]
LensShading: TypeAlias = Annotated[
    str,
    typer.Option(
        metavar="WORD",
        help="Of a photo whose file holds a lens-shading map: as-stored, or apply. Unnecessary with a white frame.",
    ),
]
BasisName: TypeAlias = Annotated[str, typer.Option(metavar="NAME", help="gaussian (the paper's) or cameras.")]
Gamma: TypeAlias = Annotated[
    float | None,
    typer.Option(
        show_default=False,
        help="The l1 penalty γ; unless given, 0.05 on `cameras`, chosen from the measured noise on `gaussian`.",
    ),
]
L2: TypeAlias = Annotated[
    float | None,
    typer.Option(
        "--l2", show_default=False, help="The quadratic penalty λ₂; unless given, 1 on `cameras`, 0 on `gaussian`."
    ),
]
Engine: TypeAlias = Annotated[str, typer.Option(metavar="NAME", help="reference (NumPy) or onnx.")]
Fit: TypeAlias = Annotated[
    str | None,
    typer.Option(
        metavar="NUMBERS",
        show_default=False,
        help="Patches to fit, as 7-18 or 1,4,7-18; all unless given. The others validate.",
    ),
]
Signed: TypeAlias = Annotated[
    bool, typer.Option("--signed", help="Let coefficients be negative: the paper's Eq. (10) as written.")
]
Truth: TypeAlias = Annotated[
    str | None,
    typer.Option(metavar="CSV|NAME", show_default=False, help="Measured curves of this camera to compare with."),
]
Out: TypeAlias = Annotated[
    Path | None,
    typer.Option(
        "-o",
        "--out",
        metavar="FOLDER",
        show_default=False,
        help="Where the report goes; without, JSON on stdout.",
    ),
]
OutFolder: TypeAlias = Annotated[Path, typer.Option("-o", "--out", metavar="FOLDER", help="Where the files go.")]
Document: TypeAlias = Annotated[str, typer.Argument(metavar="JSON", help="A file, or - for stdin.")]


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status; no exception leaves it."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    debug = "--debug" in arguments
    try:
        typer.main.get_command(app).main([a for a in arguments if a != "--debug"], prog_name="camssf")
    except SystemExit as stop:
        status = stop.code if isinstance(stop.code, int) else int(stop.code is not None)
        if status == INTERRUPTED:
            _say("", "stopped")
        return status
    except KeyboardInterrupt:
        return INTERRUPTED
    except CalibrationError as error:
        _trace(debug)
        _say(f"[bold red]{error.code}[/]: ", error.message)
        _say("", f"  {error.advice}")
        return error.exit_status
    except Exception as error:
        _trace(debug)
        if isinstance(error, OSError) and error.errno == errno.ENOSPC:  # where click writes, as --help
            _discard_stdout()
            _say(f"[bold red]{InvalidArgument.code}[/]: ", f"{os.strerror(errno.ENOSPC)}.")
            _say("", "  Free some space, or write elsewhere.")
            return InvalidArgument.exit_status
        _say("[bold red]bug[/]: ", f"{type(error).__name__}: {' '.join(str(error).split())}")
        _say("", "  This is camssf's fault. Run it again with --debug and report what it prints.")
        return BUG
    return 0


def _version(asked: bool) -> None:
    if asked:
        _put(f"camssf {__version__}")
        raise typer.Exit


@app.callback()
def _camssf(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_version, help="Print the version and exit.")
    ] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Print the traceback of an error.")] = False,
) -> None:
    # `main` takes --debug out of the arguments, wherever it stands; it is declared here for --help.
    del version, debug


@app.command(epilog="Example: camssf demo -o out/")
def demo(
    out: OutFolder = Path("out"),
    camera: Annotated[str, typer.Option(metavar="NAME|CSV", help="Whose curves to simulate.")] = DEMO_CAMERA,
    lamp: Annotated[str, typer.Option(metavar="SPEC", help="The light.")] = "D55",
    basis: BasisName = "cameras",
    seed: Annotated[int, typer.Option(help="Of the simulated noise.")] = 0,
) -> None:
    """Simulate, calibrate, compare with truth."""
    from camssf.calibration import calibrate as run
    from camssf.documents.report import report
    from camssf.simulation.frames import Scene
    from camssf.simulation.frames import simulate as photograph

    with _progress() as progress:
        progress("simulating", 0.0)
        before = Scene(size=DEMO_SIZE, vignetting=0.3, tilt=10.0, rotation=5.0)
        scene = photograph(camera, [lamp], out / "shots", scene=before, seed=seed)
        shot = scene.shots[0]
        with _evidence(out):
            result = run(
                str(shot.chart),
                [shot.lamp],
                white=[str(shot.white)],
                dark=[str(shot.dark)],
                basis=basis,
                truth=str(scene.truth),
                progress=progress,
            )
        document = result.document()
        progress("writing the report", 0.95)
        report(document, result.previews).save(out)
    _summary(document, out)
    _finish(document)


@app.command(epilog="Example: camssf calibrate photo.dng --lamp D55 --white white.dng --dark dark.dng -o out/")
def calibrate(
    photos: Photos,
    lamp: Lamps = None,
    white: Whites = None,
    dark: Darks = None,
    chart: Chart = "classic24",
    corners: Corners = None,
    white_reflectance: WhiteReflectance = None,
    lamp_tolerance: LampTolerances = None,
    lens_shading: LensShading = "as-stored",
    basis: BasisName = "cameras",
    fit: Fit = None,
    signed: Signed = False,
    l2: L2 = None,
    gamma: Gamma = None,
    engine: Engine = "onnx",
    truth: Truth = None,
    out: Out = None,
) -> None:
    """RAW photos of a chart to the camera's curves."""
    from camssf.calibration import calibrate as run
    from camssf.documents.report import report

    with _progress() as progress:
        with _evidence(out):
            result = run(
                _paths("PHOTO", photos),
                _lamps(lamp),
                white=_frames("--white", white),
                dark=_frames("--dark", dark),
                chart=chart,
                corners=_corners(corners),
                white_reflectance=_share(white_reflectance),
                lamp_tolerance=lamp_tolerance,
                lens_shading=lens_shading,
                basis=basis,
                fit=_numbers(fit),
                nonnegative=False if signed else None,
                l2=l2,
                gamma=gamma,
                engine=engine,
                truth=truth,
                progress=progress,
            )
        document = result.document()
        if out is None:
            _emit(document)
        else:
            progress("writing the report", 0.95)
            report(document, result.previews).save(out)
    _summary(document, out)
    _finish(document)


@app.command(epilog="Example: camssf batch manifest.csv -o out/ --jobs 2")
def batch(
    manifest: Annotated[
        Path,
        typer.Argument(
            metavar="CSV", help="Columns name,photo,lamp,white,dark,chart; rows of one name are its shots."
        ),
    ],
    out: OutFolder = Path("out"),
    basis: BasisName = "cameras",
    engine: Engine = "onnx",
    lens_shading: LensShading = "as-stored",
    jobs: Annotated[
        int | None, typer.Option(min=1, show_default=False, help="Processes; all cores unless given.")
    ] = None,
) -> None:
    """Calibrate many cameras from a manifest.

    Goes on after a failure, skips what is done and unchanged.
    """
    from rich.table import Table

    from camssf.fleet.run import run_batch

    with _progress() as progress:
        outcomes = run_batch(
            manifest, out, basis=basis, engine=engine, lens_shading=lens_shading, jobs=jobs, progress=progress
        )
    table = Table("name", "status", "reason")
    for outcome in outcomes:
        colour = {"accepted": "green", "doubtful": "yellow"}.get(outcome.status, "red")
        status = f"[{colour}]{outcome.status}[/]{' (unchanged)' if outcome.resumed else ''}"
        table.add_row(_plain(outcome.name), status, _plain(outcome.reason))
    _stderr().print(table)
    failed = sum(not outcome.ok for outcome in outcomes)
    _say("", f"{len(outcomes) - failed} of {len(outcomes)} calibrated; summary in {out / 'summary.csv'}")
    if failed:
        raise typer.Exit(BATCH_FAILED)


@app.command(epilog='Example: camssf simulate --camera "Nikon 5100 (NPL)" --lamp D55 --size 1800x1350 -o shots/')
def simulate(
    out: OutFolder,
    camera: Annotated[
        str, typer.Option(metavar="NAME|CSV", help="Whose curves (see `camssf cameras`).")
    ] = DEMO_CAMERA,
    lamp: Lamps = None,
    chart: Chart = "classic24",
    size: Annotated[str, typer.Option(metavar="WxH", help="Of the picture, px.")] = "4000x3000",
    cfa: Annotated[str, typer.Option(help="RGGB, GRBG, GBRG or BGGR.")] = "RGGB",
    black: Annotated[float, typer.Option(help="Black level, DN.")] = 512.0,
    white_level: Annotated[int, typer.Option(help="Saturation, DN.")] = 16383,
    exposure: Annotated[float, typer.Option(help="White's signal as a share of full scale.")] = 0.8,
    noise: Annotated[bool, typer.Option(help="Shot and read noise.")] = True,
    seed: Annotated[int, typer.Option(help="Of the noise.")] = 0,
    vignetting: Annotated[float, typer.Option(help="Light lost in the corners, as a share.")] = 0.0,
    tilt: Annotated[float, typer.Option(help="Degrees about the vertical axis.")] = 0.0,
    rotation: Annotated[float, typer.Option(help="Degrees clockwise in the picture.")] = 0.0,
    fill: Annotated[float, typer.Option(help="Chart's width as a share of the picture's.")] = 0.6,
    blur: Annotated[float, typer.Option(help="Standard deviation, px.")] = 0.0,
    glare: Annotated[float, typer.Option(help="Veil over the chart, as a share of white.")] = 0.0,
    fault: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", show_default=False, help=f"What goes wrong with the last lamp's shot: {_FAULTS}."
        ),
    ] = None,
    severity: Annotated[
        int | None, typer.Option(show_default="2", help="Of the fault: 1, 2 or 3, the worst.")
    ] = None,
) -> None:
    """Write DNG files of a simulated camera.

    For each lamp a chart, a white and a dark frame; and truth.csv.
    """
    from camssf.simulation.faults import strike
    from camssf.simulation.frames import Scene, Sensor
    from camssf.simulation.frames import simulate as photograph

    if fault is None and severity is not None:
        raise InvalidArgument("a severity is of a fault, and none is named.", "Add --fault NAME.")
    with _progress() as progress:
        progress("simulating", 0.0)
        scene = photograph(
            camera,
            lamp or [],
            out,
            chart=chart,
            scene=Scene(
                size=_size(size),
                fill=fill,
                rotation=rotation,
                tilt=tilt,
                vignetting=vignetting,
                blur=blur,
                glare=glare,
            ),
            sensor=Sensor(cfa=cfa, black=black, white_level=white_level, exposure=exposure, noise=noise),
            seed=seed,
            change=None if fault is None else strike(fault, 2 if severity is None else severity),
        )
    shots = [
        {"lamp": s.lamp} | {role: getattr(s, role) and str(getattr(s, role)) for role in ("chart", "white", "dark")}
        for s in scene.shots
    ]
    _emit({"camera": scene.camera, "chart": scene.chart, "shots": shots, "truth": str(scene.truth)})


@app.command(epilog="Example: camssf patches photo.dng --lamp D55 > patches.json")
def patches(
    photos: Photos,
    lamp: Lamps = None,
    white: Whites = None,
    dark: Darks = None,
    chart: Chart = "classic24",
    corners: Corners = None,
    white_reflectance: WhiteReflectance = None,
    lamp_tolerance: LampTolerances = None,
    lens_shading: LensShading = "as-stored",
) -> None:
    """Measure the patches: JSON for `solve`."""
    from camssf.photo.capture import measure

    with _progress() as progress, _evidence(None):
        capture = measure(
            _paths("PHOTO", photos),
            _lamps(lamp),
            white=_frames("--white", white),
            dark=_frames("--dark", dark),
            chart=chart,
            corners=_corners(corners),
            white_reflectance=_share(white_reflectance),
            lamp_tolerance=lamp_tolerance,
            lens_shading=lens_shading,
            progress=progress,
        )
    _emit(capture.document())


@app.command(epilog="Example: camssf patches photo.dng --lamp D55 | camssf solve - > result.json")
def solve(
    document: Document = "-",
    basis: BasisName = "cameras",
    fit: Fit = None,
    signed: Signed = False,
    l2: L2 = None,
    gamma: Gamma = None,
    engine: Engine = "onnx",
    truth: Truth = None,
) -> None:
    """Patches to curves: JSON in, JSON out.

    A refusal of the command before the pipe is passed on as it is.
    """
    from camssf.calibration import solve as run
    from camssf.photo.capture import Capture

    given = _read(document, PATCHES, refusal=True)
    if given["format"] == RESULT:
        _pass_on(_sound(given))
        return
    capture = Capture.from_document(given)
    with _progress() as progress, _evidence(None):
        result = run(
            capture,
            basis=basis,
            fit=_numbers(fit),
            nonnegative=False if signed else None,
            l2=l2,
            gamma=gamma,
            engine=engine,
            truth=truth,
            progress=progress,
        )
    _pass_on(result.document())


@app.command(epilog="Example: camssf validate result.json --truth truth.csv > scored.json")
def validate(
    document: Document = "-",
    truth: Truth = None,
) -> None:
    """Score a result against measured curves.

    Passes the result on with scores.rmse and the truth filled in; without --truth as it is, once checked.
    """
    result = _result(document)
    if "ssf" in result and truth is not None:
        from camssf.calibration import compare
        from camssf.spectra import read_camera

        compare(result, read_camera(truth))
    _pass_on(result)


@app.command(epilog="Example: camssf report result.json -o out/ --photo photo.dng")
def report(
    document: Document = "-",
    out: OutFolder = Path("out"),
    photo: Annotated[
        list[str] | None,
        typer.Option(metavar="DNG", show_default=False, help="Photo of a shot, to be shown; in the shots' order."),
    ] = None,
) -> None:
    """Write result.json, ssf.csv, ssf.png and report.html."""
    from camssf.documents.report import report as render

    with _progress() as progress:
        result = _result(document)
        progress("writing the report", 0.5)
        render(result, _previews(result, photo or [])).save(out)
    _summary(result, out)
    _finish(result)


@app.command(epilog="Example: camssf direct rgb.dng mono.tif --dark dark.dng --response mono.csv -o out/")
def direct(
    frames: Annotated[
        list[str],
        typer.Argument(
            metavar="FRAME...",
            help="Sunlight's spectrum by the colour camera (DNG, or CSV pixel,red,green,blue) and by the mono camera "
            "(TIFF, DNG, or CSV pixel,signal); or one monochromator sweep (CSV wavelength_nm,red,green,blue,power).",
        ),
    ],
    dark: Annotated[
        str | None,
        typer.Option(metavar="DNG", show_default=False, help="The colour camera's frame with the slit closed."),
    ] = None,
    mono_dark: Annotated[
        str | None, typer.Option(metavar="FILE", show_default=False, help="The mono camera's frame, slit closed.")
    ] = None,
    response: Annotated[
        str | None,
        typer.Option(
            metavar="CSV",
            show_default=False,
            help="The mono camera's response, wavelength_nm,response; flat unless given.",
        ),
    ] = None,
    truth: Truth = None,
    out: Out = None,
) -> None:
    """Measure the curves with a spectrograph or a monochromator.

    The frames' wavelengths come from the Fraunhofer lines in them.
    """
    from camssf.direct import divide, sweep

    paths = _paths("FRAME", frames)
    known = None
    if truth is not None:
        from camssf.spectra import read_camera

        known = read_camera(truth)
    if len(paths) > 2 or (len(paths) == 1 and any((dark, mono_dark, response))):
        raise InvalidArgument(
            f"{len(paths)} file(s) do not fit this call.",
            "Give the colour and the mono camera's frame, or a sweep alone: a sweep takes no dark frame or response.",
        )
    with _progress() as progress:
        if len(paths) == 2:
            found = divide(paths[0], paths[1], dark=dark, mono_dark=mono_dark, response=response, progress=progress)
        else:
            found = sweep(paths[0])
        if out is None:
            _emit(found.document())
        else:
            found.save(out)
    for role, dispersion in found.dispersions.items():
        names = " ".join(line.name for line in dispersion.lines)
        _say("", f"{role}: {len(dispersion.lines)} lines ({names}), residual {dispersion.residual:.2f} nm")
    if known is not None:
        from camssf.evidence.scores import rmse

        errors = " ".join(f"{value:.4f}" for value in rmse(found.values, known.values))
        _say("", f"RMSE against the truth, red green blue: {errors}")
    if out is not None:
        _say("", f"curves: {out / 'ssf.csv'}")


@app.command(epilog="Example: camssf parity phone.json photo.dng --white white.dng")
def parity(
    document: Annotated[str, typer.Argument(metavar="JSON", help="The result to compare: a file, or - for stdin.")],
    photos: Photos,
    lamp: Annotated[
        list[str] | None,
        typer.Option(metavar="SPEC", show_default=False, help="Instead of the result's, where that was a file."),
    ] = None,
    white: Whites = None,
    dark: Darks = None,
    chart: Annotated[
        str | None,
        typer.Option(metavar="NAME|FILE", show_default=False, help="Instead of the result's, where that was a file."),
    ] = None,
    white_reflectance: WhiteReflectance = None,
    fit: Fit = None,
    signed: Signed = False,
) -> None:
    """Compare a phone's result with this computer's.

    Says which stage differs first; exits with 1 where one does.
    """
    from camssf.parity import cause, first
    from camssf.parity import parity as compare

    with _progress() as progress:
        findings = compare(
            _result(document),
            _paths("PHOTO", photos),
            white=_frames("--white", white),
            dark=_frames("--dark", dark),
            lamps=lamp or (),
            chart=chart,
            white_reflectance=_share(white_reflectance),
            fit=_numbers(fit),
            nonnegative=False if signed else None,
            progress=progress,
        )
    for each in findings:
        bound = f" ({each.measured:.2g}, bound {each.bound:.2g})" if each.bound else ""
        mark = "[green]agrees[/]" if each.agrees else "[bold red]differs[/]"
        _say(f"{each.stage:<12}{mark}: ", f"{each.words}{bound}")
    one = first(findings)
    _emit(
        {
            "format": "camssf-parity/1",
            "agrees": one is None,
            "first": None if one is None else one.stage,
            "stages": [
                vars(each) | {"measured": each.measured if each.measured < float("inf") else None}
                for each in findings
            ],
        }
    )
    if one is not None:
        _say("[bold]first difference[/]: ", f"{one.stage}. {cause(one)}")
        raise typer.Exit(PARTED)


@app.command(epilog="Example: camssf lamps | grep LED")
def lamps() -> None:
    """List the lamps known by name."""
    from camssf.spectra import lamp_names

    _put("\n".join(lamp_names()))


@app.command(epilog="Example: camssf charts")
def charts() -> None:
    """List the charts known by name."""
    from camssf.spectra import chart_names

    _put("\n".join(chart_names()))


@app.command(epilog="Example: camssf cameras")
def cameras() -> None:
    """List the measured cameras known by name."""
    from camssf.spectra import camera_names

    _put("\n".join(camera_names()))


# what the arguments mean


def _lamps(specs: list[str] | None) -> list[str]:
    if not specs:
        from camssf.spectra import read_lamp

        read_lamp("")  # its message says why a lamp is needed and lists the names
    return specs or []


def _paths(word: str, paths: list[str]) -> list[str]:
    if not all(path.strip() for path in paths):  # "" would mean this folder: often a shell variable that is not set
        raise InvalidArgument(f"A path given as {word} is empty.", "Give the path of a file.")
    return paths


def _frames(option: str, paths: list[str] | None) -> list[str | None]:
    return [None if path.casefold() == "none" else path for path in _paths(option, paths or [])]


def _corners(texts: list[str] | None) -> list[Any] | None:
    return None if texts is None else [None if t.casefold() == "none" else _four(t) for t in texts]


def _four(text: str) -> list[list[float]]:
    try:
        points = [[float(number) for number in point.split(",")] for point in text.split()]
    except ValueError:
        points = []
    if len(points) != 4 or any(len(point) != 2 for point in points):
        raise InvalidArgument(
            f"--corners {text!r} is not four points.",
            "Write the chart's top left, top right, bottom right, bottom left, as in "
            '--corners "10,20 300,22 298,210 12,208".',
        )
    return points


def _numbers(text: str | None) -> tuple[int, ...] | None:
    """`7-18` or `1,4,7-18` → patch numbers from 1."""
    if text is None:
        return None
    numbers: dict[int, None] = {}
    for part in text.split(","):
        found = re.fullmatch(r"\s*(\d{1,3})\s*(?:-\s*(\d{1,3})\s*)?", part)  # no chart has 1000 patches
        first, last = (int(found[1]), int(found[2] or found[1])) if found else (1, 0)
        if first > last:
            shown = text if len(text) <= 40 else f"{text[:40]}..."
            raise InvalidArgument(f"--fit {shown!r} is not a list of patches.", "Write 7-18, or 1,4,7-18.")
        numbers.update(dict.fromkeys(range(first, last + 1)))
    return tuple(numbers)


def _share(text: str | None) -> float | None:
    if text is None:
        return None
    try:
        return float(text)
    except ValueError:
        raise InvalidArgument(
            f"--white-reflectance {text!r} is not a number.",
            "Write the target's reflectance, for example 0.95.",
        ) from None


def _size(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"(\d{1,9})x(\d{1,9})", text.casefold())
    if not found:
        raise InvalidArgument(f"--size {text!r} is not a size.", "Write width x height, for example 4000x3000.")
    return int(found[1]), int(found[2])


# in and out


def _read(source: str, wanted: str, *, refusal: bool = False) -> dict[str, Any]:
    """The JSON document in a file or on stdin, of the wanted format; or, if that may be, a refused result."""
    from camssf.documents.report import LARGEST_DOCUMENT

    name = "Standard input" if source == "-" else source
    try:
        if source == "-":
            data = sys.stdin.buffer.read(LARGEST_DOCUMENT + 1)
        else:
            with open(source, "rb") as file:
                data = file.read(LARGEST_DOCUMENT + 1)
    except (OSError, ValueError) as error:  # ValueError: a path with a zero byte
        raise InvalidArgument(
            f"Cannot read {name}: {getattr(error, 'strerror', None) or error}.", "Check the path."
        ) from None
    if len(data) > LARGEST_DOCUMENT:
        raise InvalidArgument(f"{name} is larger than {LARGEST_DOCUMENT} bytes.", "Give what camssf wrote.")
    if not data.strip():
        raise InvalidArgument(f"{name} is empty.", "See what the command before the pipe said.")
    try:
        document = json.loads(data)
    except (ValueError, RecursionError):  # UnicodeDecodeError is a ValueError, too
        raise InvalidArgument(f"{name} is not JSON.", "Give what another camssf command wrote.") from None
    found = document.get("format") if isinstance(document, dict) else None
    if found != wanted and not (refusal and found == RESULT and _refused(document)):
        raise InvalidArgument(
            f"{name} holds {found or 'no camssf document'}, not {wanted}.",
            "The order is patches, solve, validate, report.",
        )
    return dict(document)


def _refused(document: dict[str, Any]) -> bool:
    verdict = document.get("verdict")
    return isinstance(verdict, dict) and verdict.get("status") == "refused"


def _result(source: str) -> dict[str, Any]:
    """A result document, checked against its form."""
    from camssf.documents.report import read_document

    return _sound(_read("-", RESULT)) if source == "-" else read_document(source)


def _sound(document: dict[str, Any]) -> dict[str, Any]:
    """A result document from elsewhere than a file, checked against its form."""
    from camssf.documents.report import read_document

    with tempfile.TemporaryDirectory() as aside:
        path = Path(aside, "standard input")
        path.write_text(json.dumps(document), "utf-8")
        return read_document(path)


def _previews(result: dict[str, Any], photos: list[str]) -> list[bytes | None]:
    """Pictures of the shots, each from the very file that the result was made from."""
    from camssf.photo.capture import preview
    from camssf.photo.mosaic import read_dng

    shots, previews = result["shots"], []
    if len(photos) > len(shots):
        raise InvalidArgument(
            f"{len(photos)} photos for {len(shots)} shots.", "Give --photo once a shot, in the shots' order."
        )
    for path, shot in zip(_paths("--photo", photos), shots, strict=False):
        mosaic = read_dng(path)
        if mosaic.sha256 != shot["photo"]["sha256"]:
            raise InvalidArgument(
                f"{path} is not the photo that this result was made from ({shot['photo']['name']}).",
                "Give the same file, or leave --photo out.",
            )
        previews.append(preview(mosaic))
    return previews


def _emit(document: dict[str, Any]) -> None:
    _put(json.dumps(document, allow_nan=False, ensure_ascii=False))


def _put(text: str) -> None:
    """Lines on stdout, now: a full disk must not pass unseen. A pipe that closed is the command line's to answer."""
    if sys.stdout is None:
        raise InvalidArgument("Standard output is closed.", "Leave it open, or name a folder by -o.")
    try:
        sys.stdout.write(f"{text}\n")
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        _discard_stdout()
        raise InvalidArgument(
            f"Standard output cannot be written ({error.strerror or error}).",
            "Free some space, or send it elsewhere; what arrived there is not whole.",
        ) from error


def _discard_stdout() -> None:
    """What is left in the buffer goes nowhere, or Python tries once more at its end and complains."""
    with suppress(OSError, ValueError, AttributeError):
        stdout = sys.stdout.fileno()
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stdout)
        os.close(nowhere)


def _pass_on(document: dict[str, Any]) -> None:
    """A result for the next command, its summary for the reader, and a refusal's exit status."""
    _emit(document)
    _summary(document, None)
    _finish(document)


@contextmanager
def _evidence(out: Path | None) -> Iterator[None]:
    """Leave what a refusal knows: a result without curves, as files or on stdout."""
    try:
        yield
    except CalibrationError as error:
        document = getattr(error, "evidence", None)
        if document is not None:
            try:
                if out is None:
                    _emit(document)
                else:
                    from camssf.documents.report import report

                    report(document, getattr(error, "previews", ())).save(out)
                    _say("", f"What is known of this capture lies in {out / 'report.html'}")
            except InvalidArgument as lost:  # the refusal itself matters more
                _say("", f"{lost.message} {lost.advice}")
        raise


def _summary(document: dict[str, Any], out: Path | None) -> None:
    """A table of the result on stderr."""
    from rich.table import Table

    scores, verdict = document.get("scores") or {}, document["verdict"]
    table = Table("", "red", "green", "blue", title=_plain(_title(document)), title_justify="left")
    for label, values, form in (
        ("RMSE against the truth", scores.get("rmse"), "{:.4f}"),
        ("RMSRE of unseen patches, %", scores.get("rmsre_percent"), "{:.2f}"),
        ("duality gap", document.get("gap"), "{:.0e}"),
    ):
        if values is not None:
            table.add_row(label, *("–" if v is None else form.format(v) for v in values))
    _stderr().print(table)
    colour = {"accepted": "green", "doubtful": "yellow"}.get(verdict["status"], "red")
    _say(f"verdict: [bold {colour}]{verdict['status']}[/]", "")
    for reason in verdict["reasons"]:
        _say(f"  [bold]{reason['code']}[/]: ", f"{reason['message']} {reason['advice']}")
    if out is not None:
        _say("", f"report: {out / 'report.html'}")


def _title(document: dict[str, Any]) -> str:
    camera = document.get("camera") or {}
    lights = " + ".join(str(shot["lamp"]["name"]) for shot in document.get("shots") or [])
    make, model = camera.get("make") or "", camera.get("model") or ""
    body = model if model.casefold().startswith(make.casefold()) else f"{make} {model}".strip()
    return f"{body or 'camera'}, {lights}, {document.get('basis')}"


def _finish(document: dict[str, Any]) -> None:
    """A refused document ends in its family's exit status."""
    verdict = document["verdict"]
    if verdict["status"] == "refused":
        codes = [reason["code"] for reason in verdict["reasons"]]
        raise typer.Exit(_exit_status(codes[0]) if codes else CalibrationError.exit_status)


def _exit_status(code: str) -> int:
    kinds = [CalibrationError]
    for kind in kinds:
        kinds.extend(kind.__subclasses__())
    return next((kind.exit_status for kind in kinds if kind.code == code), CalibrationError.exit_status)


def _stderr() -> Any:
    from rich.console import Console

    return Console(stderr=True, highlight=False, soft_wrap=True)


def _plain(text: str) -> str:
    from rich.markup import escape

    return escape(text)


def _say(markup: str, text: str) -> None:
    """Words on stderr; `text` is taken literally."""
    _stderr().print(f"{markup}{_plain(text)}")


def _trace(debug: bool) -> None:
    if debug:
        traceback.print_exc()


class _Bar:
    """A progress bar that shows itself only on a terminal and on work longer than PROGRESS_AFTER."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._last = ("working", 0.0)
        self._bar: Any = None
        self._timer = threading.Timer(PROGRESS_AFTER, self._show)
        self._timer.daemon = True
        self._timer.start()

    def __call__(self, stage: str, fraction: float) -> None:
        with self._lock:
            self._last = (stage, fraction)
            if self._bar is not None:
                self._bar.update(self._bar.task_ids[0], description=stage, completed=fraction)

    def _show(self) -> None:
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        console = _stderr()
        with self._lock:
            if self._timer.finished.is_set() or not console.is_terminal:
                return
            self._bar = Progress(
                TextColumn("{task.description}"),
                BarColumn(),
                TimeElapsedColumn(),
                console=console,
                transient=True,
            )
            self._bar.add_task(self._last[0], total=1.0, completed=self._last[1])
            self._bar.start()

    def close(self) -> None:
        with self._lock:
            self._timer.cancel()
            if self._bar is not None:
                self._bar.stop()


@contextmanager
def _progress() -> Iterator[_Bar]:
    bar = _Bar()
    try:
        yield bar
    finally:
        bar.close()
