"""Sizes of traced arrays: numbers, and polynomials of the names of the inputs' axes, like 3·k·n or 1 + k·q."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

LOOSE = {"c", "e", "b"}
"""Axes that are as long as h, or 1."""


class Dim:
    """A size that is known at run time: the sum of products of names, with whole coefficients.

    Attributes:
        terms: coefficient by the sorted names of its product; () for the constant term.
    """

    def __init__(self, terms: Mapping[tuple[str, ...], int]) -> None:
        self.terms = {names: count for names, count in sorted(terms.items()) if count}

    def __add__(self, other: Size) -> Size:
        total = Counter(self.terms)
        for names, count in _terms(other).items():
            total[names] += count
        return _size(total)

    def __mul__(self, other: Size) -> Size:
        total: Counter[tuple[str, ...]] = Counter()
        for some, m in self.terms.items():
            for more, n in _terms(other).items():
                total[tuple(sorted(some + more))] += m * n
        return _size(total)

    def __sub__(self, other: Size) -> Size:
        return self + other * -1

    def __rsub__(self, other: Size) -> Size:
        return self * -1 + other

    __radd__, __rmul__ = __add__, __mul__

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Dim):
            raise TypeError(f"{self} is known at run time only: it cannot be compared with {other}")
        return self.terms == other.terms

    def __hash__(self) -> int:
        return hash(tuple(self.terms.items()))

    def __bool__(self) -> bool:
        raise TypeError(f"{self} is known at run time only: it has no truth")

    def __repr__(self) -> str:
        products = ("·".join([*([str(n)] if n != 1 or not names else []), *names]) for names, n in self.terms.items())
        return " + ".join(products)


Size = Dim | int


def same(one: Size, other: Size) -> bool:
    """Whether two sizes are certainly equal."""
    return isinstance(one, Dim) == isinstance(other, Dim) and one == other


def broadcast(*shapes: Sequence[Size]) -> tuple[Size, ...]:
    """The common shape of arrays.

    Raises:
        ValueError: sizes that differ and are not 1; an axis of LOOSE may only meet h.
    """
    rank = max(map(len, shapes))
    found: list[Size] = []
    for sizes in zip(*((1,) * (rank - len(shape)) + tuple(shape) for shape in shapes), strict=True):
        long = [size for size in sizes if not same(size, 1)]
        firm = [size for size in long if repr(size) not in LOOSE] or long
        if any(not same(size, firm[0]) for size in firm):
            raise ValueError(f"the shapes {', '.join(map(str, shapes))} do not fit together")
        if any(repr(size) in LOOSE and repr(firm[0]) not in {repr(size), "h"} for size in long):
            raise ValueError(f"the shapes {', '.join(map(str, shapes))} fit together only if {long[0]} is 1")
        found.append(firm[0] if firm else 1)
    return tuple(found)


def length(size: Size, key: slice) -> Size:
    """The size of a slice of an axis."""
    start, stop = 0 if key.start is None else key.start, key.stop
    if isinstance(size, int) and not any(isinstance(end, Dim) for end in (start, stop)):
        return len(range(*key.indices(size)))
    if key.step not in (None, 1):
        raise ValueError(f"an axis of size {size} cannot be sliced in steps")
    end: Any = size if stop is None else size + stop if isinstance(stop, int) and stop < 0 else stop
    begin = size + start if isinstance(start, int) and start < 0 else start
    return end - begin  # type: ignore[no-any-return]


def _terms(size: Size) -> Mapping[tuple[str, ...], int]:
    return size.terms if isinstance(size, Dim) else {(): int(size)}


def _size(terms: Mapping[tuple[str, ...], int]) -> Size:
    """A number if no name is left."""
    dim = Dim(terms)
    return dim if set(dim.terms) - {()} else dim.terms.get((), 0)
