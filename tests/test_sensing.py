"""Rows and covariance against the integrals they stand for and against draws of the errors they describe."""

from __future__ import annotations

import numpy as np
import pytest

from camssf.curves.basis import NODES, interpolate, read_basis
from camssf.curves.covariance import CHART_CORRELATION, smooth_errors
from camssf.curves.evidence import Evidence
from camssf.curves.sensing import Sensing, anchor, sense
from camssf.grid import STEP, WAVELENGTHS, Floats
from camssf.spectra import read_lamp
from camssf.spectra.families import FAMILIES, Kind, principal_modes
from tests.problems import chart_and_lamp, recovered, theory, toy_camera


def rows(y: Floats, reflectance: Floats, lamp: Floats, **changes: object) -> Sensing:
    k, n, _ = y.shape
    arguments: dict[str, object] = {
        "chart_tolerance": np.zeros(n),
        "white_reflectance": np.ones(681),
        "white_tolerance": 0.0,
        "lamp_tolerance": np.zeros(k),
        "lamp_modes": np.zeros((k, 0, 681)),
    } | changes
    basis = arguments.pop("basis", "cameras")
    error = arguments.pop("standard_error", np.full(y.shape, 1e-3))
    evidence = Evidence(y, reflectance, lamp, standard_error=error, **arguments)  # type: ignore[arg-type]
    return sense(evidence, read_basis(str(basis)))


def test_rows_vanish_at_the_truth_whatever_its_scale() -> None:
    """(R - y ρ) L s = 0: a curve μ + Ψ x that made the signals satisfies its rows."""
    basis = read_basis("cameras")
    code = np.random.default_rng(0).normal(size=(3, basis.dictionary.shape[2]))
    reflectance, day = chart_and_lamp("D55", slice(0, 24))
    basis = anchor(basis, day)
    camera = (basis.mean + np.einsum("cmr,cr->cm", basis.dictionary, code)).T
    _, bulb = chart_and_lamp("A")
    lamps = np.stack([day, 50 * bulb])
    y = np.stack([theory(reflectance, lamp, 3.0 * camera) for lamp in lamps])
    found = rows(y, reflectance, lamps)
    assert np.einsum("cnr,cr->cn", found.matrix, code) == pytest.approx(found.target, abs=1e-12)


def test_paper_rows_are_equation_8() -> None:
    reflectance, lamp = chart_and_lamp("D55")
    atoms = read_basis("gaussian").dictionary[0]
    y = theory(reflectance, lamp, toy_camera())[None]
    found = rows(y, reflectance, lamp[None], basis="gaussian", standard_error=np.ones(y.shape))
    by_hand = [[np.sum(R * lamp * atom) / np.sum(lamp) for atom in atoms.T] for R in reflectance]
    assert found.matrix[0] == pytest.approx(np.array(by_hand))
    assert found.target == pytest.approx(y[0].T)
    assert found.covariance == pytest.approx(np.broadcast_to(np.eye(12), (3, 12, 12)))


def test_smooth_errors_have_the_stated_correlation() -> None:
    factors = smooth_errors(CHART_CORRELATION)
    stated = np.exp(-0.5 * ((NODES[:, None] - NODES) / CHART_CORRELATION) ** 2)
    assert factors @ factors.T == pytest.approx(stated, abs=3e-3)


@pytest.mark.parametrize("term", ["chart", "white", "lamp", "modes"])
def test_covariance_is_that_of_drawn_errors(term: str) -> None:
    """First order: simulate the camera μ with a wrong chart, white or lamp, and look at the rows' residuals."""
    basis = read_basis("cameras")
    reflectance, day = chart_and_lamp("D55", slice(0, 24))
    reflectance = reflectance[::3]
    _, bulb = chart_and_lamp("A")
    lamps, n, size = np.stack([day, bulb]), 8, 1e-3
    camera = basis.mean.T
    mode = np.stack([np.sin(WAVELENGTHS / 60.0), np.cos(WAVELENGTHS / 90.0)])[:, None]
    arguments: dict[str, object] = {
        "chart": {"chart_tolerance": np.full(n, size)},
        "white": {"white_tolerance": size},
        "lamp": {"lamp_tolerance": np.full(2, size)},
        "modes": {"lamp_modes": size * mode},
    }[term]
    rng = np.random.default_rng(5)
    wide, narrow, short = (interpolate(smooth_errors(length)) for length in (100.0, 60.0, 25.0))
    slope = np.gradient(reflectance, STEP, axis=1)
    clean = np.stack([theory(reflectance, lamp, camera) for lamp in lamps])
    draws = []
    for _ in range(3000):
        chart, white, light = reflectance, np.ones(681), lamps
        if term == "chart":
            u = [(curves @ rng.normal(size=(curves.shape[1], n))).T for curves in (wide, short, short)]
            chart = reflectance + size * (0.6 * reflectance * u[0] + u[1] / 3 + 70.0 * slope * u[2])
        elif term == "white":
            white = 1 + size * wide @ rng.normal(size=wide.shape[1])
        elif term == "lamp":
            light = lamps * (1 + size * (narrow @ rng.normal(size=(narrow.shape[1], 2))).T)
        else:
            light = lamps * (1 + size * rng.normal(size=(2, 1)) * mode[:, 0])
        y = np.stack([theory(chart, lamp, camera, white) for lamp in light])
        # With the declared chart, white and lamp the row of the true curve is off by ŷ - y.
        draws.append((clean - y).reshape(2 * n, 3))
    drawn = np.einsum("dnc,dmc->cnm", draws, draws) / len(draws)
    floor = rows(clean, reflectance, lamps).covariance
    declared = rows(clean, reflectance, lamps, **arguments).covariance - floor
    if term == "chart":  # its independent part is a twentieth of the size
        extra = (0.05 * size * clean.reshape(2 * n, 3).T) ** 2
        declared -= np.maximum(extra, 1e-6)[:, :, None] * np.eye(2 * n) - 1e-6 * np.eye(2 * n)
    scale = np.abs(declared).max()
    assert drawn / scale == pytest.approx(declared / scale, abs=0.09)


def test_a_scale_of_the_lamp_is_no_evidence_lost() -> None:
    """A lamp mode that is a mere factor changes no signal, so it adds no covariance."""
    reflectance, lamp = chart_and_lamp("D55")
    basis = read_basis("cameras")
    y = theory(reflectance, lamp, basis.mean.T)[None]
    plain = rows(y, reflectance, lamp[None]).covariance
    flat = rows(y, reflectance, lamp[None], lamp_modes=np.full((1, 1, 681), 0.5)).covariance
    assert flat == pytest.approx(plain, abs=1e-15)


def test_an_anchored_atom_leaves_white_alone() -> None:
    """And moves a curve as its scaling to the same white does, to first order."""
    basis = read_basis("cameras")
    _, lamp = chart_and_lamp("LED-B3")
    found = anchor(basis, lamp)
    code = 1e-5 * np.random.default_rng(1).normal(size=(3, basis.dictionary.shape[2]))
    for c in range(3):
        assert lamp @ found.dictionary[c] == pytest.approx(np.zeros(24), abs=1e-11 * (lamp @ basis.mean[c]))
        curve = basis.mean[c] + basis.dictionary[c] @ code[c]
        scaled = curve * (lamp @ basis.mean[c]) / (lamp @ curve)
        moved = found.mean[c] + found.dictionary[c] @ code[c]
        assert moved == pytest.approx(scaled, abs=1e-9)
    again = anchor(found, lamp)
    assert again.dictionary == pytest.approx(found.dictionary, abs=1e-14)
    paper = read_basis("gaussian")
    assert anchor(paper, lamp) is paper


def test_noise_under_an_uncertain_white_is_no_evidence() -> None:
    """Many noisy rows of one grey patch know nothing but the scale: they must not move the curve."""
    _, lamp = chart_and_lamp("LED-B3")
    grey = np.full((200, 681), 0.5)
    y = 0.5 + 0.01 * np.random.default_rng(2).normal(size=(1, 200, 3))
    found = rows(y, grey, lamp[None], standard_error=np.full(y.shape, 0.01))
    assert np.abs(found.matrix).max() < 1e-12


def test_lamp_and_white_scales_leave_rows_alone() -> None:
    reflectance, lamp = chart_and_lamp("A")
    y = theory(reflectance, lamp, toy_camera())[None]
    one, other = rows(y, reflectance, lamp[None]), rows(y, reflectance, 1e4 * STEP * lamp[None])
    assert other.matrix == pytest.approx(one.matrix)
    assert other.target == pytest.approx(one.target)


def test_a_lamp_with_modes_is_one_unknown_of_three_channels() -> None:
    """Small modes: each channel's posterior is that of a joint problem in three codes and u, solved by itself."""
    basis = read_basis("cameras")
    reflectance, day = chart_and_lamp("D55", slice(0, 24))
    _, bulb = chart_and_lamp("A")
    lamps, size = np.stack([day, bulb]), 0.01
    modes = size * np.stack(
        [[np.sin(WAVELENGTHS / 60), 0 * WAVELENGTHS], [WAVELENGTHS / 550 - 1, np.cos(NODES[0] + WAVELENGTHS / 40)]]
    )
    rng = np.random.default_rng(8)
    code, u = 0.02 * rng.normal(size=(3, 24)), np.array([[1.0, 0.0], [-1.5, 0.7]])
    book = anchor(basis, day)
    camera = (book.mean + np.einsum("cmr,cr->cm", book.dictionary, code)).T

    def see(codes: Floats, off: Floats) -> Floats:
        s = (book.mean + np.einsum("cmr,cr->cm", book.dictionary, codes)).T
        return np.stack([theory(reflectance, L, s) for L in lamps * (1 + np.einsum("kq,kqm->km", off, modes))])

    y, error = see(code, u), np.full((2, 24, 3), 2e-4)
    assert y[0] == pytest.approx(theory(reflectance, lamps[0] * (1 + modes[0, 0]), camera))
    found = rows(y, reflectance, lamps, lamp_modes=modes, standard_error=error)
    plain = rows(y, reflectance, lamps, standard_error=error)
    precision, pull = np.eye(3 * 24 + 4), np.zeros(3 * 24 + 4)
    for c in range(3):
        steps = [(see(0 * code, e) - see(0 * code, -e))[..., c].ravel() / 2 for e in np.eye(4).reshape(4, 2, 2)]
        design = np.zeros((48, 76))
        design[:, 24 * c : 24 * (c + 1)], design[:, 72:] = plain.matrix[c], np.stack(steps, axis=1)
        weighted = np.linalg.solve(plain.covariance[c], design)
        precision += design.T @ weighted
        pull += weighted.T @ plain.target[c]
    joint, spread = np.linalg.solve(precision, pull), np.linalg.inv(precision)
    for c in range(3):
        part = slice(24 * c, 24 * (c + 1))
        weighted = np.linalg.solve(found.covariance[c], found.matrix[c])
        own = np.linalg.inv(weighted.T @ found.matrix[c] + np.eye(24))
        assert own @ weighted.T @ found.target[c] == pytest.approx(joint[part], abs=0.03)
        assert np.sqrt(np.diag(own)) == pytest.approx(np.sqrt(np.diag(spread)[part]), rel=0.03)
    bent = found.lamp / lamps - 1
    assert bent[0] == pytest.approx(joint[72] * modes[0, 0], abs=0.1 * size)
    assert bent[1] == pytest.approx(joint[74:] @ modes[1], abs=0.1 * size)


def test_a_lamp_without_modes_stays_as_given() -> None:
    reflectance, lamp = chart_and_lamp("FL2")
    y = theory(reflectance, lamp, toy_camera())[None]
    found = rows(y, reflectance, 3.0 * lamp[None], lamp_tolerance=np.array([0.02]))
    assert np.array_equal(found.lamp, 3.0 * lamp[None])
    assert not found.terms["lamp modes"].any()


def test_a_lamp_left_out_of_its_family_is_found_out() -> None:
    """Beside a known daylight, an LED told by the others is bent towards what it is."""
    family = FAMILIES["white-led"]
    assert isinstance(family, Kind)
    reflectance, day = chart_and_lamp("D55", slice(0, 24))
    seen = (WAVELENGTHS >= 420) & (WAVELENGTHS <= 680)
    shares = {}
    for name in family.members:
        others = [read_lamp(member).values for member in family.members if member != name]
        mean, directions = principal_modes(others, family.components)
        true = read_lamp(name).values
        modes = np.stack([0 * directions, directions])
        y = np.stack([theory(reflectance, lamp, toy_camera()) for lamp in (day, true)])
        found = rows(
            y, reflectance, np.stack([day, mean]), lamp_modes=modes, lamp_tolerance=np.array([0.0, family.left])
        )  # fmt: skip
        off = []
        for lamp in (mean, found.lamp[1]):
            scale = np.sum(lamp[seen] * true[seen]) / np.sum(lamp[seen] ** 2)
            off.append(np.sum((true - scale * lamp)[seen] ** 2))
        shares[name] = off[1] / off[0]
    assert all(share < 1.0 for share in shares.values()), shares  # LED-BH1's red peak is in no other
    assert np.median(list(shares.values())) < 0.5, shares


@pytest.mark.slow
def test_lamps_far_off_leave_the_bands_honest() -> None:
    """Cameras of the prior, LEDs drawn from their family's own modes: 95 % bands hold, and the LED helps a little."""
    basis, led = read_basis("cameras"), read_lamp("white-led")
    reflectance, day = chart_and_lamp("D55", slice(0, 24))
    modes = np.stack([0 * led.modes, led.modes])
    rng = np.random.default_rng(11)
    held, wrong = [], []
    while len(held) < 60:
        camera = (basis.mean + np.einsum("cmr,cr->cm", basis.dictionary, rng.normal(size=(3, 24)))).T
        light = led.values * (1 + rng.normal(size=len(led.modes)) @ led.modes)
        if camera.min() < -0.15 * camera.max() or light.min() < 0:
            continue  # no camera, no lamp
        y = np.stack([theory(reflectance, lamp, camera) for lamp in (day, light)])
        error = np.hypot(0.005 * y, 0.001)
        y = y + error * rng.normal(size=y.shape)
        truth = camera / camera.max(axis=0)
        errors = []
        for k in (1, 2):
            answer = recovered(
                y[:k], reflectance, np.stack([day, led.values])[:k], standard_error=error[:k], chart_tolerance=0.0,
                white_tolerance=0.0, lamp_modes=modes[:k], basis=basis, engine="reference",
            )  # fmt: skip
            got, std = answer.peak()
            assert std is not None
            errors.append(np.sqrt(np.mean((got - truth)[40:641] ** 2)))
        held.append(np.mean(np.abs(got - truth)[40:641] <= 1.96 * std[40:641]))
        wrong.append(errors)
    assert 0.92 <= np.mean(held) <= 0.98
    alone, pair = np.mean(wrong, axis=0)
    assert pair < alone
