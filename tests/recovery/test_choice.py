"""The choice between phones and cameras: probabilities by hand, mixtures by Monte Carlo, and the verdict."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.stats import norm

from camssf.calibration import solve
from camssf.documents.basis_choice import choice_of, odds_in_words
from camssf.documents.document import Answer
from camssf.errors import LampUnfit
from camssf.fit.capture_fit import prior_odds
from camssf.grid import WAVELENGTHS, Floats
from camssf.photo.capture import Capture, MeasuredShot, Photo
from camssf.photo.patches import PatchMeans
from camssf.recovery.basis import read_basis
from camssf.recovery.covariance import DRIFT
from camssf.recovery.hypotheses import CLEAR, FAMILIES, MAKER, LampGuess, UnweighedHypothesis, choose, recover
from camssf.recovery.observation import Observation
from camssf.recovery.sensitivity import FamilyTest, Hypothesis, Ssf, solve_on_basis
from camssf.recovery.unfamiliar_camera import stranger_probability
from camssf.rules import rules
from camssf.spectra import read_chart, read_lamp
from golden.forms import resolve
from golden.scenes import BETWEEN, ODD, PHONE
from tests.support.documents import document
from tests.support.problems import theory
from tests.verdict.test_verdict import BLACK, frame, pose

pytestmark = pytest.mark.requirement("R-CHOICE")

TABLE = read_chart("classic24")
SEEN = (WAVELENGTHS >= 400) & (WAVELENGTHS <= 700)


def observed(
    camera: Floats, *lamps: str, patches: int = 24, noise: float = 0.002, fading: float = 0.0
) -> Observation:
    light = np.stack([read_lamp(name).values for name in lamps])
    chart = TABLE.values[:patches]
    y = np.stack([theory(TABLE.faded(fading).values[:patches], each, camera) for each in light])
    error = np.hypot(noise * y, 0.0005)
    y = y + error * np.random.default_rng(4).normal(size=y.shape)
    return Observation(y, chart, light, standard_error=error, chart_tolerance=0.03)


@cache
def between() -> Observation:
    """Signals that neither basis wins."""
    return observed(resolve(BETWEEN), "D55", patches=12, noise=0.005)


def belief(basis: str, phones: float = 1.0) -> float:
    """Prior odds by hand: RYYB one phone in twenty."""
    return {"phones": phones, "cameras": 1.0, "ryyb": 0.05 * phones}[basis]


def chosen_basis(observation: Observation, answers: Sequence[Ssf], beliefs: Floats) -> Ssf:
    """The mixture of answers to one observation by their evidences and beliefs, ln of the bases' prior odds."""
    guess = LampGuess((), observation, 0.0)
    hypotheses = [
        UnweighedHypothesis(guess, answer.basis, answer.prior_scale, float(belief_))
        for answer, belief_ in zip(answers, beliefs, strict=True)
    ]
    nats = np.array([answer.log_evidence for answer in answers], dtype=float)
    return choose(hypotheses, nats, lambda kept: [answers[i] for i in kept])


def shares(ssf: Ssf) -> dict[str, float]:
    return {name: sum(w.probability for w in ssf.choice if w.basis == name) for name in FAMILIES}


def test_the_probabilities_are_evidence_times_belief() -> None:
    """By hand from the single answers: the odds of phones, which RYYB sensors share, as they are told."""
    given = between()
    found = recover(given, prior={"phones": 5.0})
    evidence = {basis: solve_on_basis(given, basis).log_evidence or 0.0 for basis in FAMILIES}
    most = max(evidence.values())
    raw = {basis: np.exp(value - most) * belief(basis, phones=5.0) for basis, value in evidence.items()}
    for weight in found.choice:
        assert weight.log_evidence == evidence[weight.basis]
        assert weight.probability == pytest.approx(raw[weight.basis] / sum(raw.values()), rel=1e-12)


def test_two_equal_evidences_are_half_and_half() -> None:
    """Mean of the curves; variance by hand: the mean of both plus a quarter of the squared distance."""
    given = between()
    first, second = (replace(solve_on_basis(given, name), log_evidence=0.0) for name in ("phones", "cameras"))
    found = chosen_basis(given, [first, second], np.zeros(2))
    assert [weight.probability for weight in found.choice] == [0.5, 0.5]
    (s1, d1), (s2, d2) = first.peak(), second.peak()
    mean = (s1 + s2) / 2
    top = mean.max(axis=0)
    values, std = found.peak()
    assert values == pytest.approx(mean / top, abs=1e-12)
    assert std == pytest.approx(np.sqrt((d1**2 + d2**2) / 2 + (s1 - s2) ** 2 / 4) / top, abs=1e-12)
    assert np.abs(s1 - s2).max() > 0.02  # they do differ
    # scaled as every answer is, and predicting by its own curves
    white = given.white_reflectance * given.lamp[0] * 0.5
    assert white @ found.values == pytest.approx(np.ones(3), rel=1e-12)
    assert found.predicted[0] == pytest.approx(theory(TABLE.values[:12], given.lamp[0], mean), rel=1e-12)
    assert (found.proof.gap == np.maximum(first.proof.gap, second.proof.gap)).all()


def test_a_stranger_is_the_more_probable_the_longer_its_code() -> None:
    """Also by the lamp residual; by hand at one length, from the rules' two normal densities."""

    def probability(z: float, residual: float | None = None) -> float:
        return stranger_probability(FamilyTest(z, residual, longest=0.6, largest=0.4))

    number = rules().number
    prior, mean, own, other = (
        number(f"choice.{name}") for name in ("stranger", "familiar", "familiar_std", "stranger_std")
    )
    for z in (-3.0, -0.5, 1.0):
        stranger, member = prior * norm.pdf(z, 0.0, other), (1.0 - prior) * norm.pdf(z, mean, own)
        assert probability(z) == pytest.approx(stranger / (stranger + member), rel=1e-12)
    assert probability(-2.0, 0.3) == probability(-2.0)
    assert probability(-2.0, 0.5) == 1.0


DRAWN = 150
"""Captures of the Monte Carlo."""


@cache
def drawn() -> list[tuple[str, Floats, Ssf]]:
    """Family, true curves at peak 1 and answer, of captures drawn from the model itself: a family by a coin, a code
    from its prior, what the rows are told may be off (noise, light that drifts), six patches; some stay open."""
    rng = np.random.default_rng(20)
    chart, lamp = TABLE.values[[14, 13, 12, 18, 15, 17]], read_lamp("D55").values
    found = []
    for _ in range(DRAWN):
        family = FAMILIES[int(rng.integers(2))]
        basis = read_basis(family)
        code = rng.normal(size=(3, basis.dictionary.shape[2]))
        camera = (basis.mean + np.einsum("cmr,cr->cm", basis.dictionary, code)).T
        y = theory(chart, lamp, camera)
        error = np.hypot(0.005 * y, 0.001)
        y = y * (1 + DRIFT * rng.normal()) + error * rng.normal(size=y.shape)
        given = Observation(y, chart, lamp, standard_error=error, chart_tolerance=0.0, white_tolerance=0.0)
        # Not `recover`: a camera drawn from the prior is as likely as not unlike the measured ones, which are nearer.
        answers = [solve_on_basis(given, name) for name in FAMILIES]
        beliefs = np.log([belief(name) for name in FAMILIES])
        found.append((family, camera / camera.max(axis=0), chosen_basis(given, answers, beliefs)))
    return found


@pytest.mark.full
def test_probabilities_are_as_often_right_as_they_say() -> None:
    """Of captures drawn half and half: what is said of phones, on average, is their share where it is said."""
    said = np.array([shares(found)["phones"] for _, _, found in drawn()])
    true = np.array([family == "phones" for family, _, _ in drawn()])
    for low, high in ((0.0, 0.2), (0.2, 0.5), (0.5, 0.8), (0.8, 1.0)):
        here = (said >= low) & (said <= high)
        chance = np.sqrt(np.sum(said[here] * (1 - said[here]))) / here.sum()
        assert abs(said[here].mean() - true[here].mean()) < 3 * chance + 0.02, (low, here.sum())


def test_a_maker_is_a_weak_belief() -> None:
    """Beginnings of names, any case. Who makes both is told by the model."""
    assert prior_odds("Apple", "") == prior_odds("apple inc.", "") == {"phones": MAKER}
    assert prior_odds("NIKON CORPORATION", "") == {"cameras": MAKER}
    assert prior_odds("samsung", "SM-G991B") == prior_odds("Sony", "XQ-DQ72") == {"phones": MAKER}
    assert prior_odds("SAMSUNG", "NX500") == prior_odds("SONY", "ILCE-7M3") == {"cameras": MAKER}
    for silent in ("", "samsung", "Sony", "A maker of whom nobody knows", "x apple"):
        assert prior_odds(silent, "") == {}


def capture(camera: Floats, true: Sequence[str], named: Sequence[str] | None = None, make: str = "") -> Capture:
    """A photon counter's photos with white and dark frame, measured exactly."""
    photo = Photo("x.dng", 600, 400, 1, None, None, False, make, "x", "0" * 64)
    shots = []
    for number, (light, name) in enumerate(zip(true, named or true, strict=True)):
        clean = frame(theory(TABLE.values, read_lamp(light).values, camera))
        noise = clean.standard_error * np.random.default_rng([1, number]).normal(size=(24, 3))
        means = PatchMeans(
            replace(clean, mean=clean.mean + noise), frame(np.ones((24, 3))), frame(np.zeros((24, 3))),
            np.full(3, BLACK), 16383.0,
        )  # fmt: skip
        chart, white, dark = (replace(photo, sha256=f"{number:x}".rjust(64, digit)) for digit in "0ab")
        shots.append(MeasuredShot(read_lamp(name), chart, white, dark, pose(), means, None))
    return Capture(tuple(shots), TABLE, None)


@pytest.mark.full
@pytest.mark.requirement("R-UNUSUAL")
def test_a_phone_s_curves_in_a_camera_s_file_are_unusual() -> None:
    """Three lamps tell so clearly that the maker's name does not carry."""
    other = solve(capture(resolve(PHONE), ["A", "LED-B3", "FL2"], make="NIKON CORPORATION"))
    assert other.ssf.basis == "phones"
    assert other.verdict.status == "doubtful"
    (reason,) = other.verdict.reasons
    assert reason.code == "camera_unusual"
    assert reason.value == pytest.approx(shares(other.ssf)["phones"] + shares(other.ssf)["ryyb"])


@pytest.mark.full
@pytest.mark.requirement("R-WRONG-LAMP")
def test_lamps_of_a_phone() -> None:
    """Right ones stand, wrong ones are doubted, and a better one is named."""
    phone = resolve(PHONE)
    assert solve(capture(phone, ["FL2"], make="Apple")).verdict.status == "accepted"
    doubted = solve(capture(phone, ["LED-B3"], ["D55"], make="Apple")).verdict
    assert doubted.status == "doubtful"
    assert doubted.reasons[0].key == "lamp_unfit.rival"
    assert "the light is another than D55" in doubted.reasons[0].message
    with pytest.raises(LampUnfit, match="another than FL2"):
        solve(capture(phone, ["A"], ["FL2"], make="Apple"))


def weighed(*weights: tuple[str, float, float], scale: float = 1.0) -> Answer:
    return replace(document().answer, prior_scale=scale, choice=tuple(Hypothesis(*weight) for weight in weights))


def test_odds_in_words() -> None:
    """Odds below the clear ones do not read as clear."""
    said = {1.25: "1.2", 3.0: "3.0", 9.96: "10.0", 19.4: "19", 19.97: "19.9", 20.0: "20", 240.4: "240",
            12345.6: "12,346", 1e7: "more than a million", np.inf: "more than a million"}  # fmt: skip
    assert [odds_in_words(odds) for odds in said] == [f"{words} : 1" for words in said.values()]


def test_the_choice_in_words() -> None:
    """Odds, what the maker had in them, and the wide prior: from the document alone."""
    p = 1.0 / (1.0 + 30.0)
    found = choice_of(weighed(("phones", 100.0, 30 * p), ("cameras", 100.0 - np.log(1.5), p)))
    assert (found.basis, found.odds, found.prior_odds) == ("phones", pytest.approx(30.0), pytest.approx(20.0))
    assert found.words == (
        "Sensor family: phones (30 : 1 against cameras). This basis is used alone.",
        "These odds include the maker's name in the file: 20 : 1 for phones.",
    )
    half = choice_of(weighed(("phones", 5.0, 0.5), ("cameras", 5.0, 0.5), scale=4.0))
    assert "averaged with their probabilities" in half.words[0]
    assert half.words[-1].startswith(
        "The camera is unlike those that this basis was learned from, so most of the answer is that of a prior 4 "
    )
    assert choice_of(None) is choice_of(weighed()) is choice_of(weighed(("phones", 0.0, 0.0))) is None
    foreign = choice_of(weighed(("mine", 9.0, 0.9), ("cameras", 9.0 - np.log(180.0), 0.1)))
    assert foreign.prior_odds is None  # a basis that no maker's name speaks for


@pytest.mark.parametrize(
    ("table", "words"),
    [("BabelColor Average", "not measured on this chart"), ("mine.csv", "taken for this chart's own")],
)
def test_a_chart_of_the_user_s_own_is_not_called_unmeasured(table: str, words: str) -> None:
    given = capture(resolve(PHONE), ("D55",))
    chart = replace(given.chart, table=table, source=f"file {table}")
    (said,) = (
        assumption.message
        for assumption in solve(replace(given, chart=chart)).assumptions
        if assumption.code == "chart_table"
    )
    assert words in said


@pytest.mark.full
def test_bands_of_mixtures_hold() -> None:
    """Where both answers count, 95 % bands hold the truth in 93 to 98 % of all wavelengths, and their error has the
    size that they say; without the distance between the answers in them they would not."""
    mixed = [(truth, found) for _, truth, found in drawn() if max(shares(found).values()) < CLEAR / (1 + CLEAR)]
    assert len(mixed) > DRAWN / 12
    inside, ratio = [], []
    for truth, found in mixed:
        curves, std = found.peak()
        off = np.abs(curves - truth)[SEEN]
        inside.append((off <= 1.96 * std[SEEN]).mean())
        ratio.append(np.sum(off**2) / np.sum(std[SEEN] ** 2))
    assert 0.93 <= np.mean(inside) <= 0.98
    assert np.sqrt(np.mean(ratio)) == pytest.approx(1.0, abs=0.12)


def test_a_faded_chart_is_found_and_allowed_for() -> None:
    """A phone's photo of a chart that lost a fifth of its colours: the answer is that of the faded table."""
    phone = resolve(PHONE)
    clean = observed(phone, "D55", "A")
    given = replace(clean, signals=observed(phone, "D55", "A", fading=0.2).signals)
    found = recover(given)
    assert found.chart_fading == pytest.approx(0.2, abs=0.05)
    assert found.prior_scale == 1.0
    truth = phone / phone.max(axis=0)
    off, unaware = (np.abs(ssf.peak()[0] - truth).mean() for ssf in (found, recover(given, basis="phones")))
    assert off < 0.6 * unaware
    assert recover(clean).chart_fading == 0.0
    odd = recover(observed(resolve(ODD), "D55", "A"))
    assert odd.chart_fading == 0.0  # another camera is not taken for a faded chart
