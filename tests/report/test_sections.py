"""The sections of a page: the certificate, bands, light, noise, and two results compared."""

import html
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import truncnorm

from camssf.documents.document import Curves
from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS, Floats
from camssf.photo.read.unit import read_unit
from camssf.recovery.basis import read_basis
from camssf.recovery.observation import Observation
from camssf.recovery.sensitivity import solve_on_basis
from camssf.report.build import report
from camssf.report.comparison import LIMIT, compare, worst_of
from camssf.report.provenance import Provenance, read_provenance
from camssf.report.sections import certificate, drawings
from camssf.report.sections import patches as patch_view
from camssf.report.sections.bands import possible
from camssf.report.sections.curves import curves_of
from camssf.report.shots import ShownPatches
from camssf.rules import rules
from camssf.spectra import read_chart, read_lamp
from camssf.spectra.lights import unnamed_light
from camssf.verdict.reasons import Reason, Verdict
from camssf_colour.colour_error import expected_error
from tests.report.conftest import Page, html_of, number, patches_in, points, put, shot_of
from tests.support.captures import photos
from tests.support.documents import changed, document, known, refused, unnamed


def test_every_check_has_its_sentence() -> None:
    """Both ways: no check of the rules without one, and none for a number that is no check."""
    checked = {name.removeprefix("verdict.") for name, rule in rules().numbers.items()
               if name.startswith("verdict.") and rule.makes}  # fmt: skip
    made = {check.name for check in (*document("D55", "A").verdict.checks, *unnamed().verdict.checks)}
    assert checked | made == set(certificate.CHECK_SENTENCES)
    assert all(each.endswith(".") for pair in certificate.CHECK_SENTENCES.values() for each in pair)


def test_every_check_of_the_verdict_is_listed_with_value_limit_and_margin() -> None:
    made = document("D55", "A")
    listed = certificate.checks_of(made.verdict)
    given = made.verdict.checks
    assert sum(len(check.by_shot) for check in listed) == len(given)
    page = html_of(made)
    rows = re.findall(r'<tr class="(held|doubtful|refused)"><th scope="row">(.*?)</th>(.*?)</tr>', page, re.DOTALL)
    assert len(rows) == len({check.name for check in given})
    shown = {}
    for state, what, cells in rows:
        numbers = [re.findall(r'<span class="one \w+">(.*?)</span>', cell) for cell in cells.split("</td>")[:3]]
        shown[html.unescape(re.sub("<[^>]*>", "", what))] = state, numbers
    for name in {check.name for check in given}:
        own = [check for check in given if check.name == name]
        (found,) = [each for what, each in shown.items() if rules().numbers[f"verdict.{name}"].what in what]
        broken = [c.value > c.limit if c.beyond == "above" else c.value < c.limit for c in own]
        assert found[0] == ("doubtful" if any(broken) else "held")
        values, limits, margins = found[1]
        limits = limits * len(own) if len(limits) == 1 else limits  # the shots' own, or one for all
        for check, value, limit, margin in zip(own, values, limits, margins, strict=True):
            assert number(value) == pytest.approx(check.value, rel=0.005)
            assert limit == ("\u2264 " if check.beyond == "above" else "\u2265 ") + f"{check.limit:g}"
            inside = (check.limit - check.value) * (1 if check.beyond == "above" else -1)
            assert number(margin) == pytest.approx(inside, rel=0.05)
    assert "What was checked" not in html_of(refused())


@pytest.mark.parametrize(
    ("value", "state"), [(0.1, "held"), (0.11, "doubtful"), (0.25, "doubtful"), (0.26, "refused")]
)
def test_a_check_beyond_the_limit_that_refuses_says_so(value: float, state: str) -> None:
    (veil,) = (i for i, check in enumerate(document().verdict.checks) if check.name == "veil")
    made = changed(refused(shots=True), **{f"verdict__checks__{veil}__value": value})
    (shown,) = [c for c in certificate.checks_of(made.verdict) if c.what.startswith("signal of the darkest patch")]
    assert shown.state == shown.by_shot[0].state == state
    assert str(shown.by_shot[0].refuses) == "0.25"
    assert "refused beyond 0.25" in Page(html_of(made)).text


def test_the_certificate_says_whose_camera_when_and_signed_by_whom() -> None:
    """What it says of a signed result stands in pages/accepted.txt."""
    made = document()
    bare = {fact.term: fact.text for fact in certificate.facts_of(made, Provenance())}
    assert bare["Unit"] == bare["Lens"] == bare["Photographed"] == "not stated"
    assert bare["Valid"] == "unsigned"
    assert "Unsigned." in Page(html_of(made)).text
    for verified, words in ((True, "Signature verified."), (False, "the signature was not verified")):
        page = Page(html_of(made, provenance=known(made, verified=verified))).text
        assert words in page
        assert "Unsigned" not in page
    assert "Signature" not in Page(html_of(refused())).text


def test_what_the_photos_say_of_the_unit(tmp_path: Path) -> None:
    photo = photos().shots[0].chart
    read = read_provenance([photo, tmp_path / "missing.dng"])
    assert read.unit == read_unit(photo).unit
    assert len(read.captured) == 2
    assert read.captured[1] == ""


def test_a_band_holds_95_percent_of_what_can_be() -> None:
    """Against scipy's truncated normal: the share between the ends, and that no shorter interval has it."""
    sigma, parts = 0.7, np.linspace(0, 0.05, 2001)[:-1]
    for mean in (-3.0, -0.5, 0.0, 0.3, 1.0, 1.9, 2.1, 4.0, 40.0):
        low, high = (float(end) for end in possible(np.array(mean * sigma), np.array(sigma)))
        above_zero = truncnorm(-mean, np.inf, loc=mean * sigma, scale=sigma)
        assert above_zero.cdf(high) - above_zero.cdf(low) == pytest.approx(0.95, abs=1e-9), mean
        shortest = (above_zero.ppf(parts + 0.95) - above_zero.ppf(parts)).min()
        assert high - low <= shortest * (1 + 1e-4), mean
        assert low >= 0
        assert low <= max(mean, 0) * sigma <= high, mean
        assert high <= mean * sigma + 1.96 * sigma or mean < 0, mean


def test_a_band_never_lies_below_zero_and_is_the_gaussian_far_above() -> None:
    mean = np.linspace(-5, 5, 101)
    for std in (0.0, 1e-12, 0.3, 1e12):
        low, high = possible(mean, np.full(101, std))
        assert (low >= 0).all()
        assert (high >= low).all()
        assert np.isfinite(high).all()
    low, high = possible(np.array([3.0]), np.array([0.5]))
    np.testing.assert_allclose([low[0], high[0]], [3 - 0.98, 3 + 0.98], atol=1e-3)
    # A curve's peak is 1 by its scale: only rounding is left of its standard deviation.
    for std in (1e-7, 1e-16, 1e-300):
        np.testing.assert_allclose(possible(np.ones(1), np.array([std])), 1.0, rtol=3e-7)
    deep = possible(np.array([-1e6]), np.array([1.0]))
    assert deep[0][0] == 0
    assert 0 <= deep[1][0] < 1e-3


def test_a_line_is_drawn_within_its_band() -> None:
    """A posterior's mean may lie below zero; without a band the curve is drawn as it is."""
    red = put(document().curves[:, 0], slice(100), -0.01)
    made = changed(document(), answer__curves__red=red, answer__std__red=np.full(681, 0.02))
    drawn = curves_of(made)
    assert (drawn.low <= drawn.ssf).all()
    assert (drawn.ssf <= drawn.high).all()
    assert curves_of(changed(made, answer__std=None)).ssf.min() == -0.01


def test_drawn_and_told_bands_are_those_that_can_be() -> None:
    """In the page, its table and the readouts; the document and the mean half-width keep the Gaussian."""
    made = changed(document(), answer__std__red=np.full(681, 0.3))
    result = report(made)
    assert json.loads(result.result_json)["answer"]["std"]["red"] == [0.3] * 681
    low, high = possible(made.curves[:, 0], np.full(681, 0.3))
    page = Page(result.html)
    y, zero = points(page.of_class("band red")[0]["d"])[:, 1], float(page.of_class("zero")[0]["y1"] or 0)
    assert y.max() <= zero + 0.06
    upper, lower = zero - y[:341], zero - y[341:][::-1]
    scale = upper.sum() / high[::2].sum()
    np.testing.assert_allclose(upper, scale * high[::2], atol=0.15)
    np.testing.assert_allclose(lower, scale * low[::2], atol=0.15)
    row = re.search(r'<tr><th scope="row">450</th>(.*?)</tr>', result.html)
    cells = re.findall("<td>(.*?)</td>", row[1])
    assert cells[3:5] == [f"{low[140]:.4f}", f"{high[140]:.4f}"]
    assert f" ({low[140]:.3f} to {high[140]:.3f})" in result.html
    width = next(cells for label, cells in certificate.channels_of(made, made.answer)[1] if "band" in label)
    assert float(width[0]) == pytest.approx(1.96 * 0.3, abs=5e-4)


def test_a_lamp_is_drawn_with_its_band() -> None:
    made = document("D55", "A")
    page = Page(html_of(made))
    for j, shot in enumerate(made.capture.shots):
        at = next(i for i, (_, a) in enumerate(page.tags) if a.get("id") == f"light-{j + 1}")
        ways = {a.get("class"): a["d"] for tag, a in reversed(page.tags[at : at + 60]) if tag == "path"}
        line, ring = (points(ways[name])[:, 1] for name in ("line", "wash"))
        power = shot.lamp.values[::2] / shot.lamp.values.mean()
        zero, scale = np.polynomial.Polynomial.fit(power, line, 1).convert().coef
        np.testing.assert_allclose((ring[:341] - ring[341:][::-1]) / scale, 2 * 1.96 * 0.02 * power, atol=0.004)
        assert line[0] == pytest.approx(zero + scale * power[0], abs=0.06)
    assert "<h2>The light</h2>" in html_of(refused(shots=True))
    assert "<h2>The light</h2>" not in html_of(changed(refused(shots=True), capture__shots__0__lamp=unnamed_light()))


def test_an_unnamed_light_is_drawn_with_its_kinds_and_their_probabilities() -> None:
    bars = [bar["style"] for bar in Page(html_of(unnamed())).of_class("bar")]
    assert bars == ["--share:0.9300", "--share:0.0400", "--share:0.0300", "--share:0.0000"]


def patches_of(signal: Floats, error: Floats, predicted: Floats) -> ShownPatches:
    unknown, n = np.full(signal.shape, np.nan), len(signal)
    return replace(
        patches_in(document()), names=("",) * n, reflectance_srgb=np.zeros((n, 3)), used=np.ones(n, dtype=bool),
        level=np.ones(n), signal=signal, standard_error=error, predicted=predicted, predicted_std=unknown,
        unseen=unknown, unseen_std=unknown,
    )  # fmt: skip


def test_noise_of_counted_light_lies_on_its_line_and_other_noise_does_not() -> None:
    signal = np.geomspace(0.03, 0.9, 24)[:, None] * np.array([1.0, 0.9, 0.8])
    counted = np.sqrt(1e-8 + 3e-6 * signal + 4e-6 * signal**2)
    drawn = drawings.noise_plot(patches_of(signal, counted, signal), "noise")
    assert drawn.median == pytest.approx((1, 1, 1), rel=1e-6)
    assert len(drawn.plot.dots) == 72
    x, y, colour = drawn.plot.dots[0]
    assert colour == "red"
    line = points(drawn.plot.lines[0][1])
    assert np.interp(x, line[:, 0], line[:, 1]) == pytest.approx(y, abs=0.6)
    denoised = counted * np.where(np.arange(24) % 2, 1.0, 0.3)[:, None]
    spoilt = drawings.noise_plot(patches_of(signal, denoised, signal), "noise")
    assert max(abs(v - 1) for v in spoilt.median) > 0.2
    assert drawings.noise_plot(None, "noise") is None
    assert drawings.noise_plot(patches_of(signal, 0 * signal, signal), "noise") is None


def test_the_scale_of_residuals_fits_the_data() -> None:
    """All dots and most bars, but a few wild patches, or bars far wider than the dots, do not flatten the rest."""
    shot, patches = shot_of(document()), patches_in(document())

    def residuals(unseen: Floats, noise: float) -> patch_view.Residuals:
        changes = {"unseen": unseen, "standard_error": noise * patches.signal}
        return patch_view.residuals_of([replace(shot, patches=replace(patches, **changes))])

    near = 1.004 * patches.signal
    assert residuals(near, 0.001).scale == pytest.approx(0.6)
    one = put(near, 5, 1.4 * patches.signal[5])
    wild = residuals(one, 0.001)
    assert wild.scale < 1
    ((rows,),) = wild.shots
    assert [dot.beyond for dot in rows[5].dots if dot] == [True] * 3
    assert 0.98 < residuals(one, 0.005).scale < 1.3
    assert residuals(one, 0.5).scale < 3


def test_two_results_are_compared() -> None:
    made, shift = document(), 40  # steps of 0.5 nm
    other = changed(document("A"), answer__curves__green=np.roll(document("A").curves[:, 1], shift))
    found, own = compare(made, other), made.std
    off, std = made.curves[:, 1] - other.curves[:, 1], np.sqrt(2) * own[:, 1]
    assert np.array_equal(found.difference[:, 1], off)
    assert found.peak_moved.tolist() == [0, -shift / 2, 0]
    assert found.std[:, 1] == pytest.approx(std)
    assert found.z[:, 1] == pytest.approx(off / std)
    seen = (WAVELENGTHS >= 400) & (WAVELENGTHS <= 700)
    blind = f"{2.2 * np.sqrt(2) * own[seen][:, [0, 2]].max():.2g}"
    assert found.headline == (
        f"The curves differ in green; no difference was found in red and blue; up to {blind} of the peak cannot be "
        "seen."
    )
    (green,) = (words for words in found.channels if words.startswith("Green"))
    assert green.startswith("Green differs: ")
    assert f"{(np.abs(off) / std)[seen].max():.1f} standard deviations" in green
    assert green.endswith("its peak moved by \u221220.0 nm.")
    assert str(made.compare(other)) == " ".join([found.headline, *found.channels])
    for pair in ((made, refused()), (refused(), made)):
        with pytest.raises(InvalidArgument, match="no curves"):
            compare(*pair)
    bandless = compare(made, changed(other, answer__std=None))
    assert "cannot be said" in bandless.headline
    assert bandless.z is None
    assert not [words for words in bandless.channels if "no difference" in words]


def test_wide_bands_hide_a_difference_and_the_page_says_how_large_a_one() -> None:
    """Peaks 10 nm apart within bands of ±0.4: nothing agrees, nothing was found."""
    made = changed(document(), answer__std=Curves.of(np.full((681, 3), 0.3)))
    other = changed(made, answer__curves=Curves.of(np.roll(made.curves, 20, axis=0)))
    found = compare(made, other)
    assert found.headline == "No difference was found in any channel; up to 0.93 of the peak cannot be seen."
    assert all("no difference found, up to 0.93 of the peak cannot be seen" in words for words in found.channels)
    assert not [words for words in (found.headline, *found.channels) if "agree" in words]


@pytest.mark.parametrize(
    ("joint", "words"), [(0.02, "narrow the best single shot's band by 33 %"), (0.04, "do not narrow")]
)
def test_other_shots_that_do_not_narrow_the_band_are_not_said_to(joint: float, words: str) -> None:
    made = changed(document(), answer__uncertainty__half_width=joint, answer__uncertainty__alone=(0.03, 0.05))
    found = certificate.budget_of(made)
    assert f"The other shots {words}" in found.alone


@pytest.mark.parametrize("status", ["accepted", "doubtful"])
def test_a_doubtful_result_is_not_called_good_for_comparing_colours(status: str) -> None:
    """Neither on the page nor in the terminal: its band does not cover what is doubted."""
    reason = Reason("camera_unusual", "a.", "b.", 1.0, 0.5)
    verdict = Verdict(status, (reason,) if status == "doubtful" else (), document().verdict.checks)
    made = changed(document(), verdict=verdict)
    expected = expected_error(made)
    words = expected.in_words()
    for said in (words, Page(html_of(made)).text):
        assert ("Good for comparing colours" in said) == (status == "accepted")
    assert ("ΔE00" in words) == (status == "accepted")
    assert ("It does not cover what the verdict doubts." in html_of(made)) == (status == "doubtful")


@pytest.mark.parametrize("lamps", [("D55", "D55"), ("D55", "A")])
def test_two_results_of_one_camera_agree_in_95_of_100_cases(lamps: tuple[str, str]) -> None:
    """Cameras drawn from the prior, and errors of chart, lamp and noise drawn anew for each photo of the two.

    With the code's prior N(0, I) and posterior covariances C and D the difference of the two codes has the covariance
    C + D - C D - D C: what no photo sees is wrong in both alike.
    """
    basis, rng = read_basis("cameras"), np.random.default_rng(4)
    mean = basis.mean.T
    first, second = (code_covariance(lamp) for lamp in lamps)

    def drawn(covariance: np.ndarray, count: int) -> np.ndarray:
        """Curves' errors (count, 681, 3), peak = 1."""
        codes = rng.multivariate_normal(np.zeros(72), covariance, size=count).reshape(-1, 3, 24)
        off = np.einsum("cmr,ncr->nmc", basis.dictionary, codes) / mean.max(axis=0)
        at_peak = off[:, mean.argmax(axis=0), range(3)]
        return np.asarray(off - at_peak[:, None] * mean / mean.max(axis=0))

    std = np.hypot(drawn(first, 500).std(axis=0), drawn(second, 500).std(axis=0))
    std[std < 1e-9] = np.inf  # at the peaks
    off = drawn(first + second - first @ second - second @ first, 500)
    agree = np.mean([worst_of(each, std)[0].max() <= LIMIT for each in off])
    assert 0.93 <= agree <= 0.99


def code_covariance(lamp: str) -> np.ndarray:
    """Of a photo of the 24 patches, on `cameras`."""
    mean = read_basis("cameras").mean.T
    chart, light = read_chart("classic24").values, read_lamp(lamp).values
    signals = (light * chart) @ mean / (light @ mean)
    noise = np.hypot(0.003 * signals, 6e-4)
    observation = Observation(signals, chart, light, standard_error=noise, chart_tolerance=0.02, lamp_tolerance=0.01)
    return solve_on_basis(observation, "cameras").code_covariance
