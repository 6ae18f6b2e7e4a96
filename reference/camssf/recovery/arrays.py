"""What the formulas of `camssf.recovery` need beyond the Python array API: conditions, loops, triangular systems.

The formulas take arrays of any library that follows the standard (https://data-apis.org/array-api) and give arrays of
the same library. NumPy is the reference. `camssf_onnx.tracer` has arrays of its own that record each operation as a
node of a model; torch and array-api-strict run the same formulas in tests. Therefore the formulas use the standard's
functions, basic indexing with `...`, `where` for conditions on elements, and this file for the rest. All numbers are
float64; functions that make arrays say so, because torch's own default is float32.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from camssf.grid import Floats

Array = Any
"""An array of NumPy, of torch, of array-api-strict, or of the tracer."""
PANEL = 24
"""Rows that `solve_lower` solves one by one before one product updates the next rows."""


def namespace(x: Array) -> Any:
    """The functions of the library that the array belongs to."""
    if hasattr(x, "__array_namespace__"):
        return x.__array_namespace__()
    from array_api_compat import array_namespace  # torch

    return array_namespace(x)


def constant(xp: Any, values: Any) -> Array:
    """Fixed numbers as an array of the library `xp`."""
    return xp.asarray(np.array(values))


def eye(xp: Any, size: int) -> Array:
    """The identity, (size, size)."""
    return xp.eye(size, dtype=xp.float64)


def zeros(xp: Any, *shape: int) -> Array:
    """Zeros."""
    return xp.zeros(shape, dtype=xp.float64)


def real(x: Array) -> Array:
    """1 where a condition holds, else 0."""
    xp = namespace(x)
    return xp.astype(x, xp.float64)


def cond(
    condition: Array, then: Callable[[], Sequence[Array]], otherwise: Callable[[], Sequence[Array]]
) -> Sequence[Array]:
    """`then()` if the condition () holds, else `otherwise()`: as many arrays from both."""
    xp = namespace(condition)
    if not isinstance(xp, ModuleType):  # the tracer, which records both
        return xp.cond(condition, then, otherwise)  # type: ignore[no-any-return]
    return then() if bool(condition) else otherwise()


def loop(
    times: int,
    state: Sequence[Array],
    body: Callable[[Any, Sequence[Array]], Sequence[Array]],
    stride: int | None = None,
) -> Sequence[Array]:
    """The state after `times` steps `body(step, state)`.

    `stride`: number of steps that the tracer's loop takes at a time, None for several; without effect elsewhere.
    """
    xp = namespace(state[0])
    if not isinstance(xp, ModuleType):
        return xp.loop(times, state, body, stride)  # type: ignore[no-any-return]
    for step in range(times):
        state = body(step, state)
    return state


def loop_while(
    times: int,
    state: Sequence[Array],
    body: Callable[[Sequence[Array]], tuple[Sequence[Array], Array]],
    begin: Array | bool = True,
) -> Sequence[Array]:
    """The state after at most `times` steps `body(state)`, which also says whether to go on; `begin`: to start."""
    xp = namespace(state[0])
    if not isinstance(xp, ModuleType):
        return xp.loop_while(times, state, body, begin)  # type: ignore[no-any-return]
    go = begin
    for _ in range(times):
        if not bool(go):
            break
        state, go = body(state)
    return state


def chosen(condition: Array, arrays: Sequence[Array]) -> list[Array]:
    """Of each array (n, ...) the entries at which a condition (n,) holds."""
    xp = namespace(condition)
    if not isinstance(xp, ModuleType):
        return xp.chosen(condition, arrays)  # type: ignore[no-any-return]
    return [x[condition] for x in arrays]


def each_block(function: Callable[[Array], Array], x: Array) -> Array:
    """The function of every entry of the first axis, stacked along it: the model holds one at a time."""
    xp = namespace(x)
    if not isinstance(xp, ModuleType):
        return xp.each_block(function, x)
    return xp.stack([function(x[i, ...]) for i in range(x.shape[0])])


def whiten(sigma: Array, columns: Array, panel: int = 6) -> tuple[Array, Array]:
    """L⁻¹ columns (..., N, p), with Σ = L Lᵀ (..., N, N), and ln det Σ (...); Σ⁻¹ would lose twice the digits.

    `panel`: number of rows that the tracer's loop takes at a time; without effect elsewhere.
    """
    xp = namespace(sigma)
    if not isinstance(xp, ModuleType):
        return xp.whiten(sigma, columns, panel)  # type: ignore[no-any-return]
    L = xp.linalg.cholesky(sigma)
    return _solve_lower(L, columns), _log_det(L)


def whiten_and_solve(sigma: Array, columns: Array) -> tuple[Array, Array, Callable[[], Array]]:
    """`whiten`, and a function that gives Σ⁻¹ columns (..., N, p)."""
    xp = namespace(sigma)
    if not isinstance(xp, ModuleType):
        return xp.whiten_and_solve(sigma, columns)  # type: ignore[no-any-return]
    L = xp.linalg.cholesky(sigma)
    white = _solve_lower(L, columns)

    def solve() -> Array:  # Lᵀ x = w with the order of rows and columns reversed is a lower triangular system
        return xp.flip(_solve_lower(xp.flip(L.mT, axis=(-2, -1)), xp.flip(white, axis=-2)), axis=-2)

    return white, _log_det(L), solve


def inverse(M: Array, panel: int = 6) -> tuple[Array, Array]:
    """M⁻¹ = L⁻ᵀ L⁻¹ and ln det M of positive definite M (..., r, r); `panel` as of `whiten`."""
    xp = namespace(M)
    root, log_det = whiten(M, xp.broadcast_to(eye(xp, M.shape[-1]), M.shape), panel)
    return root.mT @ root, log_det


def _log_det(L: Array) -> Array:
    xp = namespace(L)
    return 2.0 * xp.sum(xp.log(xp.linalg.diagonal(L)), axis=-1)


def _solve_lower(L: Array, b: Array) -> Array:
    """`solve_lower` of any library: the standard has no function for it."""
    if isinstance(L, np.ndarray):
        return solve_lower(L, b)
    if type(L).__module__.partition(".")[0] == "torch":
        from torch.linalg import solve_triangular

        return solve_triangular(L, b, upper=False)
    return namespace(L).asarray(solve_lower(np.asarray(L), np.asarray(b)))


def solve_lower(L: NDArray[np.floating[Any]], b: Floats) -> Floats:
    """L⁻¹ b by substitution, L (..., N, N) lower triangular, b (..., N, r), NumPy.

    Not by `numpy.linalg.solve`: its pivoting loses the relative accuracy of the rows of masked signals, whose
    standard error is 1000.
    """
    x = np.array(np.broadcast_to(b, (*np.broadcast_shapes(L.shape[:-2], b.shape[:-2]), *b.shape[-2:])), np.float64)
    for start in range(0, L.shape[-1], PANEL):
        stop = min(start + PANEL, L.shape[-1])
        x[..., start:stop, :] -= L[..., start:stop, :start] @ x[..., :start, :]
        for i in range(start, stop):
            x[..., i, :] -= (L[..., i : i + 1, start:i] @ x[..., start:i, :])[..., 0, :]
            x[..., i, :] /= L[..., i, i, None]
    return x
