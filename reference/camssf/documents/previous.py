"""Takes the named shots of a stored result as further shots of a new capture of the same unit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from camssf.errors import InvalidArgument, UnitDiffers
from camssf.grid import Floats
from camssf.photo.capture import Capture, MeasuredShot, Photo
from camssf.photo.find.pose import Pose
from camssf.photo.patches import FrameMeans, PatchMeans
from camssf.photo.signals import normalise
from camssf.spectra import ChartTable, Lamp
from camssf.spectra.families import FAMILIES
from camssf.spectra.lamps import UNNAMED, read_lamp, with_tolerance

Json: TypeAlias = dict[str, Any]

CHART_FILE = "chart table: "
"""Start of the key under which a document has the hash of the chart's file."""
AGAIN = "Give the result of an accepted calibration of this unit, under a lamp that you named."


@dataclass(frozen=True)
class PreviousResult:
    """A stored result of the same unit.

    Attributes:
        name: of its file.
        sha256: of its file.
        document: its checked content.
    """

    name: str
    sha256: str
    document: Json

    def joined(self, capture: Capture) -> Capture:
        """The capture with the named shots of this result behind its own, all relative to the chart's white patch.

        White frames only even out the light: a shot with one has signals y_i / y_w of Eq. (5), w the white patch.

        Raises:
            InvalidArgument: the result is not accepted, names no lamp, is of another chart, or holds the same photo.
            UnitDiffers: it is of another camera.
        """
        self._check(capture)
        table = capture.chart
        named = [shot for shot in self.document["shots"] if shot["lamp"]["name"] not in UNNAMED]
        shots = tuple(evened(shot, table) for shot in capture.shots)
        stored = tuple(_shot(entry, table, self.document["camera"]) for entry in named)
        return replace(capture, shots=shots + stored, white_reflectance=None)

    def _check(self, capture: Capture) -> None:
        status, reasons = self.document["verdict"]["status"], self.document["verdict"]["reasons"]
        if status != "accepted":
            why = reasons[0]["message"] if reasons else ""
            raise InvalidArgument(f"The previous result {self.name} was {status}: {why}", AGAIN)
        if all(shot["lamp"]["name"] in UNNAMED for shot in self.document["shots"]):
            raise InvalidArgument(f"The previous result {self.name} names no lamp.", AGAIN)
        self._check_chart(capture)
        self._check_unit(capture.shots[0].photo)
        hashes = {shot["photo"]["sha256"] for shot in self.document["shots"]}
        for shot in capture.shots:
            if shot.photo.sha256 in hashes:
                raise InvalidArgument(
                    f"{shot.photo.name} is already in the previous result {self.name}.", "Take a new photo."
                )

    def _check_chart(self, capture: Capture) -> None:
        """Names and files must be equal: errors of one chart are common to all its photos."""
        theirs, ours = self.document["chart"], capture.chart
        files = [
            {key: value for key, value in each.items() if key.startswith(CHART_FILE)}
            for each in (self.document["hashes"]["inputs"], capture.files)
        ]
        if theirs["name"] != ours.name or theirs["layout"] != ours.layout.name or files[0] != files[1]:
            raise InvalidArgument(
                f"The previous result {self.name} was measured on the chart {theirs['name']}, not on {ours.name}.",
                "Photograph the same chart again, and give the same table.",
            )

    def _check_unit(self, photo: Photo) -> None:
        """Compare what both files state; a result does not hold serial numbers."""
        camera, stored = self.document["camera"], self.document["shots"][0]["photo"]
        pairs = [(word, camera.get(word), getattr(photo, word)) for word in ("make", "model", "unique_model")]
        pairs.append(("size", f"{stored['width']} × {stored['height']}", f"{photo.width} × {photo.height}"))
        differ = [f"{word} {there} against {here}" for word, there, here in pairs if there and here != there and here]
        if differ:
            raise UnitDiffers(
                f"The previous result {self.name} is of another camera than {photo.name}: {'; '.join(differ)}.",
                "Give the result of this unit, or calibrate it anew without a previous result.",
            )


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
    own = shot.means.dark  # its error is in that of y already
    own = None if own is None else replace(own, standard_error=np.zeros_like(y))
    return replace(shot, means=replace(shot.means, chart=chart, white=None, dark=own, evened=True))


def _shot(entry: Json, table: ChartTable, camera: Json) -> MeasuredShot:
    """A shot of a document, relative to the white patch; `normalise` gives its signals and their errors again."""

    def column(name: str) -> Floats:
        return np.array([patch[name] for patch in entry["patches"]], dtype=np.float64)

    n, w = len(table.patches), table.white
    if len(entry["patches"]) != n:
        raise InvalidArgument(
            f"A shot of the previous result has {len(entry['patches'])} patches, the chart has {n}.", AGAIN
        )
    y, error, dark = column("signal"), column("standard_error"), column("dark")
    b = (column("white") - dark)[w]
    if entry["white_reference"] != "white frame":  # se_y² = (se_C² + y² se_Cw²) / b², so that se_w² = 2 se_Cw² / b²
        error = np.sqrt(np.maximum(error**2 - (y * error[w]) ** 2 / 2.0, 0.0))
    still, mean = np.zeros_like(y), dark + b * y
    chart = FrameMeans(
        mean, b * error, np.ones(y.shape, dtype=np.int64), column("clipped"), column("dead"), column("gradient"),
        mean[:, [1, 1]],
    )  # fmt: skip
    framed = entry["dark_reference"] == "dark frame"
    own = FrameMeans(dark, still, chart.count, still, still, still, dark[:, [1, 1]]) if framed else None
    means = PatchMeans(
        chart, None, own, dark.mean(axis=0), float(entry["saturation"]), evened=entry["white"] is not None
    )
    photo = Photo(
        **{key: value for key, value in entry["photo"].items() if key != "camera"},
        make=camera["make"], model=camera["model"], unique_model=camera.get("unique_model") or "",
    )  # fmt: skip
    frames = [entry[role] and replace(photo, **entry[role]) for role in ("white", "dark")]
    return MeasuredShot(
        _lamp(entry["lamp"]), photo, frames[0], frames[1], _pose(entry["pose"]), means, None,
        entry.get("lens_shading", "as-stored"),
    )  # fmt: skip


def _pose(entry: Json) -> Pose:
    arrays = {key: np.array(entry[key], dtype=np.float64) for key in ("corners", "patches")}
    return Pose(**entry | arrays | {"notes": tuple(entry["notes"])})


def _lamp(entry: Json) -> Lamp:
    """A named lamp. Documents do not hold modes: those of a kind and of a temperature follow from the name."""
    if "power" not in entry:
        raise InvalidArgument("The previous result is of an older version, which did not store the lamp.", AGAIN)
    name, kelvin = entry["name"], entry.get("tolerance_kelvin")
    lamp = Lamp(
        name, np.array(entry["power"]), entry["tolerance"], np.zeros((0, len(entry["power"]))), entry["source"]
    )
    if name in FAMILIES:
        lamp = replace(lamp, modes=read_lamp(name).modes)
    if kelvin is not None:
        lamp = replace(with_tolerance(lamp, f"{kelvin:.17g}K"), source=entry["source"])
    return lamp
