"""An ONNX graph under construction: nodes, constants and subgraphs over onnx.helper."""

from __future__ import annotations

from collections.abc import Sequence
from string import ascii_uppercase
from typing import Any

import numpy as np
import onnx
from numpy.typing import ArrayLike, NDArray
from onnx import TensorProto, helper, numpy_helper

KINDS = {"float64": TensorProto.DOUBLE, "int64": TensorProto.INT64, "bool": TensorProto.BOOL}
NUMPY = {"float64": np.float64, "int64": np.int64, "bool": np.bool_}


class Graph:
    """A graph, or the body of a Loop or a branch of an If, which may use its parent's values.

    Attributes:
        nodes: in the order of their making.
        made: outputs of each node by what it computes: equal nodes are made once.
    """

    def __init__(self, parent: Graph | None = None) -> None:
        self.parent = parent
        self.nodes: list[onnx.NodeProto] = []
        self.made: dict[Any, list[str]] = {}
        self.constants: dict[Any, str] = {} if parent is None else parent.constants
        self.initializers: list[onnx.TensorProto] = [] if parent is None else parent.initializers
        self.counter: list[int] = [0] if parent is None else parent.counter

    @property
    def outermost(self) -> Graph:
        """The graph that is no part of another one."""
        return self if self.parent is None else self.parent.outermost

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

    def constant(self, value: ArrayLike, dtype: str = "float64") -> str:
        """Name of a constant; equal ones are stored once, and a large identity is made in the graph."""
        array: NDArray[Any] = np.array(value, NUMPY[dtype], order="C")
        key = dtype, array.shape, array.tobytes()
        if key not in self.constants:
            if array.ndim == 2 and len(array) > 8 and np.array_equal(array, np.eye(*array.shape)):
                size = self.constant(np.array(array.shape), "int64")
                shaped = self.outermost.add("ConstantOfShape", [size])
                self.constants[key] = self.outermost.add("EyeLike", shaped, dtype=TensorProto.DOUBLE)[0]
            else:
                self.constants[key] = self.fresh()
                self.initializers.append(numpy_helper.from_array(array, self.constants[key]))
        return self.constants[key]

    def add(self, kind: str, inputs: Sequence[str], outputs: int = 1, **attributes: Any) -> list[str]:
        """Names of the outputs of a node; a graph around this one may have made the same."""
        key = kind, tuple(inputs), outputs, repr(sorted(attributes.items()))
        graph: Graph | None = self
        while graph is not None:
            if key in graph.made:
                return graph.made[key]
            graph = graph.parent
        self.made[key] = [self.fresh() for _ in range(outputs)]
        self.nodes.append(helper.make_node(kind, inputs, self.made[key], **attributes))
        return self.made[key]

    def own(self, names: Sequence[str]) -> list[str]:
        """Values as the outputs of this subgraph: made by nodes of its own, each of them once."""
        found: list[str] = []
        made = {name for node in self.nodes for name in node.output}
        for name in names:
            if name not in made or name in found:
                self.nodes.append(helper.make_node("Identity", [name], [self.fresh()]))
                name = self.nodes[-1].output[0]
            found.append(name)
        return found

    def proto(self, name: str, inputs: Sequence[Any], outputs: Sequence[Any]) -> onnx.GraphProto:
        """The graph as ONNX stores it, without the nodes that no output needs."""
        wanted = {output.name for output in outputs}
        nodes = _needed(self.nodes, wanted)
        constants = (
            [] if self.parent else [initializer for initializer in self.initializers if initializer.name in wanted]
        )
        return helper.make_graph(nodes, name, inputs, outputs, constants)


def info(name: str, dtype: str, shape: Sequence[str | int] | None = None) -> onnx.ValueInfoProto:
    """The declaration of an input or output."""
    return helper.make_tensor_value_info(name, KINDS[dtype], shape)


def _needed(nodes: Sequence[onnx.NodeProto], wanted: set[str]) -> list[onnx.NodeProto]:
    """The nodes that wanted values need; what these need is added to `wanted`."""
    kept = []
    for node in reversed(nodes):
        if wanted.isdisjoint(node.output):
            continue
        kept.append(node)
        wanted.update(node.input)
        for attribute in node.attribute:
            if attribute.HasField("g"):
                wanted.update(name for inner in attribute.g.node for name in _uses(inner))
                wanted.update(output.name for output in attribute.g.output)
    return kept[::-1]


def _uses(node: onnx.NodeProto) -> list[str]:
    """Names that a node and its subgraphs use."""
    inner = [each for a in node.attribute if a.HasField("g") for each in a.g.node]
    return [*node.input, *(name for each in inner for name in _uses(each))]
