"""The stage `weights`: the layers' weights, and what each of a few layers gives."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from golden.contract import Call, Stage, case, each, words
from golden.forms import Json
from golden.linear_model import solve
from golden.matrices import PROBLEM, identity, posed, problem_of_rows, rows_of, waves


def cases() -> Iterator[Json]:
    """All cases."""
    A, b, eye = waves(6, 4, 1), waves(6, 1, 2)[..., 0], identity(6)
    rows: list[tuple[str, str, Json, list[int]]] = [
        ("identity", "A = I, λ₂ = 0, γ = 1: W = I / 2, and z by hand.",
         posed(identity(3), [[3.0, -0.5, 1.0]] * 3, identity(3), 0.0, [1.0] * 3), [0, 1, 2]),
        ("waves", "Six rows, four atoms, λ₂ = 1.", posed(A, b, eye, 1.0, [0.1] * 3), [1, 8, 32]),
        ("waves-nonnegative", "The same with x ≥ 0 and another γ for each channel.",
         posed(A, b, eye, 0.0, [0.05, 0.2, 0.8], True), [1, 8, 32]),
        ("closed-form", "γ = 0: W = (H + 2 λ₂ I)⁻¹, nothing is thresholded.",
         posed(A, b, eye, 0.5, [0.0] * 3), [1, 32]),
        ("cameras", "The product's rows: two lamps, full covariance, λ₂ = 1, γ = 0.05.",
         rows_of("cameras-two-lamps", 1.0, [0.05]), [1, 4, 32]),
        ("cameras-l1", "λ₂ = 0, γ = 1.4.", rows_of("cameras-two-lamps", 0.0, [1.4]), [1, 4, 32]),
        ("gaussian", "The paper's rows, x ≥ 0.", rows_of("gaussian-twelve", 0.0, [1.0] * 3, True), [1, 4, 32]),
    ]  # fmt: skip
    for name, comment, problem, depths in rows:
        yield case(f"weights/{name}", comment, problem | {"depths": depths})


def run(call: Call) -> dict[str, Any]:
    """ρ = γ + 2 λ₂, W = (H + ρ I)⁻¹, and z after each of the depths."""
    given = call.given
    sensing = problem_of_rows(given)
    l2, gamma, nonnegative = given["l2"], given["gamma"], given["nonnegative"]
    codes = [solve(sensing, l2, gamma, nonnegative=nonnegative, depth=int(d), finish=0) for d in given["depths"]]
    rho = gamma + 2.0 * l2
    W = np.linalg.inv(codes[0].precision + rho[:, None, None] * np.eye(sensing.matrix.shape[2]))
    return {"rho": rho, "W": W, "z": np.stack([code.values for code in codes])}


STAGE = Stage(
    name="weights",
    requires="reference",
    cases=cases,
    run=run,
    inputs=PROBLEM | words("depths"),
    limits=(*each("norm", 1e-15, "rho"), *each("norm", 1e-10, "W z")),
    problem=problem_of_rows,
)
