"""Reads from a result document the curves and facts that every export needs."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from typing import Any

from camssf.documents.passport import check_printed
from camssf.documents.result_json import check_document, document_bytes
from camssf.documents.scale import channel_scale, no_scale
from camssf.errors import InvalidArgument
from camssf.files import readable
from camssf.grid import Floats, columns


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
            raise no_scale(self.lamps[0])
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
    def about(self) -> dict[str, Any]:
        """What derived documents state about their source result."""
        return {
            "camera": self.camera,
            "sha256": self.sha256,
            "verdict": self.status,
            "reasons": list(self.reasons),
        }

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


def read_result(document: dict[str, Any]) -> ExportedCurves:
    """Read the curves of a "camssf-result/1" document or of a passport's excerpt.

    Raises:
        InvalidArgument: the form is wrong, or the result was refused and has no curves.
        PassportInvalid: an excerpt differs from the one in its passport.
    """
    checked = check_document(document, "document", excerpt=True)
    if "excerpt" in checked:
        check_printed(checked)
    verdict = checked["verdict"]
    codes = tuple(dict.fromkeys(reason["code"] for reason in verdict["reasons"]))
    if "ssf" not in checked:
        raise InvalidArgument(
            f"This result was refused ({', '.join(codes)}): it has no curves to export.",
            verdict["reasons"][0]["advice"],
        )
    std = checked.get("ssf_std")
    return ExportedCurves(
        make=one_line(checked["camera"]["make"]),
        model=one_line(checked["camera"]["model"]),
        unique_model=_printable(checked["camera"].get("unique_model") or ""),
        values=columns(checked["ssf"]),
        std=None if std is None else columns(std),
        scale=channel_scale(checked),
        lamps=tuple(one_line(shot["lamp"]["name"]) for shot in checked["shots"]),
        basis=one_line(checked["basis"]),
        status=verdict["status"],
        reasons=codes,
        generator=one_line(f"{checked['generator']['name']} {checked['generator']['version']}"),
        sha256=checked["excerpt"]["result_sha256"]
        if "excerpt" in checked
        else hashlib.sha256(document_bytes(checked)).hexdigest(),
    )


def one_line(text: str) -> str:
    """The text on one line, without control characters and repeated blanks, safe in comments and terminals."""
    return " ".join(_printable(text).split())


def _printable(text: str) -> str:
    return re.sub(r"[\x00-\x1f\x7f-\x9f\u2028\u2029]", " ", readable(text))
