"""Terminal output: data on stdout, messages and progress on stderr, exit statuses."""

from __future__ import annotations

import codecs
import io
import json
import os
import re
import sys
import threading
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import typer

from camssf.errors import CalibrationError, InvalidArgument, RawError
from camssf.files import readable

if TYPE_CHECKING:
    from camssf.documents.document import Document
    from camssf.result import Result

Product = TypeVar("Product")

BATCH_FAILED = PARTED = 1
UNDECIDED = 12
INTERRUPTED = 130
BUG = 70
"""Exit statuses in addition to those of `camssf.errors`: a batch with failures, or two results that differ; an
undecided drift because the newest result was left out; Ctrl-C; and sysexits' EX_SOFTWARE."""

PRINTED = {"previous_result": "previous result: ", "patch_left_out": ""}
"""Assumptions that are printed, and what stands before them."""
PROGRESS_AFTER = 2.0
"""Seconds before a progress bar appears."""

_STEERING = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")
"""Control characters, which file names may contain and a terminal would obey."""

_SPELT = {"±": "+/-", "ΔE00": "Delta E 2000", "–": "-"}


def emit(document: Document | dict[str, Any]) -> None:
    """Write a document to stdout as JSON, but not to a terminal."""
    if sys.stdout is not None and sys.stdout.isatty():
        say("", "JSON is not printed on a terminal. Write it into a file, > FILE, or to another program, | cat.")
        return
    if isinstance(document, dict):
        text = readable(json.dumps(document, allow_nan=False, ensure_ascii=False))
    else:
        from camssf.documents.document import document_bytes

        text = document_bytes(document).decode().rstrip("\n")
    # If stdout is not UTF-8, use ASCII with escapes, which is valid JSON in any encoding.
    put(text if codecs.lookup(_coding()).name == "utf-8" else json.dumps(json.loads(text)))


def put(text: str) -> None:
    """Write text to stdout and flush it, so that a full disk raises here; click handles a closed pipe."""
    if sys.stdout is None:
        raise InvalidArgument("Standard output is closed.", "Leave it open, or name a folder by -o.")
    try:
        data = f"{readable(text)}\n".encode(_coding(), "replace")
        if isinstance(getattr(sys.stdout, "buffer", None), io.RawIOBase):  # PYTHONUNBUFFERED: it drops a short write
            buffered = io.BufferedWriter(sys.stdout.buffer)
            buffered.write(data)
            buffered.detach()
        else:
            sys.stdout.write(data.decode(_coding()))
            sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        discard_stdout()
        raise InvalidArgument(
            f"Standard output cannot be written ({error.strerror or error}).",
            "Free some space, or write elsewhere. What was written is incomplete.",
        ) from error


def _coding() -> str:
    return getattr(sys.stdout, "encoding", None) or "utf-8"


def discard_stdout() -> None:
    """Redirect stdout to the null device; otherwise Python would try to flush its buffer again at exit."""
    with suppress(OSError, ValueError, AttributeError):
        stdout = sys.stdout.fileno()
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stdout)
        os.close(nowhere)


def pass_on(document: Result) -> None:
    """Write a result to stdout and its summary to stderr; exit with the status of a refusal."""
    emit(document)
    summarise(document, None)
    finish(document)


def product_of(product: Product | Result, out: Path | None, photos: Sequence[str] = ()) -> Product:
    """Return the product; for a refusal write what is known, to files or stdout, and raise its error.

    No file is written if an input is missing or not RAW, or no photo was read: then nothing is known.
    """
    from camssf.report.build import report
    from camssf.report.provenance import read_provenance
    from camssf.result import Result

    if not isinstance(product, Result) or product.error is None:
        return product  # type: ignore[return-value]
    try:
        if out is None:
            emit(product)
        elif isinstance(product.error, RawError) or product.capture is None or not product.capture.photos:
            say("", f"Nothing was written to {out}.")
        else:
            written = report(product, product.previews, provenance=read_provenance(photos)).save(out)
            say("", f"{kept_in(out, written)}Partial report: {written[-1]}")
    except InvalidArgument as lost:  # report it, but raise the refusal
        say("", f"{lost.message} {lost.advice}")
    raise product.error


def kept_in(out: Path, written: Sequence[Path]) -> str:
    """A sentence that an earlier result was kept, if a refused one was written below it; else ""."""
    return "" if written[0].parent == out else f"The result in {out} was kept as it is. "


def summarise(result: Result, page: Path | None, *, other: Result | None = None, other_name: str = "") -> None:
    """Print a summary of the result on stderr, the verdict first.

    Args:
        result: to summarise.
        page: path of its report.
        other: another result of the same camera, to compare with the truth too. other_name: its name.
    """
    from camssf.documents.basis_choice import band_in_words, choice_of
    from camssf.documents.unnamed_light import light_in_words, lights_of
    from camssf.libraries import REPORT, extension

    verdict, answer, shots = result.verdict, result.answer, result.capture.shots if result.capture else ()
    colour = {"accepted": "green", "doubtful": "yellow"}.get(verdict.status, "red")
    say(f"verdict: [bold {colour}]{verdict.status}[/]", f" ({_title(result)})")
    for reason in verdict.reasons:
        say(f"  [bold]{reason.code}[/]: ", f"{reason.message} {reason.advice}")
    for assumption in result.assumptions:
        if assumption.code in PRINTED:
            say(PRINTED[assumption.code], assumption.message)
    if answer is not None:
        if expected := extension(REPORT, "colour").expected_error(result):
            say("", expected.in_words())
        if answer.uncertainty is not None:
            say("95 % band: ", band_in_words(answer.uncertainty))
        _say_true_errors(result, other, other_name)
        unseen = ", ".join(f"{value:.2f}" for value in answer.scores.rmsre_percent)
        say("RMSRE of unseen patches: ", f"{unseen} % (red, green, blue)")
        chosen = choice_of(answer)
        if chosen is not None and chosen.words:
            say("basis: ", chosen.words[0])
        if lights := lights_of(answer):
            several = len(shots) > 1
            say(
                "light: ",
                "; ".join(
                    (f"shot {j}: " if several else "") + light_in_words(shots[j - 1].lamp, light)
                    for j, light in lights
                ),
            )
    for j, shot in enumerate(shots, 1):
        for note in shot.pose.notes:
            say(f"shot {j}: ", note)
    if page is not None:
        say("", f"report: {page}")


def _say_true_errors(result: Result, other: Result | None, other_name: str) -> None:
    """Print a table of the errors against the truth, if the result holds it."""
    from rich.table import Table

    from camssf.report.sections.truth import HEAD, true_errors

    errors = true_errors(result, other, other_name)
    if not errors:
        return
    table = Table("RMSE against the truth, peak = 1", *map(literal, HEAD))
    for error in errors:
        table.add_row(literal(error.name), *map(literal, error.cells()))
    stderr().print(table)


def _title(result: Result) -> str:
    from camssf.report.names import camera_of, lamps_of

    return f"{camera_of(result)}, {lamps_of(result)}, basis {result.answer.basis if result.answer else 'none'}"


def finish(result: Result) -> None:
    """Exit with the error's status if the result was refused."""
    verdict = result.verdict
    if verdict.status == "refused":
        codes = [reason.code for reason in verdict.reasons]
        raise typer.Exit(_exit_status(codes[0]) if codes else CalibrationError.exit_status)


def _exit_status(code: str) -> int:
    kinds = [CalibrationError]
    for kind in kinds:
        kinds.extend(kind.__subclasses__())
    return next((kind.exit_status for kind in kinds if kind.code == code), CalibrationError.exit_status)


def stderr() -> Any:
    """The console on stderr."""
    from rich.console import Console

    return Console(stderr=True, highlight=False, soft_wrap=True)


def literal(text: str) -> str:
    """The text with markup escaped, control characters replaced, and signs that stderr cannot encode spelt out."""
    from rich.markup import escape

    text = _STEERING.sub("\ufffd", readable(text))
    try:
        text.encode(getattr(sys.stderr, "encoding", None) or "utf-8")
    except UnicodeEncodeError:
        for sign, words in _SPELT.items():
            text = text.replace(sign, words)
    return escape(text)


def say(markup: str, text: str) -> None:
    """Print on stderr; `text` is taken literally."""
    stderr().print(f"{markup}{literal(text)}")


def trace(debug: bool) -> None:
    """Print the traceback if `debug`."""
    if debug:
        traceback.print_exc()


class _Bar:
    """A progress bar, shown only on a terminal and after PROGRESS_AFTER seconds."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._last = ("starting", 0.0)
        self._bar: Any = None
        self._timer = threading.Timer(PROGRESS_AFTER, self._show)
        self._timer.daemon = True
        self._timer.start()

    def __call__(self, stage: str, fraction: float) -> None:
        with self._lock:
            fraction = max(fraction, self._last[1])
            self._last = (stage, fraction)
            if self._bar is not None:
                self._bar.update(self._bar.task_ids[0], description=stage, completed=fraction)

    def _show(self) -> None:
        console = stderr()
        if not console.is_terminal:
            return
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        with self._lock:
            if self._timer.finished.is_set():
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
def progress_bar() -> Iterator[_Bar]:
    """A progress bar, to be called with the name of a stage and the fraction done.

    Enter it before anything that takes long, such as the imports of a command.
    """
    bar = _Bar()
    try:
        bar("starting", 0.0)
        yield bar
        bar("done", 1.0)
    finally:
        bar.close()
