"""The sections of a page: the certificate, bands, light, noise, and two results compared."""

import html
import json
import re

import numpy as np
import pytest
from scipy.stats import truncnorm

from camssf.documents.document import Curves
from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS
from camssf.recovery.basis import read_basis
from camssf.recovery.observation import Observation
from camssf.recovery.sensitivity import solve_on_basis
from camssf.report.build import report
from camssf.report.comparison import LIMIT, compare, worst_of
from camssf.report.sections import certificate
from camssf.report.sections.bands import possible
from camssf.report.sections.curves import curves_of
from camssf.rules import rules
from camssf.verdict.reasons import Reason, Verdict
from camssf_colour.colour_error import expected_error
from tests.report.conftest import Page, html_of, number, points, put
from tests.support.documents import changed, document, known, refused, unnamed
from tests.support.problems import chart_and_lamp, theory


def test_every_check_has_its_sentence() -> None:
    """Both ways: no check of the rules without one, and none for a number that is no check."""
    limits = {name.partition("verdict.")[2]: rule for name, rule in rules().numbers.items()}
    checked = {name for name, rule in limits.items() if name and rule.makes}
    made = {check.name for check in (*document("D55", "A").verdict.checks, *unnamed().verdict.checks)}
    assert checked | made == set(certificate.CHECK_SENTENCES)
    assert all(each.endswith(".") for pair in certificate.CHECK_SENTENCES.values() for each in pair)


def test_every_check_of_the_verdict_is_listed_with_value_limit_and_margin() -> None:
    made = document("D55", "A")
    checks, page = made.verdict.checks, html_of(made)
    assert sum(len(check.by_shot) for check in certificate.checks_of(made.verdict)) == len(checks)
    rows = re.findall(r'<tr class="(held|doubtful|refused)"><th scope="row">(.*?)</th>(.*?)</tr>', page, re.DOTALL)
    assert len(rows) == len({check.name for check in checks})
    shown = {}
    for state, what, cells in rows:
        numbers = [re.findall(r'<span class="one \w+">(.*?)</span>', cell) for cell in cells.split("</td>")[:3]]
        shown[html.unescape(re.sub("<[^>]*>", "", what))] = state, numbers
    for name in {check.name for check in checks}:
        own = [check for check in checks if check.name == name]
        (row,) = [row for what, row in shown.items() if rules().numbers[f"verdict.{name}"].what in what]
        state, (values, limits, margins) = row
        broken = [c.value > c.limit if c.beyond == "above" else c.value < c.limit for c in own]
        assert state == ("doubtful" if any(broken) else "held")
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


def test_a_signature_that_was_not_verified_is_said_so() -> None:
    """What the certificate says of a signed result and of an unsigned one stands in pages.txt."""
    page = Page(html_of(document(), provenance=known(document(), verified=False))).text
    assert ("the signature was not verified" in page, "Unsigned" in page) == (True, False)
    assert "Signature" not in Page(html_of(refused())).text


def test_a_band_holds_95_percent_of_what_can_be() -> None:
    """Against scipy's truncated normal: the share between the ends, and that no shorter interval has it."""
    sigma, parts = 0.7, np.linspace(0, 0.05, 2001)[:-1]
    for mean in (-3.0, -0.5, 0.0, 0.3, 1.0, 1.9, 2.1, 4.0, 40.0):
        low, high = (float(end) for end in possible(np.array(mean * sigma), np.array(sigma)))
        above_zero = truncnorm(-mean, np.inf, loc=mean * sigma, scale=sigma)
        assert above_zero.cdf(high) - above_zero.cdf(low) == pytest.approx(0.95, abs=1e-9), mean
        shortest = (above_zero.ppf(parts + 0.95) - above_zero.ppf(parts)).min()
        assert high - low <= shortest * (1 + 1e-4), mean
        assert 0 <= low <= max(mean, 0) * sigma <= high, mean
        assert high <= mean * sigma + 1.96 * sigma or mean < 0, mean
    low, high = possible(np.array([-100.0, 1.0, 1.0]), np.array([1.0, 0.0, 1e-300]))
    assert low.tolist() == [0, 1, 1]
    assert high == pytest.approx([-np.log(0.05) / 100, 1, 1], rel=1e-3)  # so far below zero it is an exponential


def test_a_line_is_drawn_within_its_band() -> None:
    """A posterior's mean may lie below zero; without a band the curve is drawn as it is."""
    red = put(document().curves[:, 0], slice(100), -0.01)
    made = changed(document(), answer__curves__red=red, answer__std__red=np.full(681, 0.02))
    drawn = curves_of(made)
    assert ((drawn.low <= drawn.ssf) & (drawn.ssf <= drawn.high)).all()
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


def test_an_unnamed_light_is_drawn_with_its_kinds_and_their_probabilities() -> None:
    bars = [bar["style"] for bar in Page(html_of(unnamed())).of_class("bar")]
    assert bars == ["--share:0.9300", "--share:0.0400", "--share:0.0300", "--share:0.0000"]


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
    words = "The curves differ in green; no difference was found in red and blue;"
    assert found.headline == f"{words} up to {blind} of the peak cannot be seen."
    (green,) = (words for words in found.channels if words.startswith("Green"))
    assert green.startswith("Green differs: ")
    assert f"{(np.abs(off) / std)[seen].max():.1f} standard deviations" in green
    assert green.endswith("its peak moved by \u221220.0 nm.")
    assert str(made.compare(other)) == " ".join([found.headline, *found.channels])
    for pair in ((made, refused()), (refused(), made)):
        with pytest.raises(InvalidArgument, match="no curves"):
            compare(*pair)
    bandless = compare(made, changed(other, answer__std=None))
    assert ("cannot be said" in bandless.headline, bandless.z) == (True, None)
    assert not [words for words in bandless.channels if "no difference" in words]
    wide = changed(made, answer__std=Curves.of(np.full((681, 3), 0.3)))  # peaks 10 nm apart within bands of ±0.4
    hidden = compare(wide, changed(wide, answer__curves=Curves.of(np.roll(made.curves, 20, axis=0))))
    assert hidden.headline == "No difference was found in any channel; up to 0.93 of the peak cannot be seen."
    assert all("no difference found, up to 0.93 of the peak cannot be seen" in words for words in hidden.channels)
    assert not [words for words in (hidden.headline, *hidden.channels) if "agree" in words]


@pytest.mark.parametrize(("joint", "words"), [(0.02, "narrow the best single shot's band by 33 %"), (0.04, "do not")])
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
    chart, light = chart_and_lamp(lamp, slice(24))
    y = theory(chart, light, read_basis("cameras").mean.T)
    error = np.hypot(0.003 * y, 6e-4)
    given = Observation(y, chart, light, standard_error=error, chart_tolerance=0.02, lamp_tolerance=0.01)
    return solve_on_basis(given, "cameras").code_covariance
