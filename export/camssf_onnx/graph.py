"""A thin layer over onnx.helper, so that code that builds a graph reads like algebra."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace
from string import ascii_uppercase
from typing import Any, TypeVar

import numpy as np
import onnx
from numpy.typing import ArrayLike, NDArray
from onnx import TensorProto, helper, numpy_helper

Product = TypeVar("Product")


class Graph:
    """A graph under construction. The body of a Loop is a Graph that may use its parent's values."""

    def __init__(self, name: str, parent: Graph | None = None) -> None:
        self.name = name
        self.parent = parent
        self.nodes: list[onnx.NodeProto] = []
        self.constants: dict[tuple[str, tuple[int, ...], bytes], str] = {} if parent is None else parent.constants
        self.initializers: list[onnx.TensorProto] = [] if parent is None else parent.initializers
        self.counter: list[int] = [0] if parent is None else parent.counter

    def fresh(self) -> str:
        """A short name that no other value has: long names would take a quarter of the file.

        A to Z, AA to ZZ, AAA ...: no input or output has a name in capitals.
        """
        self.counter[0] += 1
        number, name = self.counter[0], ""
        while number:
            number, letter = divmod(number - 1, 26)
            name = ascii_uppercase[letter] + name
        return name

    def constant(self, value: ArrayLike, dtype: type = np.float64, name: str | None = None) -> Value:
        """A constant; equal ones are stored once, and a large multiple of the identity is computed in the graph."""
        array: NDArray[Any] = np.ascontiguousarray(value, dtype=dtype).reshape(np.shape(value))
        key = (array.dtype.str, array.shape, array.tobytes())
        if key not in self.constants and array.ndim == 2 and len(array) > 8 and _scales_identity(array):
            outermost = self
            while outermost.parent is not None:
                outermost = outermost.parent
            if array[0, 0] == 1.0:
                size = outermost.op("ConstantOfShape", outermost.ints(*array.shape))
                made = outermost.op("EyeLike", size, dtype=TensorProto.DOUBLE)
            else:
                made = array[0, 0] * outermost.constant(np.eye(len(array)))
            self.constants[key] = made.name
        if key not in self.constants:
            self.constants[key] = name or self.fresh()
            self.initializers.append(numpy_helper.from_array(array, self.constants[key]))
        return Value(self, self.constants[key])

    def ints(self, *values: int) -> Value:
        """A vector of int64, for shapes and axes."""
        return self.constant(np.array(values), np.int64)

    def op(self, kind: str, *inputs: Value | ArrayLike, outputs: int = 1, **attributes: object) -> Value:
        """Add one node and return its first output; numbers become float64 constants."""
        found = self.ops(kind, *inputs, outputs=outputs, **attributes)
        return found[0]

    def ops(self, kind: str, *inputs: Value | ArrayLike, outputs: int = 1, **attributes: object) -> list[Value]:
        names = [value.name if isinstance(value, Value) else self.constant(value).name for value in inputs]
        results = [self.fresh() for _ in range(outputs)]
        self.nodes.append(helper.make_node(kind, names, results, **attributes))
        return [Value(self, name) for name in results]

    def loop(
        self,
        body: Callable[[Graph, Value, list[Value]], Body],
        state: Sequence[Value],
        kinds: Sequence[int],
        trips: Value,
        word: str,
        *,
        begin: Value | None = None,
    ) -> list[Value]:
        """Add a Loop and return its final state, then the stacked values of its steps.

        `body(graph, step, state)` gives a Body: the next state, values to stack, and whether to go on (None: always).
        `begin`: whether to take a first step at all (None: yes).
        """
        inner = Graph(f"{word}_{self.fresh()}", self)
        step, go_in = inner.fresh(), inner.fresh()
        names = [inner.fresh() for _ in state]
        after = body(inner, Value(inner, step), [Value(inner, name) for name in names])
        go = after.go or Value(inner, go_in)
        inputs = [
            helper.make_tensor_value_info(step, TensorProto.INT64, []),
            helper.make_tensor_value_info(go_in, TensorProto.BOOL, []),
            *(helper.make_tensor_value_info(n, kind, None) for n, kind in zip(names, kinds, strict=True)),
        ]
        outputs = [
            helper.make_tensor_value_info(go.name, TensorProto.BOOL, []),
            *(helper.make_tensor_value_info(v.name, kind, None) for v, kind in zip(after.state, kinds, strict=True)),
            *(helper.make_tensor_value_info(v.name, TensorProto.DOUBLE, None) for v in after.left),
        ]
        subgraph = helper.make_graph(inner.nodes, inner.name, inputs, outputs)
        start = begin or self.constant(np.array(True), np.bool_)
        results = [self.fresh() for _ in (*after.state, *after.left)]
        self.nodes.append(
            helper.make_node("Loop", [trips.name, start.name, *(v.name for v in state)], results, body=subgraph)
        )
        return [Value(self, name) for name in results]

    def choose(
        self,
        condition: Value,
        then: Callable[[Graph], Sequence[Value]],
        otherwise: Callable[[Graph], Sequence[Value]],
        word: str,
    ) -> list[Value]:
        """Add an If and return the values of its branches, float64 and as many in both."""
        branches = []
        for branch in (then, otherwise):
            inner = Graph(f"{word}_{self.fresh()}", self)
            # The outputs of a branch must come from its own nodes.
            given = [inner.op("Identity", value) for value in branch(inner)]
            infos = [helper.make_tensor_value_info(value.name, TensorProto.DOUBLE, None) for value in given]
            branches.append((helper.make_graph(inner.nodes, inner.name, [], infos), len(given)))
        (first, count), (second, other) = branches
        if count != other:
            raise ValueError(f"{word}: {count} values in one branch, {other} in the other")
        results = [self.fresh() for _ in range(count)]
        self.nodes.append(helper.make_node("If", [condition.name], results, then_branch=first, else_branch=second))
        return [Value(self, name) for name in results]


def _scales_identity(array: NDArray[Any]) -> bool:
    """Whether it is the identity times a number."""
    return np.array_equal(array, array[0, 0] * np.eye(*array.shape))


@dataclass(frozen=True)
class Body:
    """One step of a Loop: its next state (made by nodes of its own), values to stack, whether to go on."""

    state: list[Value]
    left: list[Value] = field(default_factory=list)
    go: Value | None = None


class Value:
    """A tensor by name; arithmetic makes nodes in the graph that uses it."""

    __array_ufunc__ = None  # so that NumPy leaves `array + value` to this class

    def __init__(self, graph: Graph, name: str) -> None:
        self.graph = graph
        self.name = name

    def __add__(self, other: Value | ArrayLike) -> Value:
        return self._in(other).op("Add", self, other)

    def __radd__(self, other: ArrayLike) -> Value:
        return self.graph.op("Add", other, self)

    def __sub__(self, other: Value | ArrayLike) -> Value:
        return self._in(other).op("Sub", self, other)

    def __rsub__(self, other: ArrayLike) -> Value:
        return self.graph.op("Sub", other, self)

    def __mul__(self, other: Value | ArrayLike) -> Value:
        return self._in(other).op("Mul", self, other)

    def __rmul__(self, other: ArrayLike) -> Value:
        return self.graph.op("Mul", other, self)

    def __truediv__(self, other: Value | ArrayLike) -> Value:
        return self._in(other).op("Div", self, other)

    def __rtruediv__(self, other: ArrayLike) -> Value:
        return self.graph.op("Div", other, self)

    def __matmul__(self, other: Value | ArrayLike) -> Value:
        return self._in(other).op("MatMul", self, other)

    def __neg__(self) -> Value:
        return self.graph.op("Neg", self)

    def _in(self, other: Value | ArrayLike) -> Graph:
        """The inner one of two graphs: a body may use its parent's values, not the reverse."""
        if isinstance(other, Value) and other.graph is not self.graph:
            graph: Graph | None = other.graph
            while graph is not None:
                if graph is self.graph:
                    return other.graph
                graph = graph.parent
        return self.graph

    def here(self, graph: Graph) -> Value:
        """The same tensor, for use in a body."""
        return Value(graph, self.name)

    def reshape(self, *shape: int) -> Value:
        return self.graph.op("Reshape", self, self.graph.ints(*shape))

    def like(self, shape: Value) -> Value:
        """Reshaped to a shape known at run time."""
        return self.graph.op("Reshape", self, shape)

    def transpose(self, *order: int) -> Value:
        return self.graph.op("Transpose", self, perm=list(order))

    def unsqueeze(self, *axes: int) -> Value:
        return self.graph.op("Unsqueeze", self, self.graph.ints(*axes))

    def squeeze(self, *axes: int) -> Value:
        return self.graph.op("Squeeze", self, self.graph.ints(*axes))

    def sum(self, *axes: int, keep: bool = False) -> Value:
        return self.graph.op("ReduceSum", self, self.graph.ints(*axes), keepdims=int(keep))

    def max(self, *axes: int, keep: bool = False) -> Value:
        return self.graph.op("ReduceMax", self, self.graph.ints(*axes), keepdims=int(keep))

    def min(self, *axes: int, keep: bool = False) -> Value:
        return self.graph.op("ReduceMin", self, self.graph.ints(*axes), keepdims=int(keep))

    def slice(self, start: int, stop: int, axis: int) -> Value:
        ints = self.graph.ints
        return self.graph.op("Slice", self, ints(start), ints(stop), ints(axis))

    def take(self, index: Value, axis: int) -> Value:
        return self.graph.op("Gather", self, index, axis=axis)

    def real(self) -> Value:
        return self.graph.op("Cast", self, to=TensorProto.DOUBLE)


def within(product: Product, graph: Graph) -> Product:
    """A dataclass of values, for use in a Loop's body; its field `graph`, if it has one, becomes that body."""
    names = [each.name for each in fields(product)]  # type: ignore[arg-type]
    seen: dict[str, object] = {
        name: value.here(graph) for name in names if isinstance(value := getattr(product, name), Value)
    }
    if "graph" in names:
        seen["graph"] = graph
    return replace(product, **seen)  # type: ignore[type-var]
