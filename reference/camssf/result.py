"""The result of a calibration: its document, with what a notebook does with it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from camssf.documents.curve_errors import error_modes
from camssf.documents.document import Curves, Document, Truth, answer_in, document_bytes, read_document
from camssf.documents.forms import BrokenError
from camssf.documents.stored_lamp import lamp_of
from camssf.errors import CalibrationError, InvalidArgument
from camssf.files import write_file
from camssf.fit.scores import Scores, rmse
from camssf.fit.solutions import Uncertainty
from camssf.grid import BAND, WAVELENGTHS, Floats
from camssf.photo.signals import Signals, normalise
from camssf.recovery.sensitivity import Ssf
from camssf.report.comparison import VISIBLE, in_deviations
from camssf.report.notebook import as_html, as_line
from camssf.report.previews import previews
from camssf.shapes import Apart
from camssf.spectra import CameraCurves
from camssf.verdict.reasons import Verdict, reason_of

if TYPE_CHECKING:
    import pandas
    import xarray
    from colour.characterisation import RGB_CameraSensitivities
    from matplotlib.axes import Axes

    from camssf.report.comparison import Comparison

Kind: TypeAlias = Literal["curves", "residuals", "patches", "budget"]
"""What `Result.plot` draws."""
Table: TypeAlias = Literal["curves", "patches", "budget"]
"""What `Result.to_pandas` lists."""


@dataclass(frozen=True, kw_only=True, repr=False, eq=False)
class Result(Document):
    """A capture, its verdict, and the answer unless it was refused.

    `save` writes its document, which `load` reads. A pickle or a copy leaves out the photos' thumbnails, which are
    most of its size.

    Attributes:
        format, version, capture, answer, verdict, assumptions, truth, sha256: as in `Document`.
        ssf: the solver's own product; None in a result that was read from a file.
        error: why it was refused, as `calibrate` raises it; None in any other result.
    """

    verdict: Verdict
    ssf: Annotated[Ssf | None, Apart()] = None
    error: Annotated[CalibrationError | None, Apart()] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.verdict is None:
            raise BrokenError("", "is a capture that was not solved: `camssf solve` makes a result of it")

    def __repr__(self) -> str:
        return as_line(self, self.verdict)

    def _repr_html_(self) -> str:
        """HTML for Jupyter: verdict, curves, scores."""
        return as_html(self, self.verdict)

    def __getstate__(self) -> dict[str, Any]:
        """The state for a pickle or a copy, without the thumbnails."""
        capture = self.capture
        if capture is not None:
            capture = replace(capture, shots=tuple(replace(shot, thumbnail=None) for shot in capture.shots))
        return vars(self) | {"capture": capture}

    @property
    def curves(self) -> Floats:
        """(681, 3) red, green, blue, 380 to 720 nm every 0.5 nm, each channel's peak = 1.

        Raises:
            InvalidArgument: the result was refused.
        """
        return answer_in(self).curves.values

    @property
    def std(self) -> Floats | None:
        """(681, 3) one standard deviation of `curves`; None on a basis without a prior.

        Raises:
            InvalidArgument: the result was refused.
        """
        std = answer_in(self).std
        return None if std is None else std.values

    @property
    def covariance(self) -> Floats | None:
        """(681, 3, 681, 3) covariance of `curves`: of wavelength and channel with wavelength and channel.

        Its diagonal is `std` squared, to 1e-5 of the largest. It is that of the code, carried to curves of peak 1.
        What else the band holds (the misfit profile, the difference between mixed hypotheses) is taken as smooth over
        BAND_CORRELATION of `curve_errors` and independent between channels; so is all where the result's basis is not
        the installed one. None on a basis without a prior.

        Raises:
            InvalidArgument: the result was refused.
        """
        modes = self._error_modes()
        return np.tensordot(modes, modes, axes=(0, 0)) if len(modes) else None

    def at(self, wavelengths: ArrayLike) -> tuple[Floats, Floats | None]:
        """Curves and standard deviations at wavelengths, linear between those of the grid.

        Args:
            wavelengths: nm, one number or an array, 380 to 720.

        Returns:
            (..., 3) values of `curves`, and of `std`, None on a basis without a prior.

        Raises:
            InvalidArgument: the result was refused, or a wavelength outside 380 to 720 nm.
        """
        try:
            nm = np.asarray(wavelengths, dtype=np.float64)
        except (TypeError, ValueError):
            nm = np.array(np.nan)
        if not ((nm >= WAVELENGTHS[0]) & (nm <= WAVELENGTHS[-1])).all():
            raise InvalidArgument("A wavelength is not a number between 380 and 720 nm.", "Give nanometres.")

        def between(values: Floats) -> Floats:
            return np.stack([np.interp(nm, WAVELENGTHS, column) for column in values.T], axis=-1)

        return between(self.curves), None if self.std is None else between(self.std)

    def sample(self, count: int, seed: int | np.random.Generator) -> Floats:
        """Draws of the curves, (count, 681, 3), from a normal distribution of mean `curves` and of `covariance`.

        It is the Gaussian approximation of the posterior about these curves, each channel's peak = 1: a draw may be
        negative or above 1 where a sensitivity may not, and its largest value is only near 1.

        Args:
            count: number of draws.
            seed: of NumPy's generator, or a generator.

        Raises:
            InvalidArgument: the result was refused, has no band, or `count` or `seed` is not such a number.
        """
        modes = self._error_modes()
        if not len(modes):
            raise InvalidArgument("This result has no band, so no draws.", "Choose a basis with a prior.")
        if isinstance(count, bool) or not isinstance(count, int | np.integer) or count < 1:
            raise InvalidArgument(f"`count` is {count!r}, not a number of draws.", "Give 1 or more.")
        try:
            generator = np.random.default_rng(seed)
        except (TypeError, ValueError) as error:
            raise InvalidArgument(f"`seed` is {seed!r}, not a seed.", "Give 0 or more, or a generator.") from error
        steps = generator.standard_normal((int(count), len(modes)))
        return np.asarray(self.curves + np.tensordot(steps, modes, axes=1))

    def _error_modes(self) -> Floats:
        """(q, 681, 3) independent modes of the errors of `curves`; none without a band."""
        answer, lamp = answer_in(self), lamp_of(self, 0)
        return error_modes(answer, None if lamp is None else lamp.values)[0]

    @property
    def z_scores(self) -> Floats | None:
        """(681, 3) `curves` minus the truth over `std`; None without a truth or without a band.

        Raises:
            InvalidArgument: the result was refused.
        """
        curves, std = self.curves, self.std
        if self.truth is None or std is None:
            return None
        return in_deviations(curves - self.truth.curves.values, std)

    @property
    def coverage(self) -> Floats | None:
        """(3,) share of each channel's truth, 400 to 700 nm, in the 95 % band; None as `z_scores`.

        Raises:
            InvalidArgument: the result was refused.
        """
        z = self.z_scores
        return None if z is None else np.asarray((np.abs(z[VISIBLE]) <= BAND).mean(axis=0))

    @property
    def scores(self) -> Scores:
        """The quality of the answer.

        Raises:
            InvalidArgument: the result was refused.
        """
        return answer_in(self).scores

    @property
    def uncertainty(self) -> Uncertainty | None:
        """Width of the band and its sources; None on a basis without a prior.

        Raises:
            InvalidArgument: the result was refused.
        """
        return answer_in(self).uncertainty

    @property
    def signals(self) -> Signals:
        """Eq. (5), with the patches that the fit used.

        Raises:
            InvalidArgument: the result was refused.
        """
        used, capture = np.array(answer_in(self).used), self.capture
        assert capture is not None
        return replace(normalise([shot.means for shot in capture.shots], capture.chart), used=used)

    @property
    def previews(self) -> tuple[bytes | None, ...]:
        """A JPEG of each photo's active area, for the report; None where the capture holds no thumbnail."""
        return () if self.capture is None else previews(self.capture)

    def with_truth(self, truth: CameraCurves) -> Result:
        """The result with measured curves to compare with, and the RMSE against them; unchanged if refused."""
        if self.answer is None:
            return self
        scores = replace(self.answer.scores, rmse=rmse(self.curves, truth.values))
        curves = Curves.of(truth.values / truth.values.max(axis=0))
        return replace(self, answer=replace(self.answer, scores=scores), truth=Truth(truth.name, curves))

    def plot(
        self, kind: Kind = "curves", ax: Axes | None = None, *, shot: int = 1, others: Sequence[Result] = ()
    ) -> Axes:
        """Draw the result.

        Args:
            kind: "curves" with their 95 % bands; "residuals", cross-validated prediction minus measured signal of
                each patch, %; "patches", the measured and the predicted colour of each; "budget", the sources of the
                band.
            ax: matplotlib axes to draw on; new ones unless given.
            shot: which one, from 1, for residuals and patches.
            others: results whose curves are drawn in dashes with those of this one.

        Returns:
            The axes.

        Raises:
            InvalidArgument: a refused result, an unknown kind, a shot that does not exist, others in another kind of
                plot than "curves", or no matplotlib.
        """
        from camssf.report.plots import draw

        axes: Axes = draw(self, kind, ax, shot, others)
        return axes

    def to_colour(self) -> RGB_CameraSensitivities:
        """The curves as colour-science's RGB_CameraSensitivities, every 0.5 nm.

        The channels keep their relative scale, and so the camera's white balance; the largest peak is 1.

        Raises:
            InvalidArgument: a refused result, or a channel that has no response to the first shot's light.
        """
        from camssf.report.tables import to_colour

        return to_colour(self)

    def compare(self, other: Result) -> Comparison:
        """How the curves differ from another result's: of this unit earlier, or of another unit.

        Errors that the two share (chart, lamp, prior) are counted as independent, so `Comparison.z` is conservative:
        a difference counts for less than it would if the shared part were taken out.

        Raises:
            InvalidArgument: one of the two was refused, or `other` is no result.
        """
        from camssf.report.comparison import compare as compare_curves

        return compare_curves(self, other)

    def to_pandas(self, table: Table = "curves") -> pandas.DataFrame:
        """A DataFrame: "curves" by wavelength_nm; "patches" of all shots; or "budget" by source.

        Raises:
            InvalidArgument: a refused result (except for "patches"), an unknown table, or no pandas.
        """
        from camssf.report.tables import to_pandas

        return to_pandas(self, table)

    def to_xarray(self) -> xarray.Dataset:
        """A Dataset: ssf and ssf_std over wavelength and channel, signals over shot, patch and channel.

        Raises:
            InvalidArgument: a refused result, or no xarray.
        """
        from camssf.report.tables import to_xarray

        return to_xarray(self)

    def save(self, path: str | PathLike[str]) -> Path:
        """Write the result document; the same result gives the same bytes. `load` and all commands can read it.

        Returns:
            The file.

        Raises:
            InvalidArgument: it cannot be written there.
        """
        write_file(Path(path), document_bytes(self))
        return Path(path)

    @staticmethod
    def load(path: str | PathLike[str]) -> Result:
        """Read a result from its document, written by Python, the command line or a phone.

        Raises:
            InvalidArgument: the file is no result.
        """
        return read_document(path, Result)


def refused(error: CalibrationError) -> Result:
    """The result of a refused capture: what was measured, and why it was refused."""
    from camssf.documents.document import FORMAT
    from camssf.version import __version__

    reasons = error.reasons or (reason_of(error),)
    verdict = Verdict("refused", reasons, error.checks)
    return Result(format=FORMAT, version=__version__, capture=error.capture, verdict=verdict, error=error)
