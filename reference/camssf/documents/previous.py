"""Takes the named shots of a stored result as further shots of a new capture of the same unit."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from camssf.documents.document import Document
from camssf.errors import InvalidArgument
from camssf.messages import fail
from camssf.photo.capture import CHART_TABLE, Capture, MeasuredShot, Photo, check_alike
from camssf.photo.read.unit import check_unit
from camssf.photo.signals import normalise
from camssf.spectra import ChartTable, Unnamed

AGAIN = "Give the result of an accepted calibration of this unit, under a lamp that you named."


@dataclass(frozen=True)
class PreviousResult:
    """A stored result of the same unit.

    Attributes:
        name: of its file.
        sha256: of its file.
        result: its content.
    """

    name: str
    sha256: str
    result: Document

    def joined(self, capture: Capture) -> Capture:
        """The capture with the named shots of this result behind its own, all relative to the chart's white patch.

        White frames only even out the light: a shot with one has signals y_i / y_w of Eq. (5), w the white patch.

        Raises:
            InvalidArgument: the result is not accepted, names no lamp, is of another chart, or holds the same photo.
            FramesDiffer, UnitDiffers: it is of another camera.
        """
        stored = self._checked(capture)
        table = self._table(stored, capture)
        named = [shot for shot in stored.shots if not isinstance(shot.lamp, Unnamed)]
        shots = tuple(evened(shot, table) for shot in (*capture.shots, *named))
        check_alike(shots)
        return replace(capture, shots=shots, chart=table, white_reflectance=None)

    def _checked(self, capture: Capture) -> Capture:
        """The capture of this result, if it can be joined with another one."""
        verdict, stored = self.result.verdict, self.result.capture
        if verdict is None or verdict.status != "accepted" or stored is None:
            why = verdict.reasons[0].message if verdict and verdict.reasons else ""
            status = "not solved" if verdict is None else verdict.status
            raise InvalidArgument(f"The previous result {self.name} was {status}: {why}", AGAIN)
        if all(isinstance(shot.lamp, Unnamed) for shot in stored.shots):
            raise InvalidArgument(f"The previous result {self.name} names no lamp.", AGAIN)
        self._check_unit(stored.shots[0].photo, capture.shots[0].photo)
        hashes = {shot.photo.sha256 for shot in stored.shots}
        for shot in capture.shots:
            if shot.photo.sha256 in hashes:
                raise InvalidArgument(
                    f"{shot.photo.name} is already in the previous result {self.name}.", "Take a new photo."
                )
        return stored

    def _table(self, stored: Capture, capture: Capture) -> ChartTable:
        """The table of the chart of both: errors of one chart are common to all its photos.

        Names and files must be equal; of a chart whose name states no table, the previous result has chosen one.

        Raises:
            InvalidArgument: the charts differ.
        """
        theirs, ours = stored.chart, capture.chart
        files = [
            {key: value for key, value in hashes.items() if key.startswith(f"{CHART_TABLE}: ")}
            for hashes in (stored.files, capture.files)
        ]
        for table in (ours, *ours.other_tables()):
            if theirs.name == table.name and theirs.layout.name == table.layout.name and files[0] == files[1]:
                return table
        raise InvalidArgument(
            f"The previous result {self.name} was measured on the chart {theirs.name}, not on {ours.name}.",
            "Photograph the same chart again, and give the same table.",
        )

    def _check_unit(self, stored: Photo, photo: Photo) -> None:
        """Compare what both files state."""
        pairs = [(word, getattr(stored, word), getattr(photo, word)) for word in ("make", "model", "unique_model")]
        pairs.append(("size", f"{stored.width} × {stored.height}", f"{photo.width} × {photo.height}"))
        differ = [f"{word} {there} against {here}" for word, there, here in pairs if there and here != there and here]
        if differ:
            raise fail("unit_differs.previous", previous=self.name, file=photo.name, differences="; ".join(differ))
        name = f"the photo {stored.name} of the previous result {self.name}"
        check_unit(name, (stored.unit, stored.active_area), photo.name, (photo.unit, photo.active_area))


def evened(shot: MeasuredShot, table: ChartTable) -> MeasuredShot:
    """The shot without its white frame, its chart photo as in even light: b_w y in place of b y, b = W - D.

    It needs no gain modes.
    """
    if shot.means.white is None:
        return shot
    signals = normalise([shot.means], table)
    y, error, dark = signals.values[0], signals.standard_error[0], signals.dark[0]
    b = (signals.white[0] - dark)[table.white]
    chart = replace(shot.means.chart, mean=dark + b * y, standard_error=b * error)
    frame = shot.means.dark  # its error is in that of y already
    frame = None if frame is None else replace(frame, standard_error=np.zeros_like(y))
    # Rule 11 judged its samples when they were measured; their noise is no longer that of these signals.
    means = replace(shot.means, chart=chart, white=None, dark=frame, evened=True, noise=None)
    return replace(shot, means=means)
