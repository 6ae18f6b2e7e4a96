"""Calibrates every camera of a manifest in parallel, into a folder for each name or into an archive with a registry.

Both ways share manifest, processes, worker (`_run_job`) and recorder. They differ in the store, where a worker finds
results of earlier runs and keeps new ones (`_ResultFolders`, `Archive`).
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from camssf.errors import CalibrationError, InvalidArgument
from camssf.files import error_in_words, local_folder, settle, temporary_folder, write_file, write_files
from camssf.messages import fail
from camssf.photo.read.unit import photo_hash
from camssf.places import absolute, fetch, folder_place, is_remote, place
from camssf.progress import Progress
from camssf.report.build import NAMES
from camssf.version import __version__
from camssf_fleet.archive import RESULT_FILE, Archive, row_of, unfinished
from camssf_fleet.cluster import run_dask
from camssf_fleet.inputs import basis_hash, file_hash, file_in, layout_in
from camssf_fleet.manifest import Job, Manifest
from camssf_fleet.outcome import KEPT, Outcome, Summary
from camssf_fleet.processes import cores, run_processes
from camssf_fleet.recorder import OutcomeRecorder, summary_csv
from camssf_fleet.registry import Registry

if TYPE_CHECKING:
    from camssf.result import Result

MARK = "batch.json"
"""File in a result's folder with the hashes of all its inputs and of its own files."""
FRAMES = ("photos", "white", "dark")
"""Fields of a job whose files may be in an object store."""

WorkInFolder: TypeAlias = Callable[[Job, Path], Outcome]


def run_batch(
    manifest: Manifest,
    out: Path | str,
    registry: Registry | None = None,
    *,
    workers: int | None = None,
    dask: str | None = None,
    work: WorkInFolder | None = None,
    progress: Progress | None = None,
) -> Summary:
    """Do the jobs of a manifest that are not done yet. A failure does not stop the other jobs.

    Without a registry, each camera goes into `out/<name>/`, with one row for each in `out/summary.csv`. It is skipped
    if it has curves from an earlier run, and its rows, files, options, camssf's version and its four result files are
    unchanged; a refused camera is tried again.

    With a registry, `out` is an archive (`archive.Archive`), and the manifest may have any size. A job is done if the
    archive has its result, even a refused one, the registry its row, and its rows, files (by size and time), options
    and version are unchanged; a row that was lost or changed is written again from the archive. If a file is missing
    or unreadable the job is refused, and the registry keeps or gets the row of the archive's result of the same rows.
    A job during which processes died (`pools.DEATHS`) also counts as done.

    Args:
        manifest: the jobs.
        out: folder of the results; created if missing.
        registry: receives a row for each result; a job that contradicts it is refused, unless it takes corrections.
        workers: number of local processes; all cores unless given.
        dask: address of a Dask scheduler whose workers do the jobs instead; needs a registry. They need this version
            of camssf and the same paths for photos and archive.
        work: function that does one job in a folder, importable by a new process; the calibration unless given.
        progress: called with a message and a fraction.

    Raises:
        InvalidArgument: the manifest cannot be read, `out` or the registry cannot be written to, or the cluster does
            not answer or cannot do the jobs.
    """
    begun, summary = time.monotonic(), Summary()
    if registry is None:
        if dask is not None:
            raise InvalidArgument(
                f"--workers {dask} needs a registry; without one every job is done here.",
                "Give the number of processes, or name a --registry.",
            )
        folder = local_folder(out)
        todo = manifest.read_all()
        store: _ResultFolders | Archive = _ResultFolders(folder)
        jobs = iter(todo)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            fault = f"{folder}: the batch cannot be written ({error.strerror or error})."
            raise InvalidArgument(fault, "Choose another output folder.") from error
    else:
        folder = absolute(folder_place(out))
        manifest = manifest.absolute()
        store = Archive(folder, absolute(registry.folder))
        jobs = unfinished(manifest, registry, summary, store)
    recorder = OutcomeRecorder(manifest, registry, summary, progress)
    do = partial(_run_job, store=store, work=work or partial(calibrate_into, pages=registry is None))
    try:
        if dask is None:
            run_processes(jobs, do, max(1, workers or cores()), recorder)
        else:
            run_dask(jobs, do, dask, folder, recorder)
    finally:
        recorder.finish()
    if registry is None:
        ended = {outcome.name: outcome for _, outcome in recorder.outcomes}
        summary.outcomes = tuple(ended[job.name] for job in todo)
        write_file(folder / "summary.csv", summary_csv(summary.outcomes))
    summary.seconds = time.monotonic() - begun
    return summary


def attempt_job(job: Job) -> Result:
    """Run the calibration that a job describes."""
    from camssf.calibration import attempt
    from camssf.options import Options
    from camssf.photo.shot import Shot

    shots = [
        Shot(*shot, lens_shading=job.lens_shading)
        for shot in zip(job.photos, job.lamps, job.white, job.dark, strict=True)
    ]
    return attempt(shots, chart=job.chart, options=Options(basis=job.basis))


def calibrate_into(job: Job, folder: Path, *, pages: bool = True) -> Outcome:
    """Calibrate one camera into a folder; a refused capture has a document, too.

    With pages (report.html, ssf.svg, the CSVs), an earlier result with curves is kept (`Report.save`). Without, the
    outcome has the row of the result.
    """
    from camssf.documents.document import document_bytes
    from camssf.report.build import holds_result, report
    from camssf.report.provenance import read_provenance

    result = attempt_job(job)
    if pages:
        report(result, result.previews, provenance=read_provenance(job.photos)).save(folder)
        row = None
    else:
        data = document_bytes(result)
        write_files(folder, {RESULT_FILE: data})
        row = row_of(job, data, result)
    if result.error is not None:
        refused = replace(_refused(job, result.error), row=row)
        return replace(refused, reason=f"{refused.reason} {KEPT}") if holds_result(folder) else refused
    reasons = result.verdict.reasons
    code, reason = (reasons[0].code, reasons[0].message) if reasons else ("", "")
    return Outcome(job.name, result.verdict.status, code, reason, row=row)


# In a worker


def _run_job(job: Job, *, store: _ResultFolders | Archive, work: WorkInFolder) -> Outcome:
    """The earlier outcome of an unchanged job, or that of doing it."""
    if job.fault:
        return Outcome(job.name, "refused", InvalidArgument.code, f"In the manifest, {job.fault}", job.folder)
    made_from = ""
    try:
        with _local_job(job) as local:
            made_from = inputs_hash(local)
            outcome = store.earlier(local, made_from)
            if outcome is None:
                with store.working_folder(local, made_from) as folder:
                    outcome = work(local, folder)
                outcome = store.keep(local, made_from, outcome)
    except CalibrationError as error:
        outcome = store.instead(job, _refused(job, error))
    except Exception as error:
        words = " ".join(f"{type(error).__name__}: {error}".split())
        outcome = Outcome(job.name, "failed", "", f"{words} (this is camssf's fault, please report it)")
    return replace(outcome, folder=job.folder, made_from=outcome.made_from or made_from)


@contextmanager
def _local_job(job: Job) -> Iterator[Job]:
    """The job with local copies of the photos that are in an object store.

    Raises:
        InvalidArgument: one cannot be read; or of the work within, with the URLs instead of the copies' names.
    """
    remote = list(dict.fromkeys(text for _, text in job.specifications if text and is_remote(text)))
    if not remote:
        yield job
        return
    with temporary_folder() as folder:
        copies = {url: str(fetch(place(url), folder / str(i))) for i, url in enumerate(remote)}
        fields: dict[str, Any] = {
            name: tuple(copies.get(path, path) for path in getattr(job, name)) for name in FRAMES
        }
        try:
            yield replace(job, **fields)
        except CalibrationError as error:
            for url, copy in copies.items():
                error.message = error.message.replace(copy, url)
            raise


def _refused(job: Job, error: CalibrationError) -> Outcome:
    return Outcome(job.name, "refused", error.code, f"{error.message} {error.advice}")


def inputs_hash(job: Job) -> str:
    """SHA-256 of all that determines a result: file contents, options and version, but not the photos' names."""
    contents = []
    for role, specification in job.specifications:
        layout, path = file_in(role, specification)
        layout_file = layout_in(role, specification)
        kind = layout if layout_file is None else file_hash(layout_file)
        try:
            contents.append(specification if path is None else f"{kind}:{photo_hash(path)}")
        except OSError as error:
            raise fail("unreadable_raw.no_access", file=path, detail=error_in_words(error)) from error
    basis = basis_hash(job.basis)
    name = job.basis if basis is None else f"{Path(job.basis).stem}:{basis}"
    options = (len(job.photos), name, job.lens_shading)
    return hashlib.sha256(json.dumps([contents, options, __version__]).encode()).hexdigest()


# A folder for each name


@dataclass(frozen=True)
class _ResultFolders:
    """A folder for each name below `out`, with the four files of a result and their MARK file."""

    out: Path

    def earlier(self, job: Job, made_from: str) -> Outcome | None:
        """The outcome if inputs and files are unchanged."""
        folder = self.out / job.folder
        settle(folder)
        try:
            mark = json.loads((folder / MARK).read_text("utf-8"))
            same = mark["made_from"] == _job_hash(job, made_from) and mark["files"] == _file_hashes(folder)
            return Outcome(**mark["outcome"], resumed=True) if same else None
        except (OSError, ValueError, KeyError, TypeError):  # mark missing or damaged
            return None

    @contextmanager
    def working_folder(self, job: Job, made_from: str) -> Iterator[Path]:
        """The folder for a new result."""
        (self.out / job.folder / MARK).unlink(missing_ok=True)  # from now on it does not describe the folder
        yield self.out / job.folder

    def keep(self, job: Job, made_from: str, outcome: Outcome) -> Outcome:
        """Write the MARK file of a result with curves."""
        if outcome.ok:
            mark = {
                "format": "camssf-batch/1",
                "made_from": _job_hash(job, made_from),
                "files": _file_hashes(self.out / job.folder),
                "outcome": {name: getattr(outcome, name) for name in ("name", "status", "code", "reason")},
            }
            write_file(self.out / job.folder / MARK, json.dumps(mark, ensure_ascii=False) + "\n")
        return outcome

    def instead(self, job: Job, outcome: Outcome) -> Outcome:
        """The outcome as it is; the folder keeps the earlier result."""
        return outcome


def _job_hash(job: Job, made_from: str) -> str:
    """SHA-256 of the rows as well, since a result names its files."""
    return hashlib.sha256(json.dumps([repr(job), made_from]).encode()).hexdigest()


def _file_hashes(folder: Path) -> dict[str, str]:
    return {name: file_hash(folder / name) for name in NAMES if (folder / name).is_file()}
