"""Results in a notebook: a line, HTML, drawings, tables, files; objects and arrays wherever spectra are asked for."""

import copy
import pickle
from collections.abc import Iterator
from dataclasses import replace
from html import escape
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from camssf import Options
from camssf.calibration import attempt, calibrate
from camssf.documents.document import Curves, Truth, document_bytes
from camssf.documents.scale import channel_scale
from camssf.errors import ChartUnfit, InvalidArgument, LampUnfit
from camssf.grid import WAVELENGTHS
from camssf.report.build import report
from camssf.report.shots import shots_of
from camssf.result import Result
from camssf.spectra import read_camera, read_chart, read_lamp, read_light
from tests.support.captures import shot
from tests.support.documents import changed, document, refused


@pytest.fixture(scope="module")
def result() -> Result:
    return calibrate(shot(), options=Options(basis="cameras"))


@pytest.fixture
def plt() -> Iterator[Any]:
    """matplotlib, whose figures are closed afterwards."""
    pyplot = pytest.importorskip("matplotlib.pyplot")
    yield pyplot
    pyplot.close("all")


def test_a_result_is_one_line(result: Result) -> None:
    said = repr(result)
    assert ("\n" in said, len(said) < 300) == (False, True)
    for word in ("Result", "D55", result.verdict.status, "cameras", "RMSRE", "±"):
        assert word in said, said


def test_a_refusal_says_why() -> None:
    found = attempt(shot().white, "D55")
    assert "refused (chart_not_found)" in repr(found)
    assert escape(found.error.advice) in found._repr_html_()
    numbers = (lambda: found.at(550), lambda: found.sample(1, 0), lambda: found.curves)
    for ask in (found.plot, found.to_colour, found.to_xarray, found.to_pandas, *numbers):
        with pytest.raises(InvalidArgument, match="refused"):
            ask()


def test_the_html_is_balanced_and_holds_verdict_curves_and_scores(result: Result) -> None:
    ElementTree.fromstring(text := result._repr_html_())
    assert text.count("<svg") == 1
    assert [text.count(f'class="{kind} ') for kind in ("curve", "band")] == [3, 3]
    assert result.verdict.status in text
    assert "RMSRE" in text
    assert "<script" not in text
    assert len(text) < 40_000


def test_hostile_names_stay_text() -> None:
    shot, model = "capture__shots__0__", "x\n\x1b[31m" + "y" * 500
    names = {"photo__make": "<b>&", "photo__model": model, "lamp__name": "</p><script>alert(1)</script>"}
    found = changed(document("D55"), **{shot + place: name for place, name in names.items()})
    assert "<script" not in found._repr_html_()
    assert not set("\x1b\n") & set(repr(found))
    ElementTree.fromstring(found._repr_html_())


def test_curves_at_wavelengths_are_linear_between_the_grid_s(result: Result) -> None:
    values, std = result.at(550.0)
    assert np.array_equal(values, result.curves[340])
    assert np.array_equal(std, result.std[340])
    values, std = result.at([[380.0, 550.25], [600.0, 720.0]])
    assert values.shape == np.shape(std) == (2, 2, 3)
    assert values[0, 1] == pytest.approx(result.curves[340:342].mean(axis=0), abs=1e-12)
    assert changed(result, answer__std=None).at(550)[1] is None
    for outside in (379.9, [550.0, 720.5], np.nan, "green"):
        with pytest.raises(InvalidArgument, match="not a number between 380 and 720 nm"):
            result.at(outside)


def test_draws_have_the_result_s_mean_bands_and_covariance(result: Result) -> None:
    covariance, std = result.covariance, result.std
    variance = np.einsum("mcmc->mc", covariance)
    np.testing.assert_allclose(variance, std**2, atol=1e-5 * float((std**2).max()))
    draws = result.sample(2000, 7)
    assert draws.shape == (2000, 681, 3)
    assert np.array_equal(draws[:3], result.sample(2000, np.random.default_rng(7))[:3])
    off = draws - result.curves
    assert (np.abs(off.mean(axis=0)) <= 5.0 * std / np.sqrt(2000) + 1e-9).all()
    np.testing.assert_allclose(off.std(axis=0), std, rtol=0.08, atol=1e-4)
    for count, seed in ((0, 7), (2.0, 7), (2, -1), (2, "seed")):
        with pytest.raises(InvalidArgument, match=r"not a (seed|number of draws)"):
            result.sample(count, seed)
    green, blue = off[:, 300, 1], off[:, 250, 2]
    error = 5.0 * std[300, 1] * std[250, 2] / np.sqrt(2000)
    assert float(np.mean(green * blue)) == pytest.approx(covariance[300, 1, 250, 2], abs=error)


def test_z_scores_and_coverage_need_a_truth(result: Result) -> None:
    assert result.z_scores is result.coverage is None
    std = result.std
    beyond = np.where(WAVELENGTHS < 460.0, 3.0, 1.0)[:, None] * std  # 120 of the 601 points from 400 to 700 nm
    judged = replace(result, truth=Truth("made", Curves.of(result.curves - beyond)))
    np.testing.assert_allclose(judged.z_scores, beyond / std, rtol=1e-9)
    assert judged.coverage == pytest.approx([481 / 601] * 3)
    assert changed(judged, answer__std=None).coverage is None


def test_plots_hold_the_result_s_numbers(result: Result, plt: Any) -> None:
    own = plt.subplots()[1]
    axes = result.plot(ax=own)
    assert axes is own
    drawn, curve = axes.lines[1].get_ydata(), np.maximum(result.curves[:, 1], 0.0)
    np.testing.assert_allclose(drawn[::20], curve[::20], atol=1e-12)  # between the basis' values it is smooth
    np.testing.assert_allclose(drawn, curve, atol=0.02)
    said = shots_of(result)[0].patches
    axes = result.plot("residuals")
    green = dict(zip(np.rint(axes.lines[1].get_xdata()), axes.lines[1].get_ydata(), strict=True))
    for i in np.flatnonzero(said.used):
        assert green[i + 1] == pytest.approx(100 * (said.unseen[i, 1] / said.signal[i, 1] - 1))
    picture = result.plot("patches").images[0].get_array()
    assert np.allclose(picture[1, 2], said.measured_srgb[7])
    bars = result.plot("budget").patches
    assert sum(bar.get_width() for bar in bars) == pytest.approx(300.0)


@pytest.mark.usefixtures("plt")
def test_several_results_are_in_one_plot(result: Result) -> None:
    other = changed(document("A"), capture__shots__0__photo__model="$x$")
    alone = len(result.plot().lines)
    axes = result.plot(others=[other, result])
    assert len(axes.lines) == alone + 6
    green = axes.lines[alone + 1]
    np.testing.assert_allclose(green.get_ydata()[::20], np.maximum(other.curves[::20, 1], 0.0), atol=1e-12)
    assert green.is_dashed()
    names = [text.get_text() for text in axes.get_legend().get_texts()]
    assert len(names) == 3
    assert "$x$" in names[1]


def test_plots_refuse_what_they_cannot_draw(result: Result) -> None:
    for options, words in (
        ({"kind": "spectrum"}, "no plot 'spectrum'"), ({"shot": 2}, "no shot 2"), ({"shot": True}, "no shot True"),
        ({"kind": "budget", "others": [result]}, "'budget' shows one result"), ({"others": [refused()]}, "refused"),
        ({"ax": "axes"}, "A str is not a matplotlib axes"),
    ):  # fmt: skip
        with pytest.raises(InvalidArgument, match=words):
            result.plot(**options)
    with pytest.raises(InvalidArgument, match="no table 'all'"):
        result.to_pandas("all")


def test_saved_and_loaded_it_is_the_same_result(result: Result, tmp_path: Path) -> None:
    path = result.save(tmp_path / "phone.json")
    assert path.read_bytes() == document_bytes(result) == report(result).result_json
    again = Result.load(path)
    assert repr(again) == repr(result)
    assert again.verdict.checks == result.verdict.checks != ()
    assert again.save(tmp_path / "again.json").read_bytes() == path.read_bytes()
    assert result == result
    assert result != replace(result)  # its document tells whether two are alike


def test_a_pickle_is_small_and_whole_but_for_the_pictures(result: Result) -> None:
    data = pickle.dumps(result)
    assert len(data) < 1_000_000
    again = pickle.loads(data)
    assert document_bytes(again) == document_bytes(result)
    assert result.previews[0] is not None
    assert again.previews == (None,)
    assert document_bytes(copy.copy(result)) == document_bytes(result)
    assert result.capture.shots[0].thumbnail is not None


@pytest.mark.full
def test_pandas_has_curves_patches_and_budget(result: Result) -> None:
    pytest.importorskip("pandas")
    table, colours = result.to_pandas(), ["red", "green", "blue"]
    assert table.index.name == "wavelength_nm"
    assert np.array_equal(table[colours].to_numpy(), result.curves)
    assert np.array_equal(table[[f"{colour}_std" for colour in colours]].to_numpy(), result.std)
    patches = result.to_pandas("patches")
    assert len(patches) == 24 * 3
    row = patches[(patches.patch == patches.patch[21]) & (patches.channel == "green")].iloc[0]
    assert row.signal == result.signals.values[0, 7, 1]
    budget = result.to_pandas("budget")
    assert budget.sum().to_numpy() == pytest.approx([1, 1, 1])
    assert list(budget.columns) == colours


@pytest.mark.full
def test_xarray_has_names_for_every_axis(result: Result) -> None:
    pytest.importorskip("xarray")
    found = result.to_xarray()
    assert found.ssf.dims == ("wavelength", "channel")
    assert float(found.ssf.sel(wavelength=550, channel="green")) == result.curves[340, 1]
    assert found.signal.shape == (1, 24, 3)
    assert bool(np.array_equal(found.used.values, result.signals.used))
    assert found.wavelength.attrs["units"] == "nm"


def test_colour_science_takes_the_curves(result: Result) -> None:
    found = result.to_colour()
    assert type(found).__name__ == "RGB_CameraSensitivities"
    assert np.array_equal(found.wavelengths, WAVELENGTHS)
    for curves in (found, read_camera(found)):
        assert np.allclose(curves.values, result.curves * channel_scale(result))


def test_a_lamp_may_be_an_object_or_arrays() -> None:
    colour = pytest.importorskip("colour")
    named = read_lamp("D65").values
    lamp = colour.SDS_ILLUMINANTS["D65"]
    pair = (np.asarray(lamp.wavelengths), np.asarray(lamp.values))
    for given in (lamp, pair, [list(each) for each in pair], np.array(pair)):
        found = read_light(given)
        assert found.name != "D65"  # a result that says D65 means the table
        assert np.abs(found.values / named - 1).max() < 1e-12
        assert found.tolerance == 0.01
    assert "SpectralDistribution" in read_lamp(lamp).source
    given = read_lamp("A")
    assert read_lamp(given) is given
    with pytest.raises(InvalidArgument, match="There is no file D65"):
        read_lamp(Path("D65"))


def test_a_lamp_that_is_none_is_a_typed_error() -> None:
    nm = np.arange(380.0, 721.0, 5.0)
    for lamp, kind, words in (
        (5, InvalidArgument, "int is no lamp"), ({}, InvalidArgument, "dict is no lamp"),
        ((nm, nm[:-1]), InvalidArgument, "shapes"), ((nm, np.stack([nm, nm])), InvalidArgument, "holds 2 spectra"),
        ((nm, -nm), LampUnfit, "no power"), ((nm[:10], nm[:10]), LampUnfit, "covers only"),
        ((nm, nm * np.nan), LampUnfit, "no number|not a number"),
    ):  # fmt: skip
        with pytest.raises(kind, match=words) as caught:
            read_lamp(lamp)
        assert caught.value.advice


def test_a_chart_may_be_objects_or_arrays() -> None:
    colour = pytest.importorskip("colour")
    named = read_chart("classic24")
    table = colour.SDS_COLOURCHECKERS["BabelColor Average"]
    many = colour.colorimetry.sds_and_msds_to_msds(list(table.values()))
    for given in (table, many, (many.wavelengths, np.asarray(many.values).T)):
        found = read_chart(given)
        assert np.abs(found.values - named.values).max() < 1e-12
        assert (found.layout.name, found.white) == ("classic24", named.white)
        assert found.tolerance[0] == 0.01
    assert read_chart(table).patches == named.patches
    assert read_chart(named) is named
    with pytest.raises(InvalidArgument, match="23 patches"):
        read_chart((many.wavelengths, np.asarray(many.values).T[:23]))
    with pytest.raises(InvalidArgument, match="int is no chart"):
        read_chart(24)
    with pytest.raises(ChartUnfit, match="upside down"):
        read_chart((many.wavelengths, np.asarray(many.values).T[::-1]))


def test_calibrate_takes_objects_and_arrays(result: Result) -> None:
    """A pair of arrays is one lamp, not two."""
    read = (read_lamp("D55"), read_chart("classic24"), read_camera("Nikon 5100 (NPL)"))
    lamp, chart, truth = ((WAVELENGTHS, table.values) for table in read)
    found = calibrate(replace(shot(), lamp=lamp), chart=chart, truth=truth, options=Options(basis="cameras"))
    assert np.abs(found.curves - result.curves).max() < 0.05
    stated = found.capture.shots[0].lamp
    assert (stated.name, stated.tolerance, stated.source) == ("lamp (given)", 0.01, "given as arrays")
    assert found.scores.rmse is not None
    with pytest.raises(InvalidArgument, match="is no lamp"):
        calibrate(shot().photo, ["D55", lamp])
