"""The stage `layers`: a number of layers without finish, and how far they stand from the optimum."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from camssf.grid import STEP
from camssf.recovery.layers import DEPTH
from camssf.recovery.onnx_model import Model, load_model
from camssf.recovery.rows import anchor
from golden.compare import peak
from golden.contract import Call, Keys, Stage, limit, stored, words
from golden.forms import GoldenError, Json, resolve
from golden.linear_model import solve
from golden.products import CALL, basis_of, model_inputs, objective_of, problem_of_call
from golden.scenes import ALL, NIKON, TWELVE, Case, scene

KINDS = {"daylight": ("D55", 0.02), "white-led": ("LED-B3", 0.17), "fluorescent": ("FL2", 0.06)}
"""Lamps of which only the kind is known: the true lamp, and the tolerance that the kind's modes leave."""


def cases() -> Iterator[Json]:
    """Cases of the layers without finish, with the product's defaults and with others."""

    def unfinished(
        name: str, comment: str, names: Sequence[str], patches: list[int], camera: str, iteration: str, depth: int
    ) -> Case:
        kinds = [lamp if lamp in KINDS else None for lamp in names]
        change: Json = {
            "lamp": {"lamps": list(names)},
            "lamp_tolerance": [KINDS[lamp][1] if lamp in KINDS else 0.02 for lamp in names],
            "iteration": iteration,
            "depth": depth,
        }
        if any(kinds):
            change["lamp_modes"] = {"modes": kinds}
        true = [KINDS[lamp][0] if lamp in KINDS else lamp for lamp in names]
        return scene(
            name, comment, camera={"camera": camera}, lamps=true, patches=patches, noise="usual", change=change,
            stage="layers",
        )  # fmt: skip

    cameras = [
        "Nikon D5100", "Canon EOS 5D Mark II", "Sony ILCE-7M3", "ARRI D21", "Fujifilm X-T3", "Canon EOS R5",
        "Arashi Vision Insta360 X5",
    ]  # fmt: skip
    captures: list[tuple[str, ...]] = [
        ("D55",), ("A",), ("FL2",), ("LED-B3",), ("daylight",), ("white-led",), ("fluorescent",),
        ("D55", "A"), ("D55", "white-led"), ("A", "fluorescent"), ("daylight", "white-led"),
        ("D55", "A", "FL2"), ("D55", "A", "white-led"), ("daylight", "white-led", "fluorescent"),
    ]  # fmt: skip
    for i, names in enumerate(captures):
        for patches in (TWELVE, ALL):
            yield unfinished(
                f"{len(patches)}-{'-'.join(names).lower()}",
                f"The product's layers alone, {' + '.join(names)}, {len(patches)} patches, λ₂ = 1, γ = 0.05: they "
                "stand at cvxpy's optimum, and the finish has nothing to do.",
                names, patches, cameras[i % len(cameras)], "splitting", DEPTH,
            )  # fmt: skip
    for name, names, patches in (("one", ("D55",), ALL), ("two", ("D55", "white-led"), TWELVE)):
        for iteration, depths in (("splitting", (4, 8, 16)), ("ista", (16, 100, 1000, 10_000))):
            for depth in depths:
                yield unfinished(
                    f"{iteration}-{depth}-{name}",
                    f"{depth} layers of {iteration}, {' + '.join(names)}, {len(patches)} patches: where "
                    "they stand beside cvxpy's optimum.",
                    names, patches, NIKON["camera"], iteration, depth,
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
        found: dict[str, Any] = model.run(model_inputs(model, given))
        curves, code, gap, steps = (found[name] for name in ("ssf", "code", "layers_gap", "finish_steps"))
    return {
        "ssf": curves,
        "gap": gap,
        "finish_steps": steps if (iteration, depth) == ("splitting", DEPTH) else None,
        "objective": objective_of(given, rows, code),
        "distance": peak(curves, resolve(case["oracle"]["ssf"])),
    }


def run(call: Call) -> dict[str, Any]:
    """The outputs of a case."""
    return layers(call.given, call.case, load_model(call.given["basis"]) if call.engine == "onnx" else None)


def requires(inputs: Json) -> list[str]:
    """The model where it has these layers, else the reference."""
    return ["model"] if (inputs["iteration"], inputs["depth"]) == ("splitting", DEPTH) else ["reference"]


ARRIVED, ERRING = 1e-9, 1e-6
"""Distance between a curve of layers and the optimum, relative to the peak, that is rounding; and the relative
tolerance with which a larger distance must be reproduced."""


def limits(made: Json, scene: Json) -> list[Json]:
    """Limits of the stage `layers`: the product's layers reach the optimum; others must match the stored values."""
    found = stored(made, [("ssf", "peak", 1e-10)])
    product = "model" in made["requires"]
    if product or made["outputs"]["distance"] <= ARRIVED:
        return (
            found
            + [
                limit("ssf", "oracle", "peak", 1e-7),
                limit("objective", "oracle", "relative", 1e-10, *(["reference"] if product else [])),
                limit("gap", "oracle", "at_most", 1e-10),
            ]
            + ([limit("finish_steps", "outputs", "at_most", 0.0)] if product else [])
        )
    return [
        *found,
        limit("objective", "outputs", "relative", 1e-09),
        *(limit(name, "outputs", "relative", ERRING) for name in ("distance", "gap")),
    ]


STAGE = Stage(
    name="layers",
    keys=Keys(CALL | words("iteration depth"), words("objective gap finish_steps ssf distance")),
    requires=requires,
    cases=cases,
    run=run,
    limits=limits,
    problem=problem_of_call,
    oracle=True,
)
