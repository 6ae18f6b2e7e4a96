"""The stage `layers`: a number of layers without finish, and how far they stand from the optimum."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from camssf.grid import STEP
from camssf.recovery.layers import DEPTH
from camssf.recovery.onnx_model import Model, load_model
from camssf.recovery.rows import anchor
from golden.compare import peak
from golden.contract import Call, Stage, each, limit, stored, words
from golden.forms import GoldenError, Json, resolve
from golden.linear_model import solve
from golden.products import CALL, basis_of, model_inputs, objective_of, problem_of_call
from golden.scenes import ALL, NIKON, TWELVE, scene

KINDS = {"daylight": ("D55", 0.02), "white-led": ("LED-B3", 0.17), "fluorescent": ("FL2", 0.06)}
"""Lamps of which only the kind is known: the true lamp, and the tolerance that the kind's modes leave."""
PRODUCT = ("splitting", DEPTH)
"""Iteration and number of the product's layers."""


CAMERAS = (
    "Nikon D5100", "Canon EOS 5D Mark II", "Sony ILCE-7M3", "ARRI D21", "Fujifilm X-T3", "Canon EOS R5",
    "Arashi Vision Insta360 X5",
)  # fmt: skip
CAPTURES = (
    "D55", "A", "FL2", "LED-B3", "daylight", "white-led", "fluorescent",
    "D55 A", "D55 white-led", "A fluorescent", "daylight white-led",
    "D55 A FL2", "D55 A white-led", "daylight white-led fluorescent",
)  # fmt: skip
"""Lamps of the shots."""


def cases() -> Iterator[Json]:
    """Cases of the layers without finish, with the product's defaults and with others."""
    for i, lamps in enumerate(CAPTURES):
        for patches in (TWELVE, ALL):
            yield unfinished(
                f"{len(patches)}-{lamps.replace(' ', '-').lower()}",
                f"The product's layers alone, {lamps.replace(' ', ' + ')}, {len(patches)} patches, λ₂ = 1, γ = 0.05: "
                "they stand at cvxpy's optimum, and the finish has nothing to do.",
                lamps, patches, CAMERAS[i % len(CAMERAS)], *PRODUCT,
            )  # fmt: skip
    fewer = [("splitting", depth) for depth in (4, 8, 16)] + [("ista", depth) for depth in (16, 100, 1000, 10_000)]
    for name, lamps, patches in (("one", "D55", ALL), ("two", "D55 white-led", TWELVE)):
        for iteration, depth in fewer:
            yield unfinished(
                f"{iteration}-{depth}-{name}",
                f"{depth} layers of {iteration}, {lamps.replace(' ', ' + ')}, {len(patches)} patches: where they "
                "stand beside cvxpy's optimum.",
                lamps, patches, NIKON["camera"], iteration, depth,
            )  # fmt: skip


def unfinished(
    name: str, comment: str, lamps: str, patches: list[int], camera: str, iteration: str, depth: int
) -> Json:
    """A case of so many layers; some of the lamps are known by their kind alone."""
    names = lamps.split()
    true, tolerances = zip(*(KINDS.get(lamp, (lamp, 0.02)) for lamp in names), strict=True)
    kinds = [lamp if lamp in KINDS else None for lamp in names]
    change: Json = {"lamp": {"lamps": names}, "lamp_tolerance": tolerances, "iteration": iteration, "depth": depth}
    if any(kinds):
        change["lamp_modes"] = {"modes": kinds}
    return scene(
        name, comment, camera={"camera": camera}, lamps=true, patches=patches, noise="usual", change=change,
        stage="layers", requires="model" if (iteration, depth) == PRODUCT else "reference",
    )  # fmt: skip


def layers(given: dict[str, Any], case: Json, model: Model | None = None) -> dict[str, Any]:
    """The result of a number of layers alone, and its distance from the oracle's curve.

    The reference runs the layers alone. A model also has a finish; if that took no step, its result is the layers',
    and cases for models require that it took none.

    Raises:
        GoldenError: the model has other layers.
    """
    rows, basis = problem_of_call(given), basis_of(given["basis"])
    iteration, depth = given["iteration"], int(given["depth"])
    if model is None:
        arguments = (rows, given["l2"], np.full(len(rows.matrix), float(given["gamma"])))
        kind: dict[str, Any] = {"nonnegative": given["nonnegative"], "depth": depth, "layers": iteration}
        alone = solve(*arguments, finish=0, **kind)
        white = given["white_reflectance"] * given["lamp"][0]
        own, code, gap = anchor(basis, white), alone.values.reshape(3, -1).T, alone.gap
        curves = (own.mean + np.einsum("cmr,rc->cm", own.dictionary, code)).T
        curves = curves / (white @ curves * STEP)
        steps = solve(*arguments, **kind).finish_steps
    else:
        has = model.metadata.get("iteration"), int(model.metadata["depth"])
        if has != (iteration, depth):
            raise GoldenError(
                f"{case['case']}: {depth} layers of {iteration}, but the model has {has[1]} of {has[0]}"
            )
        outputs: dict[str, Any] = model.run(model_inputs(model, given))
        curves, code, gap, steps = (outputs[name] for name in ("ssf", "code", "layers_gap", "finish_steps"))
    return {
        "ssf": curves,
        "gap": gap,
        "finish_steps": steps if (iteration, depth) == PRODUCT else None,
        "objective": objective_of(given, rows, code),
        "distance": peak(curves, resolve(case["oracle"]["ssf"])),
    }


def run(call: Call) -> dict[str, Any]:
    """The outputs of a case."""
    return layers(call.given, call.case, load_model(call.given["basis"]) if call.engine == "onnx" else None)


ARRIVED, ERRING = 1e-9, 1e-6
"""Distance between a curve of layers and the optimum, relative to the peak, that is rounding; and the relative
tolerance with which a larger distance must be reproduced."""


def limits(made: Json, scene: Json) -> list[Json]:
    """The product's layers reach the optimum; others must match the stored values."""
    curves, product = limit("ssf", "outputs", "peak", 1e-10), "model" in made["requires"]
    if not product and made["outputs"]["distance"] > ARRIVED:
        rows = [("objective", "relative", 1e-9), *each("relative", ERRING, "distance gap")]
        return [curves, *stored(made, rows)]
    return [
        curves,
        limit("ssf", "oracle", "peak", 1e-7),
        limit("objective", "oracle", "relative", 1e-10, *(["reference"] if product else [])),
        limit("gap", "oracle", "at_most", 1e-10),
        *([limit("finish_steps", "outputs", "at_most", 0.0)] if product else []),
    ]


STAGE = Stage(
    name="layers",
    requires="reference",
    cases=cases,
    run=run,
    inputs=CALL | words("iteration depth"),
    limits=limits,
    outputs=words("objective gap finish_steps ssf distance"),
    problem=problem_of_call,
    oracle=True,
)
