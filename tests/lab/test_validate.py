"""Judged by limits computed by hand, and for colours by the spectra themselves."""

import numpy as np
import pytest
from numpy.typing import NDArray

from camssf.colorimetry import D65, delta_e00, lab, srgb, under_d65, white_of, xyz_of
from camssf.errors import InvalidArgument
from camssf.fit.scores import PatchColours, Scores, patch_colours, reflectance_srgb, rmse, rmsre, validate
from camssf.grid import WAVELENGTHS, Floats
from camssf.photo.signals import Signals
from camssf.spectra import CameraCurves, Lamp, read_camera, read_chart, read_lamp
from camssf.spectra.bundled import observer
from tests.support.problems import theory

TABLE = read_chart("classic24")
LAMPS = (read_lamp("D55"), read_lamp("A"))
CAMERA = read_camera("Nikon 5100 (NPL)")


def signals(values: Floats, used: NDArray[np.bool_] | None = None) -> Signals:
    k, n, _ = values.shape
    used = np.ones((k, n), bool) if used is None else used
    error, white, dark = (np.full_like(values, level) for level in (1e-3, 1000.0, 0.0))
    return Signals(values, error, 1000 * values, white, dark, used, np.zeros(k, bool), ())


Y = np.stack([theory(TABLE.values, lamp.values, CAMERA.values) for lamp in LAMPS])


def score(predicted: Floats, **more: object) -> Scores:
    return validate(signals(Y), predicted, TABLE, LAMPS, **more)  # type: ignore[arg-type]


def pictures(
    predicted: Floats, y: Floats = Y, used: NDArray[np.bool_] | None = None
) -> tuple[PatchColours, PatchColours]:
    """Colours of the measured and of the predicted patches."""
    return patch_colours(y, predicted, signals(y, used).used, TABLE, np.stack([lamp.values for lamp in LAMPS]))


def test_eq_13_by_hand() -> None:
    """Errors of 3 % and 4 % on two patches, none of the other entries: √((9 + 16) / 2) %; green and blue apart."""
    predicted, unseen = Y * 1.5, np.zeros((2, 24), bool)
    unseen[0, 4] = unseen[1, 7] = True
    predicted[0, 4] = Y[0, 4] * (1.03, 1.0, 0.9)
    predicted[1, 7] = Y[1, 7] * (0.96, 1.0, 1.1)
    np.testing.assert_allclose(
        score(predicted, unseen=unseen).rmsre_percent, [np.sqrt(12.5), 0, 10], rtol=1e-10, atol=1e-12
    )


def test_unseen_is_what_was_used_unless_given() -> None:
    used = np.zeros((2, 24), bool)
    used[:, 3:9] = True
    predicted = np.where(used[:, :, None], Y * 1.02, Y * 5)
    np.testing.assert_allclose(validate(signals(Y, used), predicted, TABLE, LAMPS).rmsre_percent, 2.0, rtol=1e-10)
    few = np.arange(24) < np.array([[1], [1]])
    assert np.abs(pictures(Y * 1.01, used=few)[0].srgb - reflectance_srgb(TABLE)).mean() < 0.03


@pytest.mark.parametrize("faint", [0.0, -0.01, 1e-7, 1e-310])
def test_a_signal_of_nothing_has_no_relative_error(faint: float) -> None:
    y = Y.copy()
    y[0, 5, 2] = faint
    predicted = y * 1.01
    predicted[0, 5] = 0.2
    scores = validate(signals(y), predicted, TABLE, LAMPS)
    rest = np.ones((2, 24), bool)
    rest[0, 5] = False
    assert scores.rmsre_percent[2] == pytest.approx(1.0)  # left out
    assert scores.rmsre_percent[0] > 1.0  # the red of the same patch is not
    np.testing.assert_allclose(rmsre(y, predicted, rest), 1.0)
    assert np.isfinite(scores.delta_e00)


def test_rmse_by_hand() -> None:
    """Off by 0.1 of the peak in 400 to 450 nm, 101 of 601 points; what lies outside 400 to 700 nm does not count."""
    curves = np.ones((681, 3)) * (1.0, 2.0, 3.0)
    off = curves.copy()
    off[(WAVELENGTHS >= 400) & (WAVELENGTHS <= 450), 1] -= 0.2
    off[(WAVELENGTHS < 400) | (WAVELENGTHS > 700)] = 0
    np.testing.assert_allclose(rmse(off, curves), [0, 0.1 * np.sqrt(101 / 601), 0], rtol=1e-12, atol=1e-15)


def test_rmse_knows_no_scale_and_is_symmetric_and_a_truth_is_scored_by_it() -> None:
    other = read_camera("Sigma SDMerill (NPL)").values
    expected = rmse(CAMERA.values, other)
    assert (expected > 0.05).all()
    np.testing.assert_allclose(rmse(CAMERA.values * (7.0, 1e-4, 0.3), other * 42), expected, rtol=1e-12)
    np.testing.assert_allclose(rmse(other, CAMERA.values), expected, rtol=1e-12)
    scored = score(Y, ssf_values=3 * CAMERA.values, truth=CameraCurves("other", other, ""))
    np.testing.assert_allclose(scored.rmse, expected, rtol=1e-12)
    assert score(Y, ssf_values=CAMERA.values).rmse is None


def lab_and_srgb(values: Floats, lamp: Lamp) -> tuple[Floats, Floats]:
    """By the formulas that test_transforms.py holds to colour-science's, from spectra alone."""
    seen = under_d65(xyz_of(values, lamp.values, observer("1931")), white_of(lamp.values))
    return lab(seen, D65), np.clip(srgb(seen), 0, 1)


def test_delta_e_and_pictures_are_those_of_the_spectra() -> None:
    """For the CIE observer as a camera, whose signals are XYZ but for a scale, colours follow from spectra alone."""
    camera = observer("1931")
    faded = TABLE.with_values(TABLE.values * (0.9 + 0.2 * (WAVELENGTHS - 380) / 340))
    y, guess = (np.stack([theory(t.values, lamp.values, camera) for lamp in LAMPS]) for t in (TABLE, faded))
    unseen = np.zeros((2, 24), bool)
    unseen[0, :12] = unseen[1, 6:] = True
    scores = validate(signals(y), guess, TABLE, LAMPS, unseen=unseen)
    measured, synthetic = pictures(guess, y)
    apart = []
    for j, lamp in enumerate(LAMPS):
        (true, shown), (other, other_shown) = (lab_and_srgb(t.values, lamp) for t in (TABLE, faded))
        np.testing.assert_allclose(measured.srgb[j], shown, atol=1e-9)
        np.testing.assert_allclose(synthetic.srgb[j], other_shown, atol=1e-9)
        apart.append(delta_e00(true, other))
    assert 1 < np.stack(apart)[unseen].mean() < 10
    assert scores.delta_e00 == pytest.approx(np.stack(apart)[unseen].mean(), rel=1e-8)


def test_reflectance_colours_are_those_under_d65() -> None:
    np.testing.assert_allclose(reflectance_srgb(TABLE), lab_and_srgb(TABLE.values, read_lamp("D65"))[1], atol=1e-9)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"predicted": Y[:, :12]}, "do not fit together"),
        ({"lamps": LAMPS[:1]}, "do not fit together"),
        ({"unseen": np.ones(24, bool)}, "do not fit together"),
        ({"predicted": np.where(Y > 0.5, np.nan, Y)}, "not a number"),
        ({"signals": signals(np.where(Y > 0.5, np.inf, Y))}, "not a number"),
        ({"unseen": np.zeros((2, 24), bool)}, "No patch is left"),
        ({"truth": CAMERA}, "curves are empty"),
        ({"truth": CAMERA, "ssf_values": np.zeros((681, 3))}, "cannot be compared"),
        ({"truth": CAMERA, "ssf_values": np.ones((69, 3))}, "cannot be compared"),
        ({"truth": CAMERA, "ssf_values": np.full((681, 3), np.nan)}, "cannot be compared"),
    ],
)
def test_what_does_not_fit_is_refused(change: dict[str, object], words: str) -> None:
    arguments = {"signals": signals(Y), "predicted": Y, "table": TABLE, "lamps": LAMPS} | change
    with pytest.raises(InvalidArgument, match=words) as caught:
        validate(**arguments)  # type: ignore[arg-type]
    assert caught.value.advice
