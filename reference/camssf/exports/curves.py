"""The curves of a result and the facts that every export needs."""

from __future__ import annotations

import hashlib
import re
from contextlib import suppress
from dataclasses import dataclass

from camssf.documents.document import Document, document_bytes
from camssf.documents.excerpt import CameraName, Excerpt, answer_of
from camssf.documents.scale import channel_scale
from camssf.errors import InvalidArgument
from camssf.files import readable
from camssf.grid import Floats
from camssf.photo.capture import Photo


@dataclass(frozen=True)
class ExportedCurves:
    """The curves of a result that was not refused, with the facts that an export states.

    Attributes:
        make, model: of the camera, one line each; empty if its files do not state them.
        unique_model: UniqueCameraModel of the DNG, by which raw converters identify the camera; empty if absent.
        values: (681, 3) red, green, blue on the grid, each channel's peak = 1.
        std: (681, 3) one standard deviation on the same scale; None if the result has none.
        scale: (3,) factors that turn `values` into the camera's own curves, the largest 1; None if unknown.
        lamps: names of the shots' lamps, as given.
        basis: basis of the solution.
        status: of the verdict, "accepted" or "doubtful".
        reasons: codes of a doubtful verdict.
        generator: program that made the result, for example "camssf 0.1.0".
        sha256: of the document as result.json holds it.
    """

    make: str
    model: str
    unique_model: str
    values: Floats
    std: Floats | None
    scale: Floats | None
    lamps: tuple[str, ...]
    basis: str
    status: str
    reasons: tuple[str, ...]
    generator: str
    sha256: str

    @property
    def camera(self) -> str:
        """Make and model; the make is not repeated."""
        if self.model.casefold().startswith(self.make.casefold()):
            return self.model or "unnamed camera"
        return f"{self.make} {self.model}".strip()

    @property
    def own_scale(self) -> Floats:
        """`scale`, for formats that need the relative sensitivity of the channels.

        Raises:
            InvalidArgument: the scale is not known.
        """
        if self.scale is None:
            raise InvalidArgument(
                "The scale between the channels of this result is unknown: a channel has no response under the lamp "
                f"of its first shot, {self.lamps[0]}, or its passport does not hold that lamp.",
                "Give the whole result.json, or calibrate again under a lamp that all channels see.",
            )
        return self.scale

    @property
    def own(self) -> Floats:
        """(681, 3) the curves on the camera's own scale, the largest peak 1; they reproduce its raw white balance.

        Raises:
            InvalidArgument: the scale is not known.
        """
        return self.values * self.own_scale

    @property
    def own_std(self) -> Floats | None:
        """(681, 3) one standard deviation of `own` for a fixed scale; None if the result has none."""
        return None if self.std is None else self.std * self.own_scale

    @property
    def verdict(self) -> str:
        """The verdict in one line."""
        why = f" ({', '.join(self.reasons)})" if self.reasons else ""
        return f"Verdict: {self.status}{why}."

    @property
    def description(self) -> str:
        """Text of each format's description field, one line."""
        return (
            f"Spectral sensitivities of {self.camera}, recovered by {self.generator} from photos of a chart under "
            f"{', '.join(self.lamps)} (basis {self.basis}). {self.verdict} Result SHA-256 {self.sha256}."
        )


def exported(document: Document | Excerpt) -> ExportedCurves:
    """The curves of a result, or of the excerpt of one in a passport.

    Raises:
        InvalidArgument: the result was refused and has no curves.
    """
    answer, verdict, scale = answer_of(document), document.verdict, None
    assert verdict is not None
    camera: CameraName | Photo
    if isinstance(document, Excerpt):
        camera, version, scale = document.camera, document.generator.version, document.scale()
        lamps = [shot.lamp.name for shot in document.shots]
        sha256 = "" if document.excerpt is None else document.excerpt.result_sha256
    else:
        assert document.capture is not None
        camera, version = document.capture.photos[0], document.version
        lamps = [light.name for light in document.capture.lights]
        sha256 = hashlib.sha256(document_bytes(document)).hexdigest()
        with suppress(InvalidArgument):  # formats without a scale between the channels can do without it
            scale = channel_scale(document)
    return ExportedCurves(
        make=one_line(camera.make),
        model=one_line(camera.model),
        unique_model=_printable(camera.unique_model or ""),
        values=answer.curves.values,
        std=None if answer.std is None else answer.std.values,
        scale=scale,
        lamps=tuple(map(one_line, lamps)),
        basis=one_line(answer.basis),
        status=verdict.status,
        reasons=tuple(dict.fromkeys(reason.code for reason in verdict.reasons)),
        generator=one_line(f"camssf {version}"),
        sha256=sha256,
    )


def one_line(text: str) -> str:
    """The text on one line, without control characters and repeated blanks, safe in comments and terminals."""
    return " ".join(_printable(text).split())


def _printable(text: str) -> str:
    return re.sub(r"[\x00-\x1f\x7f-\x9f\u2028\u2029]", " ", readable(text))
