"""Calibrates every camera of a manifest in parallel processes; unchanged results are not computed again."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import os
import re
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from functools import partial
from multiprocessing import get_context, parent_process
from pathlib import Path
from typing import TYPE_CHECKING

from camssf.errors import CalibrationError, InvalidArgument, RawError
from camssf.files import local, local_folder, write_file
from camssf.fleet.inputs import basis_hash, basis_path, check_manifest, file_hash, is_file, urls_among
from camssf.photo.read.sidecar import photo_hash
from camssf.report.build import NAMES
from camssf.version import __version__

if TYPE_CHECKING:
    from camssf.result import Calibration, Refusal

COLUMNS = ("name", "photo", "lamp", "white", "dark", "chart")
"""Columns of the manifest; `name`, `photo` and `lamp` are required, but only `name` and `photo` need values."""

LARGEST_MANIFEST = 10_000_000
"""Bytes."""

MARK = "batch.json"
"""File in a result's folder with the hashes of all its inputs and of its own files."""

_RESERVED = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?|summary\.csv", re.IGNORECASE)
KEPT = "The earlier result of this name was kept as it is."
AUTO = "auto"
"""The lamp for an empty cell: unnamed light, as in `calibrate`."""
_FORMULA = re.compile(r"(?:^|(?<=[;\t]))(?=[=+\-@\t\r\n\uff1d\uff0b\uff0d\uff20])")
"""Positions where a spreadsheet may take text for a formula, at the possible start of a cell; a `'` prevents it."""
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True)
class Job:
    """One camera of the manifest.

    Attributes:
        name: as in the manifest.
        folder: safe name of its folder below the output folder.
        photos, lamps, white, dark: one for each shot, in the manifest's order; white and dark may be None.
        chart: for all shots.
        basis, engine, lens_shading: as in `camssf.calibrate`.
        fault: why this job cannot run, "" if it can.
    """

    name: str
    folder: str
    photos: tuple[str, ...]
    lamps: tuple[str, ...]
    white: tuple[str | None, ...]
    dark: tuple[str | None, ...]
    chart: str
    basis: str
    engine: str
    fault: str = ""
    lens_shading: str = "as-stored"


@dataclass(frozen=True)
class Outcome:
    """The outcome for one camera.

    Attributes:
        name, folder: as in `Job`.
        status: "accepted", "doubtful", "refused" (with a code of `camssf.errors`), "failed" (bug, crash).
        code: of the first reason, "" if accepted.
        reason: in words.
        resumed: the result is from an earlier run and its inputs are unchanged.
    """

    name: str
    folder: str
    status: str
    code: str
    reason: str
    resumed: bool = False

    @property
    def ok(self) -> bool:
        """Whether the result has curves."""
        return self.status in ("accepted", "doubtful")


def run_batch(
    manifest: str | Path,
    out: str | Path,
    *,
    basis: str = "auto",
    engine: str = "onnx",
    lens_shading: str = "as-stored",
    jobs: int | None = None,
    work: Callable[[Job, Path], Outcome] | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> tuple[Outcome, ...]:
    """Calibrate every camera of a manifest into `out/<name>/`, with one row for each in `out/summary.csv`.

    A failure does not stop the other cameras. A camera with curves from an earlier run is skipped if its rows, files,
    options, camssf's version and its four result files are unchanged; a refused camera is tried again.

    Args:
        manifest: CSV with a header (COLUMNS); rows of one name are its shots; paths are relative to it.
        out: output folder; created if missing.
        basis, engine, lens_shading: as in `camssf.calibrate`, for all cameras.
        jobs: number of processes; all cores unless given.
        work: function that does one job, importable by a new process; `calibrate_job` unless given.
        progress: called with a message and a fraction.

    Returns:
        One outcome for each name, in the manifest's order.

    Raises:
        InvalidArgument: the manifest cannot be read or has no rows, or `out` cannot be written to.
    """
    basis_path(basis)  # a URL is an error of this call, not of each job
    found = read_manifest(manifest, basis=basis, engine=engine)
    todo = tuple(replace(job, lens_shading=lens_shading) for job in found)
    folder = local_folder(out)
    count = max(1, jobs if jobs is not None else cores())
    try:
        folder.mkdir(parents=True, exist_ok=True)
        outcomes = _run(todo, folder, min(count, len(todo)), work or calibrate_job, progress or (lambda *_: None))
        write_file(folder / "summary.csv", _summary(outcomes))
    except OSError as error:
        raise InvalidArgument(
            f"{folder}: the batch cannot be written ({error.strerror or error}).",
            "Choose another output folder.",
        ) from error
    return outcomes


def read_manifest(path: str | Path, *, basis: str = "auto", engine: str = "onnx") -> tuple[Job, ...]:
    """The jobs of a manifest; a bad row gives a job with a fault, an unusable manifest raises InvalidArgument."""
    path = local(path)
    if is_parquet(path):
        raise InvalidArgument(f"{path} is Parquet.", "Name a --registry: then it may be, or give a CSV file.")
    try:
        with path.open("rb") as file:
            data = file.read(LARGEST_MANIFEST + 1)
        check_manifest(path, data)
        text = data.decode("utf-8-sig")
    except (OSError, ValueError) as error:
        raise InvalidArgument(f"{path}: cannot be read ({error}).", "Give a CSV file in UTF-8.") from error
    if len(data) > LARGEST_MANIFEST:
        raise InvalidArgument(
            f"{path} is larger than {LARGEST_MANIFEST} bytes.", "Name a --registry: then it may have any size."
        )
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    reader = csv.DictReader(io.StringIO(text), delimiter=delimiter_of(text.partition("\n")[0]))
    fields = [field.strip().casefold() for field in reader.fieldnames or ()]
    reader.fieldnames = fields
    missing = [column for column in COLUMNS[:3] if column not in fields]
    unknown = [field for field in fields if field not in COLUMNS]
    if missing or unknown or len(set(fields)) < len(fields):
        fault = f"lacks the column {missing[0]}" if missing else f"has an unknown or doubled column in {fields}"
        raise InvalidArgument(f"{path} {fault}.", f"Its first line is {','.join(COLUMNS)}.")
    shots: dict[str, list[dict[str, str]]] = {}
    try:
        for row in reader:
            clean = {column: str(row.get(column) or "").strip() for column in COLUMNS}
            clean["fault"] = f"line {reader.line_num} has more fields than the header." if None in row else ""
            shots.setdefault(clean["name"], []).append(clean)
    except csv.Error as error:
        raise InvalidArgument(f"{path}: is not sound CSV ({error}).", "Save it again as CSV.") from error
    if not shots:
        raise InvalidArgument(f"{path} has no rows.", "Write one row a photo.")
    folders = _folders(list(shots))
    return tuple(job_of(path.parent, name, folders[name], rows, basis, engine) for name, rows in shots.items())


def calibrate_job(job: Job, folder: Path) -> Outcome:
    """Calibrate one camera into `folder`.

    A refusal is reported with what is known about the capture, and an earlier result with curves is kept
    (`Report.save`). Nothing is written if a file is missing or not RAW.
    """
    from camssf.report.build import holds_result, report
    from camssf.report.provenance import read_provenance
    from camssf.result import Refusal

    try:
        result = attempt_job(job)
        if not (isinstance(result, Refusal) and isinstance(result.error, RawError)):
            report(result.document(), result.previews, provenance=read_provenance(job.photos)).save(folder)
        if isinstance(result, Refusal):
            raise result.error
    except CalibrationError as error:
        kept = f" {KEPT}" if holds_result(folder) else ""
        return Outcome(job.name, job.folder, "refused", error.code, f"{error.message} {error.advice}{kept}")
    reasons = result.verdict.reasons
    code, reason = (reasons[0].code, reasons[0].message) if reasons else ("", "")
    return Outcome(job.name, job.folder, result.verdict.status, code, reason)


def attempt_job(job: Job) -> Calibration | Refusal:
    """Run the calibration that a job describes."""
    from camssf.calibration import attempt
    from camssf.options import Options
    from camssf.photo.shot import Shot

    shots = [
        Shot(*each, lens_shading=job.lens_shading)
        for each in zip(job.photos, job.lamps, job.white, job.dark, strict=True)
    ]
    return attempt(shots, chart=job.chart, options=Options(basis=job.basis, engine=job.engine))


# the manifest


def is_parquet(path: Path) -> bool:
    """Whether the file name ends in .parquet, in any case."""
    return path.suffix.casefold() == ".parquet"


def delimiter_of(header: str) -> str:
    """The delimiter of a CSV, from its first line."""
    return ";" if ";" in header and "," not in header else ","


def job_of(home: Path, name: str, folder: str, rows: Sequence[dict[str, str]], basis: str, engine: str) -> Job:
    """The job of one name's rows; paths are relative to `home`."""

    def frame(text: str) -> str | None:
        return str(home / text) if text and text.casefold() != "none" else None

    charts = list(dict.fromkeys(row["chart"] or "classic24" for row in rows))
    faults = [row["fault"] for row in rows if row["fault"]]
    if not name:
        faults.append("a row has no name.")
    if not all(row["photo"] for row in rows):
        faults.append("a row has no photo.")
    faults += urls_among(row[column] for row in rows for column in COLUMNS[1:])
    faults += _backslashes(home, rows)
    if len(charts) > 1:
        faults.append(f"its shots name different charts: {', '.join(charts)}.")
    return Job(
        name,
        folder,
        tuple(str(home / row["photo"]) for row in rows),
        tuple(_spec(home, row["lamp"] or AUTO) for row in rows),
        tuple(frame(row["white"]) for row in rows),
        tuple(frame(row["dark"]) for row in rows),
        _spec(home, charts[0]),
        basis,
        engine,
        " ".join(faults),
    )


def _spec(home: Path, spec: str) -> str:
    """A lamp or chart; the path of a file, also in `layout:file`, is relative to the manifest."""
    if spec and is_file(home / spec):
        return str(home / spec)
    head, colon, tail = spec.partition(":")
    return f"{head}:{home / tail}" if colon and tail and is_file(home / tail) else spec


def _backslashes(home: Path, rows: Sequence[dict[str, str]]) -> list[str]:
    """The fault of a manifest with Windows paths that is read on another system."""
    if os.sep == "\\":
        return []
    for row in rows:
        for column in COLUMNS[1:]:
            path = row[column].partition(":")[2] if column == "chart" and ":" in row[column] else row[column]
            if "\\" in path and not is_file(home / path):
                return [f"{path} is written with backslashes, which are no folders here: write / instead."]
    return []


def _folders(names: Sequence[str]) -> dict[str, str]:
    """A safe folder name for each name: readable, and unique on any file system."""
    folded = [name.casefold() for name in names]
    folders = {}
    for name in names:
        safe = re.sub(r"[^\w .()+-]+", "_", name)[:80].strip(" .")
        tag = hashlib.sha256(name.encode("utf-8", "surrogatepass")).hexdigest()[:8]
        plain = safe == name and safe and not _RESERVED.fullmatch(safe) and folded.count(name.casefold()) == 1
        lead = "_" if _RESERVED.fullmatch(safe) else "" if safe else "unnamed"
        folders[name] = safe if plain else f"{lead}{safe}-{tag}"
    return folders


# the work


def _run(
    todo: Sequence[Job],
    out: Path,
    count: int,
    work: Callable[[Job, Path], Outcome],
    progress: Callable[[str, float], None],
) -> tuple[Outcome, ...]:
    outcomes: dict[str, Outcome] = {}
    one = partial(_one, out=out, work=work)
    with single_threads():
        waiting = _parallel(todo, count, one, outcomes, progress)
        for job in waiting:  # a process died: repeat one job at a time to find the one that crashes
            if _parallel([job], 1, one, outcomes, progress):
                outcomes[job.name] = Outcome(
                    job.name,
                    job.folder,
                    "failed",
                    "",
                    "The process that worked on it died (memory, or a damaged file).",
                )
    return tuple(outcomes[job.name] for job in todo)


def _parallel(
    todo: Sequence[Job],
    count: int,
    one: Callable[[Job], Outcome],
    outcomes: dict[str, Outcome],
    progress: Callable[[str, float], None],
) -> list[Job]:
    """Fill `outcomes`; returns the jobs that were not done because a process died."""
    with ProcessPoolExecutor(count, get_context("spawn"), begin) as pool:
        futures = {pool.submit(one, job): job for job in todo}
        try:
            for future in as_completed(futures):
                job = futures[future]
                try:
                    outcomes[job.name] = future.result()
                except BrokenProcessPool:
                    break
                progress(f"{len(outcomes)} done, last {job.name}", len(outcomes) / max(len(todo), len(outcomes)))
        except BaseException:
            pool.shutdown(cancel_futures=True)  # waits for running jobs; leaving `with` would not cancel the rest
            raise
    return [job for job in todo if job.name not in outcomes]


def _one(job: Job, *, out: Path, work: Callable[[Job, Path], Outcome]) -> Outcome:
    """In the worker process: skip an unchanged job, or do it and write its MARK file."""
    if job.fault:
        return Outcome(job.name, job.folder, "refused", InvalidArgument.code, f"In the manifest, {job.fault}")
    try:
        folder = out / job.folder
        made_from = _fingerprint(job)
        earlier = _earlier(folder, made_from)
        if earlier is not None:
            return replace(earlier, name=job.name, folder=job.folder, resumed=True)
        (folder / MARK).unlink(missing_ok=True)  # from now on it does not describe the folder
        outcome = work(job, folder)
        if outcome.ok:
            files = {name: file_hash(folder / name) for name in NAMES}
            mark = {"format": "camssf-batch/1", "made_from": made_from, "files": files, "outcome": asdict(outcome)}
            write_file(folder / MARK, json.dumps(mark, ensure_ascii=False) + "\n")
    except Exception as error:
        words = " ".join(f"{type(error).__name__}: {error}".split())
        return Outcome(job.name, job.folder, "failed", "", f"{words} (this is camssf's fault, please report it)")
    return outcome


def _fingerprint(job: Job) -> str:
    """SHA-256 of the job, the version and the contents of all its files."""
    chart = job.chart.partition(":")[2] if not is_file(Path(job.chart)) else job.chart
    paths = [*job.photos, *job.lamps, *job.white, *job.dark, chart]
    hashes = [photo_hash(Path(path)) if path and is_file(Path(path)) else None for path in paths]
    if basis := basis_hash(job.basis):
        hashes.append(basis)
    return hashlib.sha256(json.dumps([asdict(job), hashes, __version__]).encode()).hexdigest()


def _earlier(folder: Path, made_from: str) -> Outcome | None:
    """The outcome in the folder if inputs and files are unchanged and the status is the result's; else None."""
    try:
        mark = json.loads((folder / MARK).read_text("utf-8"))
        if mark["made_from"] == made_from and mark["files"] == {name: file_hash(folder / name) for name in NAMES}:
            outcome = Outcome(**mark["outcome"])
            verdict = json.loads((folder / "result.json").read_text("utf-8"))["verdict"]
            return outcome if outcome.ok and outcome.status == verdict["status"] else None
    except (OSError, ValueError, KeyError, TypeError):  # mark missing or damaged, or a file missing: do the job again
        pass
    return None


def cores() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def begin() -> None:
    """Initialise a worker process: ignore Ctrl-C, which the parent handles, and exit when the parent ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """Exit when the parent process ends; otherwise this process would wait for work for ever."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)  # immediate exit is safe: files are written atomically


@contextmanager
def single_threads() -> Iterator[None]:
    """Set one BLAS thread for each new process, which reads it at its start; the processes are the parallelism."""
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update({name: value or "1" for name, value in before.items()})
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)


# the files


def _summary(outcomes: Sequence[Outcome]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("name", "folder", "status", "code", "reason", "resumed"))
    for o in outcomes:
        words = (o.name, o.folder, o.status, o.code, o.reason, "yes" if o.resumed else "no")
        writer.writerow([cell(word) for word in words])
    return text.getvalue()


def cell(text: str) -> str:
    """Text that no spreadsheet takes for a formula, without carriage returns, which `csv` does not quote."""
    return _FORMULA.sub("'", text).replace("\r", " ")
