"""Result document → curves: what every export says, taken from the document alone."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from camssf.documents.passport import check_printed
from camssf.documents.report import check_document, document_bytes
from camssf.documents.scale import channel_scale, no_scale
from camssf.errors import InvalidArgument
from camssf.files import readable
from camssf.grid import Floats

_CHANNELS = ("red", "green", "blue")


@dataclass(frozen=True)
class Curves:
    """The curves of a result that was not refused, and what must be said beside them.

    Attributes:
        make, model: of the camera, one line each; empty where its files are silent.
        unique_model: the camera as the DNG's UniqueCameraModel says it, by which raw converters know it; empty where
            its files have none.
        values: (681, 3) red, green, blue on the grid, each channel's peak = 1.
        std: (681, 3) one standard deviation on the same scale; None where the result has none.
        scale: (3,) factors that turn `values` into the camera's own curves, the largest 1; None if unknown.
        lamps: of the shots, as they were named.
        basis: in which the curves were sought.
        status: of the verdict, "accepted" or "doubtful".
        reasons: codes of a doubtful verdict.
        generator: who made the result, "camssf 0.1.0".
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
        """Maker and model in one, the maker once."""
        if self.model.casefold().startswith(self.make.casefold()):
            return self.model or "unnamed camera"
        return f"{self.make} {self.model}".strip()

    @property
    def own_scale(self) -> Floats:
        """`scale`, for formats that must say how sensitive the channels are against each other.

        Raises:
            InvalidArgument: it is not known.
        """
        if self.scale is None:
            raise no_scale(self.lamps[0])
        return self.scale

    @property
    def own(self) -> Floats:
        """(681, 3) the curves on the camera's own scale, the largest peak 1: they give its raw white balance.

        Raises:
            InvalidArgument: the scale is not known.
        """
        return self.values * self.own_scale

    @property
    def own_std(self) -> Floats | None:
        """(681, 3) one standard deviation of `own` at a fixed scale; None where the result has none."""
        return None if self.std is None else self.std * self.own_scale

    @property
    def about(self) -> dict[str, Any]:
        """What other documents say of the result that they were made from."""
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
        """What each format's description field says, one line."""
        return (
            f"Spectral sensitivities of {self.camera}, recovered by {self.generator} from photos of a chart under "
            f"{', '.join(self.lamps)} (basis {self.basis}). {self.verdict} Result SHA-256 {self.sha256}."
        )


def read_result(document: dict[str, Any]) -> Curves:
    """The curves of a result document in the form "camssf-result/1", or of the excerpt that a passport holds.

    Raises:
        InvalidArgument: the document breaks its form, or it was refused and has no curves.
        PassportInvalid: an excerpt is not what its passport holds.
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
    return Curves(
        make=one_line(checked["camera"]["make"]),
        model=one_line(checked["camera"]["model"]),
        unique_model=_printable(checked["camera"].get("unique_model") or ""),
        values=_stack(checked["ssf"]),
        std=None if std is None else _stack(std),
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
    """Text that cannot end a line of a comment or steer a terminal; blanks in a row are one."""
    return " ".join(_printable(text).split())


def _printable(text: str) -> str:
    return re.sub(r"[\x00-\x1f\x7f-\x9f\u2028\u2029]", " ", readable(text))


def _stack(curves: dict[str, Any]) -> Floats:
    return np.stack([np.array(curves[channel], dtype=np.float64) for channel in _CHANNELS], axis=1)
