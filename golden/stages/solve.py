"""The stage `solve`: the code of a convex problem, and its proof."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from golden.contract import Call, Keys, Stage, against_oracle, always, case, each, stored, words
from golden.forms import Json
from golden.linear_model import solve
from golden.matrices import PROBLEM, identity, posed, problem_of_rows, rows_of, waves
from golden.scenes import Case


def cases() -> Iterator[Json]:
    """All cases."""

    def solve(name: str, comment: str, problem: Json, *, depth: int | None = None, **more: Any) -> Case:
        return case(f"solve/{name}", comment, problem | {"depth": depth, "finish": None}, **more)

    A, b, eye = waves(8, 5, 3), waves(8, 1, 4)[..., 0], identity(8)
    yield solve("soft", "A = I: x = soft(b, γ), by hand [2, 0, 0] with objective 3.125.",
                posed(identity(3), [[3.0, -0.5, 1.0]] * 3, identity(3), 0.0, [1.0] * 3), generic=False
                )  # fmt: skip
    yield solve("one-atom", "One atom.", posed(A[:, :, :1], b, eye, 0.0, [0.1] * 3))
    yield solve("one-row", "One row, one atom.", posed(A[:, :1, :1], b[:, :1], identity(1), 0.0, [0.01] * 3))
    yield solve("zero-target", "b = 0: x = 0, objective 0, gap 0.", posed(A, 0 * b, eye, 0.0, [0.1] * 3))
    yield solve("gamma-kills", "γ above γ_max: x = 0.", posed(A, b, eye, 0.0, [1e3] * 3))
    yield solve("generic", "Eight rows, five atoms.", posed(A, b, eye, 0.0, [0.1] * 3))
    yield solve("three-gammas", "Another γ for each channel.", posed(A, b, eye, 0.0, [0.01, 0.1, 1.0]))
    yield solve("nonnegative", "x ≥ 0.", posed(A, b, eye, 0.0, [0.1] * 3, True))
    yield solve("elastic", "λ₂ = 1.", posed(A, b, eye, 1.0, [0.1] * 3))
    yield solve("closed-form", "γ = 0, λ₂ = 1: ridge regression.", posed(A, b, eye, 1.0, [0.0] * 3))
    yield solve("closed-form-nonnegative", "γ = 0, λ₂ = 0.1, x ≥ 0.", posed(A, b, eye, 0.1, [0.0] * 3, True))
    yield solve("gamma-tiny", "γ = 1e-9.", posed(A, b, eye, 0.0, [1e-9] * 3))
    yield solve("no-layers", "Depth 0: the finish alone arrives.", posed(A, b, eye, 0.0, [0.1] * 3), depth=0)
    F = waves(8, 2, 5)
    sigma = np.round(eye + F @ F.transpose(0, 2, 1), 6)
    yield solve("full-covariance", "Correlated errors.", posed(A, b, sigma, 0.0, [0.1] * 3))
    twice = np.concatenate([A, A], axis=2)
    yield solve("duplicate-atoms", "Every atom twice: the code is not unique, the objective is.",
                posed(twice, b, eye, 0.0, [0.1] * 3), generic=False)  # fmt: skip
    yield solve("duplicate-atoms-ridge", "Every atom twice, λ₂ = 1: they share.",
                posed(twice, b, eye, 1.0, [0.1] * 3), generic=False)  # fmt: skip
    yield solve("opposite-atoms", "Every atom and its negative.",
                posed(np.concatenate([A, -A], axis=2), b, eye, 0.0, [0.1] * 3, True), generic=False)  # fmt: skip
    yield solve("empty-atom", "An atom of zeros is never taken.",
                posed(np.concatenate([A, 0 * A[:, :, :1]], axis=2), b, eye, 0.0, [0.1] * 3))  # fmt: skip
    yield solve("identical-rows", "Eight times the same row: rank one.",
                posed(np.repeat(A[:, :1], 8, axis=1), np.repeat(b[:, :1], 8, axis=1), eye, 0.0, [0.1] * 3)
                )  # fmt: skip
    yield solve("more-atoms-than-rows", "Four rows, nine atoms.",
                posed(waves(4, 9, 6), b[:, :4], identity(4), 0.0, [0.05] * 3))  # fmt: skip
    tie = np.array([[1.0, 1.0, 0.5], [1.0, -1.0, 0.0], [0.0, 0.0, 0.5]])
    yield solve("ties", "Two atoms meet the bound together.",
                posed(np.broadcast_to(tie, (3, 3, 3)).copy(), [[2.0, 0.0, 1.0]] * 3, identity(3), 0.0, [0.5] * 3),
                generic=False)  # fmt: skip
    for l2, gamma, name in ((1.0, 0.05, "cameras"), (0.0, 1.4, "cameras-l1"), (1.0, 0.0, "cameras-closed")):
        yield solve(name, f"The product's rows, λ₂ = {l2:g}, γ = {gamma:g}.",
                    rows_of("cameras-two-lamps", l2, [gamma]), generic=False)  # fmt: skip
    for gamma, positive, name in (
        (1.0, True, "gaussian"),
        (1.0, False, "gaussian-signed"),
        (1e-3, True, "gaussian-weak"),
    ):
        yield solve(name, f"The paper's rows, γ = {gamma:g}, {'x ≥ 0' if positive else 'signed'}.",
                    rows_of("gaussian-twelve", 0.0, [gamma] * 3, positive), generic=False)  # fmt: skip
    yield solve("gaussian-one-atom", "A basis of one Gaussian.",
                rows_of("gaussian-one-atom", 0.0, [0.5] * 3, True))  # fmt: skip


def run(call: Call) -> dict[str, Any]:
    """The outputs of a case."""
    given = call.given
    sensing = problem_of_rows(given)
    more = {} if given["depth"] is None else {"depth": given["depth"]}
    code = solve(
        sensing, given["l2"], given["gamma"], nonnegative=given["nonnegative"], finish=given["finish"], **more
    )
    names = ("objective", "gap", "layers_gap", "finish_steps")
    return {"code": code.values, "evidence": code.log_evidence} | {name: getattr(code, name) for name in names}


LIMITS = (*each("relative", 1e-10, "objective evidence"),)


def limits(made: Json, scene: Json) -> list[Json]:
    """Against the stored outputs, code and steps only where the code is unique, and the oracle."""
    unique = [("code", "norm", 1e-9), ("finish_steps", "exact", 0.0)] if scene["generic"] else []
    return [*stored(made, [*LIMITS, *unique]), *against_oracle(made)]


STAGE = Stage(
    name="solve",
    keys=Keys(PROBLEM | words("depth finish"), words("code objective gap layers_gap finish_steps evidence")),
    requires=always("reference"),
    cases=cases,
    run=run,
    limits=limits,
    problem=problem_of_rows,
    oracle=True,
)
