"""Commands that start from photos: calibrate and batch; and simulate, which writes some."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from camssf.cli.options import (
    L2,
    BasisName,
    Chart,
    ChartTolerance,
    Corners,
    Darks,
    Engine,
    Fit,
    Gamma,
    Lamps,
    LampTolerances,
    LensShading,
    LightPerPatch,
    Out,
    OutFolder,
    Photos,
    Previous,
    Signed,
    Truth,
    WhiteReflectance,
    Whites,
)
from camssf.cli.reading import (
    parse_chart,
    parse_patches,
    parse_percent,
    parse_share,
    parse_shots,
    parse_size,
)
from camssf.cli.terminal import BATCH_FAILED, emit, finish, literal, product_of, progress_bar, say, stderr, summarise
from camssf.errors import InvalidArgument

if TYPE_CHECKING:
    from camssf.fleet.outcome import Outcome, Summary
    from camssf.simulation.frames import Simulation

FAULTS = (
    "black, ceiling, cfa, clipped, clipped-channel, coarse, covered, dark-iso, dark-leak, defocus, demosaiced, "
    "faded, glare, hot-pixels, mirrored, motion, printed, shading, shadow, specular, swapped, tone-mapped, "
    "two-lamps, underexposed, upside-down, vignetting, vintage, wall, white-lamp, white-level, wrong-lamp, wrong-type"
)
"""Names in `camssf.simulation.faults`, repeated here so that the help does not load it."""
AGAIN = "Once the causes are mended, run the same command again: what is done is not done again."
STOPPED = "Run the same command again to resume: what is done is not done again."
MOST_MODELS = 20
"""Largest number of models in a batch's summary on the terminal; the JSON has all."""
DEMO_PHONE = "Demo phone"
"""`camssf.spectra.cameras.DEMO_PHONE`, repeated likewise."""


def calibrate(
    photos: Photos,
    lamp: Lamps = None,
    white: Whites = None,
    dark: Darks = None,
    chart: Chart = "classic24",
    corners: Corners = None,
    white_reflectance: WhiteReflectance = None,
    lamp_tolerance: LampTolerances = None,
    chart_tolerance: ChartTolerance = None,
    lens_shading: LensShading = "as-stored",
    basis: BasisName = "auto",
    fit: Fit = None,
    signed: Signed = False,
    l2: L2 = None,
    gamma: Gamma = None,
    engine: Engine = "onnx",
    light_per_patch: LightPerPatch = None,
    previous: Previous = None,
    truth: Truth = None,
    out: Out = None,
) -> None:
    """RAW photos of a chart to the camera's curves."""
    from camssf.calibration import attempt
    from camssf.options import Options
    from camssf.report.build import report, result_folder, verdict_in
    from camssf.report.provenance import read_provenance

    if out is not None:
        result_folder(out)
        if previous is not None and Path(previous).resolve().parent == out.resolve():
            raise InvalidArgument(f"{out} holds the previous result.", "Name another folder with -o: keep that one.")
    with progress_bar() as progress:
        result = product_of(
            attempt(
                parse_shots(
                    photos,
                    lamp,
                    white,
                    dark,
                    corners=corners,
                    lamp_tolerance=lamp_tolerance,
                    lens_shading=lens_shading,
                ),
                chart=parse_chart(chart, chart_tolerance),
                options=Options(
                    white_reflectance=parse_share(white_reflectance),
                    basis=basis,
                    fit=parse_patches(fit),
                    nonnegative=False if signed else None,
                    l2=l2,
                    gamma=gamma,
                    engine=engine,
                    light_per_patch=parse_percent("--light-per-patch", light_per_patch),
                ),
                truth=truth,
                previous=previous,
                progress=progress,
            ),
            out,
            photos,
        )
        document = result.document()
        if out is None:
            emit(document)
        else:
            progress("writing the report", 0.95)
            page = report(document, result.previews, provenance=read_provenance(photos))
            if document["verdict"]["status"] == "doubtful" and verdict_in(out) == "accepted":
                say("", f"{out} held an accepted result; this doubtful one takes its place")
            page.save(out)
    summarise(document, None if out is None else out / "report.html")
    finish(document)


def batch(
    manifest: Annotated[
        str,
        typer.Argument(
            metavar="CSV", help="Columns name,photo,lamp,white,dark,chart; rows of one name are its shots."
        ),
    ],
    out: Annotated[
        str, typer.Option("-o", "--out", metavar="FOLDER", help="Output folder; with a registry also a URL.")
    ] = "out",
    basis: BasisName = "auto",
    engine: Engine = "onnx",
    lens_shading: LensShading = "as-stored",
    jobs: Annotated[
        int | None,
        typer.Option("--jobs", "--workers", min=1, show_default=False, help="Processes; all cores unless given."),
    ] = None,
    dask: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            show_default=False,
            help="With a registry: address of a Dask scheduler, as tcp://host:8786, whose workers do the jobs.",
        ),
    ] = None,
    registry: Annotated[
        str | None,
        typer.Option(
            metavar="FOLDER",
            show_default=False,
            help="Registry that the results go to; with it the manifest may be of any size and have further columns.",
        ),
    ] = None,
    pages: Annotated[
        bool, typer.Option("--pages", help="With a registry: report.html, ssf.png, ssf.csv, too.")
    ] = False,
) -> None:
    """Calibrate many cameras from a manifest.

    Goes on after a failure, skips what is done and unchanged.
    """
    from camssf.fleet.batch import run_batch
    from camssf.fleet.manifest import Manifest
    from camssf.fleet.registry import Registry

    if registry is not None and dask is not None and jobs is not None:
        raise InvalidArgument("--workers and --dask exclude each other.", "Give one of the two.")
    rows = Manifest(manifest, basis=basis, engine=engine, lens_shading=lens_shading)
    rows_to = None if registry is None else Registry(registry, new=True)
    try:
        with progress_bar() as progress:
            found = run_batch(rows, out, rows_to, workers=jobs, dask=dask, pages=pages, progress=progress)
    except KeyboardInterrupt:
        say("", STOPPED)
        raise
    done = f"{found.total - found.failed} of {found.total} calibrated"
    if registry is None:
        _say_outcomes(found.outcomes)
        say("", f"{done}; summary in {Path(out) / 'summary.csv'}")
    else:
        emit(found.document())
        _say_numbers(found)
        say("", f"{done} ({found.resumed} from before, {found.duplicates} duplicates); rows in {registry}")
    if found.failed:
        say("", AGAIN)
        raise typer.Exit(BATCH_FAILED)


def _say_outcomes(outcomes: Sequence[Outcome]) -> None:
    """Print a table with a line for each job."""
    from rich.table import Table

    table = Table("name", "status", "reason")
    for outcome in outcomes:
        colour = {"accepted": "green", "doubtful": "yellow"}.get(outcome.status, "red")
        status = f"[{colour}]{outcome.status}[/]{' (unchanged)' if outcome.resumed else ''}"
        table.add_row(literal(outcome.name), status, literal(outcome.reason))
    stderr().print(table)


def _say_numbers(found: Summary) -> None:
    """Print the numbers of jobs by model and by reason."""
    models = sorted(found.by_model.items(), key=lambda each: (-each[1].total(), each[0]))
    for model, counts in models[:MOST_MODELS]:
        each = ", ".join(f"{count} {word}" for word, count in counts.items())
        say("", f"{counts.total():>8} {model or 'of an unknown model'}: {each}")
    if len(models) > MOST_MODELS:
        say("", f"         and {len(models) - MOST_MODELS} more models")
    for code, count in found.by_code.most_common():
        say("", f"{count:>8} {code}")
    if crashed := found.by_status["failed"]:
        say("", f"{crashed:>8} failed: a process died, or a fault of camssf")


def simulate(
    out: OutFolder,
    camera: Annotated[
        str, typer.Option(metavar="NAME|CSV", help="Whose curves (see `camssf cameras`).")
    ] = DEMO_PHONE,
    make: Annotated[str, typer.Option(metavar="TEXT", show_default="camssf", help="Maker that the files name.")] = "",
    model: Annotated[
        str, typer.Option(metavar="TEXT", show_default="the camera's name", help="Model that the files name.")
    ] = "",
    lamp: Annotated[
        list[str] | None,
        typer.Option(
            metavar="SPEC",
            show_default=False,
            help="Lamp of a photo: a CIE name, 2856K, D:5500, equal-energy or a file. Repeat it for more photos.",
        ),
    ] = None,
    chart: Chart = "classic24",
    size: Annotated[str, typer.Option(metavar="WxH", help="Size of the picture, px.")] = "4000x3000",
    cfa: Annotated[str, typer.Option(help="RGGB, GRBG, GBRG or BGGR.")] = "RGGB",
    black: Annotated[float, typer.Option(help="Black level, DN.")] = 512.0,
    white_level: Annotated[int, typer.Option(help="Saturation, DN.")] = 16383,
    exposure: Annotated[float, typer.Option(help="White's signal as a share of full scale.")] = 0.8,
    noise: Annotated[bool, typer.Option(help="Shot and read noise.")] = True,
    seed: Annotated[int, typer.Option(help="Seed of the noise.")] = 0,
    vignetting: Annotated[float, typer.Option(help="Light lost in the corners, as a share.")] = 0.0,
    tilt: Annotated[float, typer.Option(help="Degrees about the vertical axis.")] = 0.0,
    rotation: Annotated[float, typer.Option(help="Degrees clockwise in the picture.")] = 0.0,
    fill: Annotated[float, typer.Option(help="Chart's width as a share of the picture's.")] = 0.6,
    blur: Annotated[float, typer.Option(help="Standard deviation, px.")] = 0.0,
    glare: Annotated[float, typer.Option(help="Stray light over the chart, as a share of white.")] = 0.0,
    fault: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", show_default=False, help=f"What goes wrong with the last lamp's shot: {FAULTS}."
        ),
    ] = None,
    severity: Annotated[
        int | None, typer.Option(show_default="2", help="Severity of the fault: 1, 2 or 3 (worst).")
    ] = None,
) -> None:
    """Write DNG files of a simulated camera.

    For each lamp a chart, a white and a dark frame; and truth.csv and corners.json.
    """
    from camssf.simulation.camera import Sensor
    from camssf.simulation.faults import apply_fault
    from camssf.simulation.frames import simulate as photograph
    from camssf.simulation.scene import Scene

    if fault is None and severity is not None:
        raise InvalidArgument("--severity needs --fault.", "Add --fault NAME.")
    with progress_bar() as progress:
        progress("simulating", 0.0)
        scene = photograph(
            camera,
            lamp or [],
            out,
            chart=chart,
            scene=Scene(
                size=parse_size(size),
                fill=fill,
                rotation=rotation,
                tilt=tilt,
                vignetting=vignetting,
                blur=blur,
                glare=glare,
            ),
            sensor=Sensor(
                cfa=cfa, black=black, white_level=white_level, exposure=exposure, noise=noise, make=make, model=model
            ),
            seed=seed,
            change=None if fault is None else apply_fault(fault, 2 if severity is None else severity),
        )
    shots = [
        {"lamp": s.lamp} | {role: getattr(s, role) and str(getattr(s, role)) for role in ("chart", "white", "dark")}
        for s in scene.shots
    ]
    emit(
        {
            "camera": scene.camera,
            "chart": scene.chart,
            "shots": shots,
            "truth": str(scene.truth),
            "corners": str(scene.corners),
        }
    )
    say("", f"{scene.camera} in {out}: {', '.join(sorted(path.name for path in _files_of(scene)))}")


def _files_of(scene: Simulation) -> list[Path]:
    frames = [path for shot in scene.shots for path in (shot.chart, shot.white, shot.dark) if path is not None]
    return [*frames, scene.truth, scene.corners]
