"""Rows and covariance against the integrals they stand for and against draws of the errors they describe."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery.basis import NODES, interpolate, read_basis
from camssf.recovery.covariance import CHART_CORRELATION, smooth_errors
from camssf.recovery.evidence import STACKS, log_evidences
from camssf.recovery.observation import Observation
from camssf.recovery.rows import anchor
from camssf.spectra import read_lamp
from camssf.spectra.families import principal_modes
from golden.linear_model import LinearModel, linear_model, solve
from tests.support.problems import chart_and_lamp, near, recovered, theory, toy_camera


def rows(y: Floats, reflectance: Floats, lamp: Floats, **changes: object) -> LinearModel:
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
    observation = Observation(y, reflectance, lamp, standard_error=error, **arguments)  # type: ignore[arg-type]
    return linear_model(observation, read_basis(str(basis)))


def test_hypotheses_weighed_together_are_those_weighed_alone() -> None:
    """More lamps than one stack holds, some with modes, in an order that mixes them; two shots."""
    reflectance, day = chart_and_lamp("D55", slice(0, 24))
    y = np.stack([theory(reflectance, lamp, read_basis("phones").mean.T) for lamp in (day, day)])
    modes = np.zeros((2, 2, 681))
    modes[1] = 0.1 * np.stack([WAVELENGTHS / 550 - 1, (WAVELENGTHS / 550 - 1) ** 2])
    observations = [
        Observation(
            y, reflectance, np.stack([day, read_lamp(f"D:{4000 + 500 * i}").values]),
            standard_error=np.full(y.shape, 1e-3), lamp_modes=modes * (i % 3 == 1),
        )
        for i in range(2 * STACKS[2])
    ]  # fmt: skip
    alone = [log_evidences([observation], read_basis("cameras"))[0] for observation in observations]
    assert len(set(alone)) == len(alone)
    assert near(log_evidences(observations, read_basis("cameras")), np.array(alone), rel=1e-12)


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
    assert found.matrix.shape == (1, 3 * 2 * 24, 3 * 24)
    assert found.matrix[0] @ code.ravel() == pytest.approx(found.target[0], abs=1e-12)


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


Slopes = tuple[Floats, Floats, Floats]


class Bent(NamedTuple):
    """Signals of anchored codes x (72) under lamps L (1 + Σ u m), and their derivatives by finite differences."""

    reflectance: Floats
    lamps: Floats
    modes: Floats

    def see(self, x: Floats, u: Floats) -> Floats:
        """Rows: channel, shot, patch. Curve times bend is straight between the nodes, as all that is unknown."""
        book = anchor(read_basis("cameras"), self.lamps[0])
        s = book.mean[:, ::10] + np.einsum("cvr,cr->cv", book.dictionary[:, ::10], x.reshape(3, -1))
        bend = 1 + np.einsum("kq,kqv->kv", u.reshape(self.modes.shape[:2]), self.modes[:, :, ::10])
        y = [theory(self.reflectance, L, interpolate((s * b).T)) for L, b in zip(self.lamps, bend, strict=True)]
        return np.moveaxis(np.stack(y), -1, 0).ravel()

    def slopes(self, x: Floats, u: Floats, h: float = 1e-3) -> Slopes:
        """A = ∂y/∂x (N, 72), D = ∂y/∂u (N, k q) and B = ∂²y/∂u∂x (N, k q, 72)."""
        N, r, q = len(self.see(x, u)), len(x) // 3, len(u)
        A, D, B = np.zeros((N, 3 * r)), np.zeros((N, q)), np.zeros((N, q, 3 * r))
        for i in range(r):
            e = np.tile(h * np.eye(r)[i], 3)  # the three channels at once: a row sees its own alone
            step = (self.see(x + e, u) - self.see(x - e, u)) / (2 * h)
            for c in range(3):
                own = slice(N // 3 * c, N // 3 * (c + 1))
                A[own, r * c + i] = step[own]
            for j in range(q):
                f = h * np.eye(q)[j]
                mixed = [self.see(x + s * e, u + t * f) * s * t for s in (1, -1) for t in (1, -1)]
                for c in range(3):
                    own = slice(N // 3 * c, N // 3 * (c + 1))
                    B[own, j, r * c + i] = sum(mixed)[own] / (4 * h * h)
        for j in range(q):
            f = h * np.eye(q)[j]
            D[:, j] = (self.see(x, u + f) - self.see(x, u - f)) / (2 * h)
        return A, D, B


def posterior(A: Floats, D: Floats, target: Floats, sigma: Floats) -> tuple[Floats, Floats, Floats]:
    """Of (x, u) ~ N(0, I) and target = A x + D u + error: x, u and their joint covariance, in one linear system."""
    design = np.column_stack([A, D])
    weighted = np.linalg.solve(sigma, design)
    spread = np.linalg.inv(design.T @ weighted + np.eye(design.shape[1]))
    both = spread @ (weighted.T @ target)
    return both[: A.shape[1]], both[A.shape[1] :], spread


@pytest.mark.parametrize("size", [0.01, 0.3])
def test_a_lamp_with_modes_is_one_unknown_of_three_channels(size: float) -> None:
    """`linear_model` and `solve` with γ = 0 against the posterior of the three codes and of u together.

    Nothing is taken from the rows: signals, slopes and curvature come from the integrals by finite differences, first
    at the means, then at what that finds. The product has no u among its unknowns, but D Dᵀ in Σ.
    """
    reflectance, day = chart_and_lamp("D55", slice(0, 24))
    _, bulb = chart_and_lamp("A")
    lamps = np.stack([day, bulb])
    modes = size * np.stack(
        [[np.sin(WAVELENGTHS / 60), 0 * WAVELENGTHS], [WAVELENGTHS / 550 - 1, np.cos(WAVELENGTHS / 40)]]
    )
    bent = Bent(reflectance, lamps, modes)
    rng = np.random.default_rng(8)
    code, u = rng.normal(size=72), rng.normal(size=4)
    error = 2e-3
    y = bent.see(code, u) + error * rng.normal(size=144)
    signals = np.moveaxis(y.reshape(3, 2, 24), 0, -1)
    found = rows(signals, reflectance, lamps, lamp_modes=modes, standard_error=np.full((2, 24, 3), error))

    def curvature(B: Floats, mode_covariance: Floats, code_covariance: Floats) -> Floats:
        return np.asarray(np.einsum("nqx,qp,xz,mpz->nm", B, mode_covariance, code_covariance, B, optimize=True))

    nil_x, nil_u, noise = np.zeros(72), np.zeros(4), error**2 * np.eye(144)
    shot = np.tile(np.repeat([0, 1], 24), 3)

    def drift(x: Floats, u: Floats) -> Floats:
        """Of a hundredth of each shot's light, between chart and white frame."""
        expected = bent.see(x, u)
        return np.asarray(1e-4 * np.outer(expected, expected) * (shot[:, None] == shot))

    A, D, B = bent.slopes(nil_x, nil_u)
    sigma = noise + drift(nil_x, nil_u) + curvature(B, np.eye(4), np.eye(72))
    x, off, spread = posterior(A, D, y - bent.see(nil_x, nil_u), sigma)
    bend = 1 + np.einsum("kq,kqv->kv", off.reshape(2, 2), modes[:, :, ::10])
    assert found.lamp == pytest.approx(lamps * interpolate(bend.T).T, rel=1e-6)
    code_covariance = np.linalg.inv(A.T @ np.linalg.solve(sigma, A) + np.eye(72))
    A, D, B = bent.slopes(x, off)
    sigma = noise + drift(x, off) + curvature(B, spread[72:, 72:], code_covariance)
    target = y - bent.see(x, off) + A @ x + D @ off
    assert near(found.matrix[0], A, abs=1e-5 * np.abs(A).max())
    assert found.target[0] == pytest.approx(target, abs=1e-5 * np.abs(target).max())
    assert near(found.covariance[0], sigma + D @ D.T, abs=1e-5 * np.abs(D @ D.T).max())
    x, again, spread = posterior(A, D, target, sigma)
    answer = solve(found, 1.0, np.zeros(1))
    own = np.linalg.inv(answer.precision[0] + np.eye(72))
    assert answer.values[0] == pytest.approx(x, abs=1e-4)
    assert near(own, spread[:72, :72], abs=1e-4)
    # And it is no mere identity: the truth lies where this posterior says.
    wrong = np.append(x - code, again - u)
    chi2 = wrong @ np.linalg.solve(spread, wrong) / 76
    assert 0.6 < chi2 < 1.5


def test_a_lamp_without_modes_stays_as_given() -> None:
    reflectance, lamp = chart_and_lamp("FL2")
    y = theory(reflectance, lamp, toy_camera())[None]
    found = rows(y, reflectance, 3.0 * lamp[None], lamp_tolerance=np.array([0.02]))
    assert np.array_equal(found.lamp, 3.0 * lamp[None])
    assert not found.terms["lamp modes"].any()


def test_a_lamp_left_out_of_its_family_is_found_out() -> None:
    """Beside a known daylight, an LED told by the others is bent towards what it is: with the errors of a capture.

    Were signals and chart exact, the family's own fault would be taken for evidence.
    """
    members = (*(f"LED-B{i}" for i in range(1, 6)), "LED-BH1", "LED-V1", "LED-V2")
    reflectance, day = chart_and_lamp("D55", slice(0, 24))
    seen = (WAVELENGTHS >= 420) & (WAVELENGTHS <= 680)
    shares = {}
    for name in members:
        others = [read_lamp(member).values for member in members if member != name]
        mean, directions = principal_modes(others, 5)
        true = read_lamp(name).values
        modes = np.stack([0 * directions, directions])
        y = np.stack([theory(reflectance, lamp, toy_camera()) for lamp in (day, true)])
        found = rows(
            y, reflectance, np.stack([day, mean]), lamp_modes=modes, lamp_tolerance=np.array([0.0, 0.17]),
            chart_tolerance=np.full(24, 0.03), standard_error=np.full(y.shape, 5e-3),
        )  # fmt: skip
        off = []
        for lamp in (mean, found.lamp[1]):
            scale = np.sum(lamp[seen] * true[seen]) / np.sum(lamp[seen] ** 2)
            off.append(np.sum((true - scale * lamp)[seen] ** 2))
        shares[name] = off[1] / off[0]
    assert all(share < 1.0 for share in shares.values()), shares  # LED-BH1's red peak is in no other
    assert np.median(list(shares.values())) < 0.3, shares


@pytest.mark.full
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
