"""The stage `solve`: the code of a convex problem, and its proof."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TypeAlias

import numpy as np

from golden.contract import Call, Stage, against_oracle, case, each, stored, words
from golden.forms import Json
from golden.linear_model import solve
from golden.matrices import PROBLEM, identity, posed, problem_of_rows, rows_of, waves

Row: TypeAlias = tuple[str, str, Json, str]
"""Name, comment, problem, and "unique", or "not unique" where the codes of two solvers may differ."""
UNIQUE, MANY = "unique", "not unique"


def rows() -> list[Row]:
    """All cases."""
    A, b, eye, one = waves(8, 5, 3), waves(8, 1, 4)[..., 0], identity(8), [0.1] * 3
    F = waves(8, 2, 5)
    sigma = np.round(eye + F @ F.transpose(0, 2, 1), 6)
    twice, zeros = np.concatenate([A, A], axis=2), 0 * A[:, :, :1]
    tie = np.broadcast_to([[1.0, 1.0, 0.5], [1.0, -1.0, 0.0], [0.0, 0.0, 0.5]], (3, 3, 3)).copy()
    two, twelve = "cameras-two-lamps", "gaussian-twelve"
    return [
        ("soft", "A = I: x = soft(b, γ), by hand [2, 0, 0] with objective 3.125.",
         posed(identity(3), [[3.0, -0.5, 1.0]] * 3, identity(3), 0.0, [1.0] * 3), MANY),
        ("one-atom", "One atom.", posed(A[:, :, :1], b, eye, 0.0, one), UNIQUE),
        ("zero-target", "b = 0: x = 0, objective 0, gap 0.", posed(A, 0 * b, eye, 0.0, one), UNIQUE),
        ("gamma-kills", "γ above γ_max: x = 0.", posed(A, b, eye, 0.0, [1e3] * 3), UNIQUE),
        ("generic", "Eight rows, five atoms.", posed(A, b, eye, 0.0, one), UNIQUE),
        ("nonnegative", "x ≥ 0.", posed(A, b, eye, 0.0, one, True), UNIQUE),
        ("closed-form", "γ = 0, λ₂ = 1: ridge regression.", posed(A, b, eye, 1.0, [0.0] * 3), UNIQUE),
        ("closed-form-nonnegative", "γ = 0, λ₂ = 0.1, x ≥ 0.", posed(A, b, eye, 0.1, [0.0] * 3, True), UNIQUE),
        ("gamma-tiny", "γ = 1e-9.", posed(A, b, eye, 0.0, [1e-9] * 3), UNIQUE),
        ("no-layers", "Depth 0: the finish alone arrives.", posed(A, b, eye, 0.0, one) | {"depth": 0}, UNIQUE),
        ("full-covariance", "Correlated errors.", posed(A, b, sigma, 0.0, one), UNIQUE),
        ("duplicate-atoms", "Every atom twice: the code is not unique, the objective is.",
         posed(twice, b, eye, 0.0, one), MANY),
        ("opposite-atoms", "Every atom and its negative.",
         posed(np.concatenate([A, -A], axis=2), b, eye, 0.0, one, True), MANY),
        ("empty-atom", "An atom of zeros is never taken.",
         posed(np.concatenate([A, zeros], axis=2), b, eye, 0.0, one), UNIQUE),
        ("more-atoms-than-rows", "Four rows, nine atoms.",
         posed(waves(4, 9, 6), b[:, :4], identity(4), 0.0, [0.05] * 3), UNIQUE),
        ("ties", "Two atoms meet the bound together.",
         posed(tie, [[2.0, 0.0, 1.0]] * 3, identity(3), 0.0, [0.5] * 3), MANY),
        ("cameras", "The product's rows, λ₂ = 1, γ = 0.05.", rows_of(two, 1.0, [0.05]), MANY),
        ("cameras-l1", "The product's rows, λ₂ = 0, γ = 1.4.", rows_of(two, 0.0, [1.4]), MANY),
        ("gaussian", "The paper's rows, γ = 1, x ≥ 0.", rows_of(twelve, 0.0, [1.0] * 3, True), MANY),
        ("gaussian-weak", "The paper's rows, γ = 0.001, x ≥ 0.", rows_of(twelve, 0.0, [1e-3] * 3, True), MANY),
        ("gaussian-one-atom", "A basis of one Gaussian.",
         rows_of("gaussian-one-atom", 0.0, [0.5] * 3, True), UNIQUE),
    ]  # fmt: skip


def cases() -> Iterator[Json]:
    """All cases."""
    for name, comment, problem, code in rows():
        yield case(f"solve/{name}", comment, {"depth": None, "finish": None} | problem, generic=code == UNIQUE)


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


def limits(made: Json, scene: Json) -> list[Json]:
    """Against the stored outputs, code and steps only where the code is unique, and the oracle."""
    unique = [("code", "norm", 1e-9), ("finish_steps", "exact", 0.0)] if scene["generic"] else []
    return [*stored(made, [*each("relative", 1e-10, "objective evidence"), *unique]), *against_oracle(made)]


STAGE = Stage(
    name="solve",
    requires="reference",
    cases=cases,
    run=run,
    inputs=PROBLEM | words("depth finish"),
    limits=limits,
    outputs=words("code objective gap layers_gap finish_steps evidence"),
    problem=problem_of_rows,
    oracle=True,
)
