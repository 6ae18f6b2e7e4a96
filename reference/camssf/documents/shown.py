"""Results as a notebook meets them: one line, a picture, tables, a file. All is read from the result document."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from camssf.documents.notebook import as_html, as_line, with_curves
from camssf.documents.report import check_document, document_bytes, read_document
from camssf.documents.view.curves import columns
from camssf.evidence.checks import Check
from camssf.evidence.reasons import Reason, Verdict
from camssf.files import write_file
from camssf.grid import Floats
from camssf.photo.signals import Assumption

if TYPE_CHECKING:
    import pandas
    import xarray
    from colour.characterisation import RGB_CameraSensitivities
    from matplotlib.axes import Axes

Json: TypeAlias = dict[str, Any]
Kind: TypeAlias = Literal["curves", "residuals", "patches", "budget"]
"""What `Result.plot` draws."""
Table: TypeAlias = Literal["curves", "patches", "budget"]
"""What `Result.to_pandas` lists."""


class Result:
    """What every result can do: show itself, be drawn, be saved, be handed to other libraries.

    `Calibration` is one that was just made and knows its capture; `SavedResult` one that was read from a file;
    `Refusal` one without curves.
    """

    def document(self) -> Json:
        """The result as plain data, "camssf-result/1" (data/result.schema.json)."""
        raise NotImplementedError

    def __repr__(self) -> str:
        return as_line(type(self).__name__, self.document())

    def _repr_html_(self) -> str:
        """What Jupyter shows: verdict, curves, scores."""
        return as_html(self.document())

    @property
    def curves(self) -> Floats:
        """(681, 3) red, green, blue, 380 to 720 nm every 0.5 nm, each channel's peak = 1.

        Raises:
            InvalidArgument: the result was refused.
        """
        return columns(with_curves(self.document())["ssf"])

    @property
    def std(self) -> Floats | None:
        """(681, 3) one standard deviation of `curves`; None on a basis without a prior.

        Raises:
            InvalidArgument: the result was refused.
        """
        found = with_curves(self.document()).get("ssf_std")
        return None if found is None else columns(found)

    def plot(self, kind: Kind = "curves", ax: Axes | None = None, *, shot: int = 1) -> Axes:
        """Draw the result.

        Args:
            kind: "curves" with their 95 % bands; "residuals", predicted less measured signals of patches that the fit
                had not seen, %; "patches", the measured and the predicted colour of each; "budget", where the band
                comes from.
            ax: matplotlib axes to draw on; new ones unless given.
            shot: which one, from 1, for residuals and patches.

        Returns:
            The axes.

        Raises:
            InvalidArgument: a refused result, another kind, a shot that there is not, or no matplotlib.
        """
        from camssf.documents.plots import draw

        axes: Axes = draw(self.document(), kind, ax, shot)
        return axes

    def to_colour(self) -> RGB_CameraSensitivities:
        """The curves as colour-science's RGB_CameraSensitivities, every 0.5 nm.

        The channels keep the camera's own scale, and with it its white balance; the largest peak is 1.

        Raises:
            InvalidArgument: a refused result, or one whose first lamp is not known any more.
        """
        from camssf.documents.tables import to_colour

        return to_colour(self.document())

    def to_pandas(self, table: Table = "curves") -> pandas.DataFrame:
        """A DataFrame: "curves" by wavelength_nm; "patches" of all shots; or "budget" by source.

        Raises:
            InvalidArgument: a refused result (its patches are there), another table, or no pandas.
        """
        from camssf.documents.tables import to_pandas

        return to_pandas(self.document(), table)

    def to_xarray(self) -> xarray.Dataset:
        """A Dataset: ssf and ssf_std over wavelength and channel, signals over shot, patch and channel.

        Raises:
            InvalidArgument: a refused result, or no xarray.
        """
        from camssf.documents.tables import to_xarray

        return to_xarray(self.document())

    def save(self, path: str | PathLike[str]) -> Path:
        """Write the result document; the same result gives the same bytes. `load` reads it, as does every command.

        Returns:
            The file.

        Raises:
            InvalidArgument: it cannot be written there.
        """
        document = self.document()
        check_document(document, "document")
        write_file(Path(path), document_bytes(document))
        return Path(path)

    @staticmethod
    def load(path: str | PathLike[str]) -> SavedResult:
        """A result from its document, whoever wrote it: Python, the command line or a phone.

        Raises:
            InvalidArgument: the file is no sound "camssf-result/1".
        """
        return SavedResult(read_document(Path(path)))


@dataclass(frozen=True, repr=False)
class SavedResult(Result):
    """A result read from its document: all that was found, but not the photos' samples.

    Attributes:
        content: the document, checked. It is not to be changed.
    """

    content: Json = field(repr=False)

    def __post_init__(self) -> None:
        check_document(self.content, "document")

    def document(self) -> Json:
        """The result as plain data, "camssf-result/1" (data/result.schema.json)."""
        return self.content

    @property
    def verdict(self) -> Verdict:
        """accepted, doubtful or refused, with the reasons."""
        said = self.content["verdict"]
        reasons = tuple(Reason(**reason) for reason in said["reasons"])
        return Verdict(said["status"], reasons, tuple(Check(**check) for check in said.get("checks", ())))

    @property
    def uncertainty(self) -> Json | None:
        """The band's half-width and its budget, as `Calibration.uncertainty`."""
        return self.content.get("uncertainty")

    @property
    def assumptions(self) -> tuple[Assumption, ...]:
        """All that was taken for granted."""
        return tuple(Assumption(**each) for each in self.content["assumptions"])

    @property
    def scores(self) -> Mapping[str, Any]:
        """As the document has them: rmsre_percent, rmse, delta_e00, unseen; empty where it was refused."""
        return dict(self.content.get("scores") or {})
