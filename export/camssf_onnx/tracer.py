"""A namespace of the Python array API that records what it computes as the nodes of an ONNX graph.

`Array.__array_namespace__` gives the tracer, so `camssf.recovery.arrays.namespace` finds it just as it finds NumPy.
It has those functions of the standard that the formulas use; another one is an AttributeError at the line that calls
it. Shapes are checked while tracing (`camssf_onnx.sizes`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import prod
from typing import Any

import numpy as np
from onnx import helper

from camssf_onnx import panels
from camssf_onnx.graph import KINDS, Graph, info
from camssf_onnx.sizes import Dim, Size, broadcast, length, same

END = 2**31
"""End of a slice that reaches to the end of its axis."""
STRIDES = (4, 3, 2, 1)
"""Steps of a loop that one turn may take: a turn itself costs as much as a few nodes."""


class Array:
    """A traced array: the name of a value, its shape and its kind, "float64", "int64" or "bool"."""

    __array_ufunc__ = None  # so that NumPy leaves `array + traced` to this class

    def __init__(self, xp: Tracer, name: str, shape: Sequence[Size], dtype: str = "float64") -> None:
        self.xp, self.name, self.shape, self.dtype = xp, name, tuple(shape), dtype

    def __array_namespace__(self) -> Tracer:
        return self.xp

    @property
    def ndim(self) -> int:
        """Number of axes."""
        return len(self.shape)

    @property
    def mT(self) -> Array:  # noqa: N802
        """With the last two axes exchanged."""
        return self.xp.permute_dims(self, (*range(self.ndim - 2), self.ndim - 1, self.ndim - 2))

    def __add__(self, other: Any) -> Array:
        return self.xp.both("Add", self, other)

    def __radd__(self, other: Any) -> Array:
        return self.xp.both("Add", other, self)

    def __sub__(self, other: Any) -> Array:
        return self.xp.both("Sub", self, other)

    def __rsub__(self, other: Any) -> Array:
        return self.xp.both("Sub", other, self)

    def __mul__(self, other: Any) -> Array:
        return self.xp.both("Mul", self, other)

    def __rmul__(self, other: Any) -> Array:
        return self.xp.both("Mul", other, self)

    def __truediv__(self, other: Any) -> Array:
        return self.xp.both("Div", self, other)

    def __rtruediv__(self, other: Any) -> Array:
        return self.xp.both("Div", other, self)

    def __pow__(self, exponent: int) -> Array:
        if exponent != 2:
            raise ValueError(f"only squares are traced, not a power of {exponent}")
        return self * self

    def __matmul__(self, other: Any) -> Array:
        return self.xp.matmul(self, other)

    def __rmatmul__(self, other: Any) -> Array:
        return self.xp.matmul(other, self)

    def __neg__(self) -> Array:
        return self.xp.one("Neg", self)

    def __and__(self, other: Any) -> Array:
        return self.xp.both("And", self, other, "bool")

    def __or__(self, other: Any) -> Array:
        return self.xp.both("Or", self, other, "bool")

    def __gt__(self, other: Any) -> Array:
        return self.xp.both("Greater", self, other, "bool")

    def __lt__(self, other: Any) -> Array:
        return self.xp.both("Less", self, other, "bool")

    def __ge__(self, other: Any) -> Array:
        return self.xp.both("GreaterOrEqual", self, other, "bool")

    def __le__(self, other: Any) -> Array:
        return self.xp.both("LessOrEqual", self, other, "bool")

    def __eq__(self, other: Any) -> Array:  # type: ignore[override]
        return self.xp.both("Equal", self, other, "bool")

    def __ne__(self, other: Any) -> Array:  # type: ignore[override]
        return self.xp.logical_not(self == other)

    __hash__ = None  # type: ignore[assignment]

    def __bool__(self) -> bool:
        raise TypeError("a traced array has no truth: use `where` or `cond`")

    def __getitem__(self, key: Any) -> Array:
        return self.xp.index(self, key if isinstance(key, tuple) else (key,))


class Tracer:
    """The namespace. Nodes go to the innermost graph that is being traced, sizes to the outermost one."""

    float64, int64, bool = "float64", "int64", "bool"

    def __init__(self, graph: Graph) -> None:
        self.graph = graph
        self.sizes: dict[str, str] = {}
        self.symbols = 0

    # Inputs, sizes and nodes

    def input(self, name: str, shape: Sequence[str | int]) -> Array:
        """An input of the model; a name as a size is that of the axis."""
        for axis, size in enumerate(shape):
            if isinstance(size, str) and size not in self.sizes:
                self.sizes[size] = self.graph.outermost.add("Shape", [name], start=axis, end=axis + 1)[0]
        return Array(self, name, [Dim({(size,): 1}) if isinstance(size, str) else size for size in shape])

    def symbol(self, vector: str | None = None) -> Dim:
        """A size of its own name: that of a vector (1,) of the outermost graph, or one that no node may ask for."""
        self.symbols += 1
        name = f"size {self.symbols}"
        if vector is not None:
            self.sizes[name] = vector
        return Dim({(name,): 1})

    def size(self, dim: Size) -> str:
        """A vector (1,) with a size."""
        graph = self.graph.outermost
        if not isinstance(dim, Dim):
            return graph.constant([dim], "int64")
        if repr(dim) not in self.sizes:
            total = ""
            for names, count in dim.terms.items():
                factors = [graph.constant([count], "int64")] if count != 1 or not names else []
                factors += [self.sizes[name] for name in names]
                part = factors[0]
                for factor in factors[1:]:
                    part = graph.add("Mul", [part, factor])[0]
                total = graph.add("Add", [total, part])[0] if total else part
            self.sizes[repr(dim)] = total
        return self.sizes[repr(dim)]

    def vector(self, sizes: Sequence[Size]) -> str:
        """A vector of several sizes."""
        if not any(isinstance(size, Dim) for size in sizes):
            return self.graph.constant(np.array(sizes), "int64")
        if repr(tuple(sizes)) not in self.sizes:
            parts = [self.size(size) for size in sizes]
            joined = parts[0] if len(parts) == 1 else self.graph.outermost.add("Concat", parts, axis=0)[0]
            self.sizes[repr(tuple(sizes))] = joined
        return self.sizes[repr(tuple(sizes))]

    def name(self, x: Any, dtype: str = "float64") -> str:
        """The name of an array's value, or of a constant."""
        return x.name if isinstance(x, Array) else self.graph.constant(x, dtype)

    def node(
        self, kind: str, shape: Sequence[Size], *inputs: str, dtype: str = "float64", **attributes: Any
    ) -> Array:
        """The first output of a node."""
        return Array(self, self.graph.add(kind, inputs, **attributes)[0], shape, dtype)

    def one(self, kind: str, x: Array) -> Array:
        """A function of each element."""
        return self.node(kind, x.shape, x.name, dtype=x.dtype)

    def both(self, kind: str, a: Any, b: Any, dtype: str | None = None) -> Array:
        """A function of each pair of elements; numbers have the kind of the array that they meet."""
        known = a.dtype if isinstance(a, Array) else b.dtype
        names = [self.name(x, known) for x in (a, b)]
        return self.node(kind, broadcast(_shape(a), _shape(b)), *names, dtype=dtype or known)

    # The array API

    def asarray(self, x: Any) -> Array:
        """A constant."""
        dtype = {"f": "float64", "i": "int64", "b": "bool"}[np.asarray(x).dtype.kind]
        return Array(self, self.graph.constant(x, dtype), np.shape(x), dtype)

    def astype(self, x: Array, dtype: str) -> Array:
        return self.node("Cast", x.shape, x.name, dtype=dtype, to=KINDS[dtype])

    def maximum(self, a: Any, b: Any) -> Array:
        return self.both("Max", a, b)

    def minimum(self, a: Any, b: Any) -> Array:
        return self.both("Min", a, b)

    def sqrt(self, x: Array) -> Array:
        return self.one("Sqrt", x)

    def exp(self, x: Array) -> Array:
        return self.one("Exp", x)

    def log(self, x: Array) -> Array:
        return self.one("Log", x)

    def abs(self, x: Array) -> Array:
        return self.one("Abs", x)

    def sign(self, x: Array) -> Array:
        return self.one("Sign", x)

    def logical_not(self, x: Array) -> Array:
        return self.one("Not", x)

    def where(self, condition: Array, a: Any, b: Any) -> Array:
        shape = broadcast(condition.shape, _shape(a), _shape(b))
        return self.node("Where", shape, condition.name, self.name(a), self.name(b))

    def matmul(self, a: Any, b: Any) -> Array:
        left, right = _shape(a), _shape(b)
        if len(left) < 2 or len(right) < 2 or not same(left[-1], right[-2]):
            raise ValueError(f"matrices of shapes {left} and {right} have no product")
        shape = (*broadcast(left[:-2], right[:-2]), left[-2], right[-1])
        return self.node("MatMul", shape, self.name(a), self.name(b))

    def permute_dims(self, x: Array, axes: Sequence[int]) -> Array:
        return self.node("Transpose", [x.shape[axis] for axis in axes], x.name, dtype=x.dtype, perm=list(axes))

    def reshape(self, x: Array, shape: Sequence[Size]) -> Array:
        if not same(prod(x.shape), prod(shape)):
            raise ValueError(f"an array of shape {x.shape} cannot have the shape {tuple(shape)}")
        return self.node("Reshape", shape, x.name, self.vector(shape), dtype=x.dtype)

    def broadcast_to(self, x: Array, shape: Sequence[Size]) -> Array:
        broadcast(x.shape, shape)
        return self.node("Expand", shape, x.name, self.vector(shape), dtype=x.dtype)

    def concat(self, arrays: Sequence[Array], axis: int = 0) -> Array:
        first, at = arrays[0], axis % arrays[0].ndim
        for x in arrays[1:]:
            if not all(same(p, q) for i, (p, q) in enumerate(zip(x.shape, first.shape, strict=True)) if i != at):
                raise ValueError(f"arrays of shapes {first.shape} and {x.shape} cannot be joined along axis {at}")
        total = sum((x.shape[at] for x in arrays[1:]), first.shape[at])
        shape = (*first.shape[:at], total, *first.shape[at + 1 :])
        return self.node("Concat", shape, *(x.name for x in arrays), axis=at)

    def stack(self, arrays: Sequence[Array], axis: int = 0) -> Array:
        at = axis % (arrays[0].ndim + 1)
        return self.concat([x[(*(slice(None),) * at, None, ...)] for x in arrays], axis=at)

    def index(self, x: Array, key: tuple[Any, ...]) -> Array:
        """Basic indexing by numbers, slices, None and Ellipsis."""
        keys = list(key) if Ellipsis in [k if k is Ellipsis else None for k in key] else [*key, Ellipsis]
        at = next(i for i, k in enumerate(keys) if k is Ellipsis)
        keys[at : at + 1] = [slice(None)] * (x.ndim - sum(k is not None for k in keys) + 1)
        axis = 0
        cuts: list[tuple[int, slice]] = []
        picks: list[tuple[int, int]] = []
        new: list[int] = []
        shape: list[Size] = []
        for k in keys:
            if k is None:
                new.append(len(shape))
                shape.append(1)
                continue
            if not isinstance(k, slice):
                picks.append((axis, k))
            else:
                shape.append(length(x.shape[axis], k))
                if not (k.start is k.stop is k.step is None):
                    cuts.append((axis, k))
            axis += 1
        name = x.name
        if cuts:
            axes, slices = zip(*cuts, strict=True)
            starts, stops, steps = (
                [default if (end := getattr(k, which)) is None else end for k in slices]
                for which, default in (("start", 0), ("stop", END), ("step", 1))
            )
            more = [self.graph.constant(steps, "int64")] if set(steps) != {1} else []
            ends = [self.vector(starts), self.vector(stops), self.graph.constant(axes, "int64")]
            name = self.graph.add("Slice", [name, *ends, *more])[0]
        for axis, place in reversed(picks):
            name = self.graph.add("Gather", [name, self.graph.constant(place, "int64")], axis=axis)[0]
        if new:
            name = self.graph.add("Unsqueeze", [name, self.graph.constant(new, "int64")])[0]
        return Array(self, name, shape, x.dtype)

    def take(self, x: Array, indices: Array, axis: int) -> Array:
        """The entries of an axis at whole numbers (n,)."""
        shape = (*x.shape[:axis], *indices.shape, *x.shape[axis + 1 :])
        return self.node("Gather", shape, x.name, indices.name, dtype=x.dtype, axis=axis)

    def sum(self, x: Array, axis: Any = None, keepdims: Any = False) -> Array:
        return self._reduced("ReduceSum", x, axis, keepdims)

    def mean(self, x: Array, axis: Any = None, keepdims: Any = False) -> Array:
        return self._reduced("ReduceMean", x, axis, keepdims)

    def max(self, x: Array, axis: Any = None, keepdims: Any = False) -> Array:
        return self._reduced("ReduceMax", x, axis, keepdims)

    def min(self, x: Array, axis: Any = None, keepdims: Any = False) -> Array:
        return self._reduced("ReduceMin", x, axis, keepdims)

    def any(self, x: Array) -> Array:
        return self.max(self.astype(x, self.float64)) > 0.5

    def argmax(self, x: Array, axis: int, keepdims: Any = False) -> Array:
        at = axis % x.ndim
        return self.node("ArgMax", _kept(x, [at], keepdims), x.name, dtype="int64", axis=at, keepdims=int(keepdims))

    def _reduced(self, kind: str, x: Array, axis: Any, keepdims: Any) -> Array:
        axes = range(x.ndim) if axis is None else [a % x.ndim for a in ([axis] if isinstance(axis, int) else axis)]
        places = self.graph.constant(list(axes), "int64")
        return self.node(kind, _kept(x, axes, keepdims), x.name, places, keepdims=int(keepdims))

    def arange(self, size: Size) -> Array:
        if isinstance(size, int):
            return self.asarray(np.arange(size))
        end = self.graph.outermost.add("Squeeze", [self.size(size)])[0]
        zero, step = (self.graph.constant(number, "int64") for number in (0, 1))
        return self.node("Range", (size,), zero, end, step, dtype="int64")

    def eye(self, size: Size, dtype: str = "float64") -> Array:
        if isinstance(size, int):
            return self.asarray(np.eye(size))
        order = self.arange(size)
        return self.astype(order[:, None] == order[None, :], dtype)

    def full(self, shape: Sequence[Size], value: float, dtype: str = "float64") -> Array:
        return self.broadcast_to(self.asarray(np.array(float(value))), shape)

    def zeros(self, shape: Sequence[Size], dtype: str = "float64") -> Array:
        return self.full(shape, 0.0)

    def ones(self, shape: Sequence[Size], dtype: str = "float64") -> Array:
        return self.full(shape, 1.0)

    # What the array API lacks: `camssf.recovery.arrays`

    def cond(
        self, condition: Array, then: Callable[[], Sequence[Array]], otherwise: Callable[[], Sequence[Array]]
    ) -> list[Array]:
        """An If; a size that differs between the branches gets a name of its own.

        An axis of length 0 in `otherwise` is that of an array that nobody reads then.
        """
        branches = [self._branch(then), self._branch(otherwise)]
        (first, some), (second, others) = branches
        results = [self.graph.fresh() for _ in some]
        self.graph.nodes.append(
            helper.make_node("If", [condition.name], results, then_branch=first, else_branch=second)
        )
        names: dict[tuple[Size, Size], Size] = {}
        found = []
        for name, x, y in zip(results, some, others, strict=True):
            pairs = list(zip(x.shape, y.shape, strict=True))
            for pair in pairs:
                equal = same(*pair) or same(pair[1], 0)
                names[pair] = pair[0] if equal else names[pair] if pair in names else self.symbol()
            found.append(Array(self, name, [names[pair] for pair in pairs], x.dtype))
        return found

    def chosen(self, condition: Array, arrays: Sequence[Array]) -> list[Array]:
        """Of each array the entries at which a condition holds; their number is a size of its own."""
        names = [self.graph.add("Compress", [x.name, condition.name], axis=0)[0] for x in arrays]
        count = self.symbol(self.graph.outermost.add("Shape", [names[0]], start=0, end=1)[0])
        return [Array(self, name, [count, *x.shape[1:]], x.dtype) for name, x in zip(names, arrays, strict=True)]

    def _branch(self, made: Callable[[], Sequence[Array]]) -> tuple[Any, list[Array]]:
        outer, self.graph = self.graph, Graph(self.graph)
        arrays = list(made())
        names = self.graph.own([x.name for x in arrays])
        outputs = [info(name, x.dtype) for name, x in zip(names, arrays, strict=True)]
        proto, self.graph = self.graph.proto(f"branch_{outer.fresh()}", [], outputs), outer
        return proto, arrays

    def loop(
        self,
        times: int,
        state: Sequence[Array],
        body: Callable[[Any, Sequence[Array]], Sequence[Array]],
        stride: int | None = None,
    ) -> list[Array]:
        """A Loop of a fixed number of steps, `stride` or several a turn."""
        stride = stride or next(stride for stride in STRIDES if times % stride == 0)

        def turn(step: Array, arrays: Sequence[Array]) -> tuple[Sequence[Array], list[Array], None]:
            for i in range(stride):
                arrays = body(step * stride + i if stride > 1 else step, arrays)
            return arrays, [], None

        return self.repeat(self.graph.constant(times // stride, "int64"), state, turn)

    def loop_while(
        self,
        times: int,
        state: Sequence[Array],
        body: Callable[[Sequence[Array]], tuple[Sequence[Array], Array]],
        begin: Array | Any = True,
    ) -> list[Array]:
        """A Loop with a condition."""

        def turn(step: Array, arrays: Sequence[Array]) -> tuple[Sequence[Array], list[Array], Array]:
            arrays, go = body(arrays)
            return arrays, [], go

        return self.repeat(self.graph.constant(times, "int64"), state, turn, self.name(begin, "bool"))

    def each_block(self, function: Callable[[Array], Array], x: Array) -> Array:
        """A Loop over the first axis, which stacks its results."""

        def turn(step: Array, _: Sequence[Array]) -> tuple[list[Array], list[Array], None]:
            entry = self.node("Gather", x.shape[1:], x.name, step.name, axis=0)
            return [], [function(entry)], None

        (result,) = self.repeat(self.size(x.shape[0]), [], turn)
        result.shape = (x.shape[0], *result.shape[1:])
        return result

    def repeat(
        self,
        trips: str,
        state: Sequence[Array],
        body: Callable[[Array, Sequence[Array]], tuple[Sequence[Array], list[Array], Array | None]],
        begin: str | None = None,
    ) -> list[Array]:
        """A Loop: its last state, then the values that its steps stack along a new first axis.

        Args:
            trips: largest number of steps.
            state: before the first step, with its shapes.
            body: gives the next state, values to stack, and whether to go on (None: always).
            begin: whether to take a first step (None: yes).
        """
        begin = self.graph.constant(True, "bool") if begin is None else begin
        outer, self.graph = self.graph, Graph(self.graph)
        step, going, *names = (self.graph.fresh() for _ in range(2 + len(state)))
        arrays = [Array(self, name, x.shape, x.dtype) for name, x in zip(names, state, strict=True)]
        after, stacked, go = body(Array(self, step, (), "int64"), arrays)
        every = [*after, *stacked]
        condition, *outputs = self.graph.own([going if go is None else go.name, *(x.name for x in every)])
        inputs = [info(step, "int64", []), info(going, "bool", [])]
        inputs += [info(name, x.dtype) for name, x in zip(names, state, strict=True)]
        declared = [info(name, x.dtype) for name, x in zip(outputs, every, strict=True)]
        proto = self.graph.proto(f"body_{outer.fresh()}", inputs, [info(condition, "bool", []), *declared])
        self.graph = outer
        results = [self.graph.fresh() for _ in every]
        self.graph.nodes.append(
            helper.make_node("Loop", [trips, begin, *(x.name for x in state)], results, body=proto)
        )
        shapes = [*(x.shape for x in state), *((self.symbol(), *x.shape) for x in stacked)]
        return [Array(self, name, shape, x.dtype) for name, shape, x in zip(results, shapes, every, strict=True)]

    def whiten(self, sigma: Array, columns: Array, panel: int) -> tuple[Array, Array]:
        """L⁻¹ columns and ln det Σ."""
        white, log_det, _ = panels.whiten(self, sigma, columns, panel)
        return white, log_det

    def whiten_and_solve(self, sigma: Array, columns: Array) -> tuple[Array, Array, Callable[[], Array]]:
        """`whiten`, and a function that gives Σ⁻¹ columns."""
        return panels.whiten(self, sigma, columns, panels.PANEL)


def _shape(x: Any) -> tuple[Size, ...]:
    return x.shape if isinstance(x, Array) else np.shape(x)


def _kept(x: Array, axes: Sequence[int], keepdims: Any) -> list[Size]:
    """The shape of x without some axes, or with 1 in their place."""
    return [1 if i in axes else size for i, size in enumerate(x.shape) if keepdims or i not in axes]
