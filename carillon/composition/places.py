"""Places: below a plane, in a box, inside a closed surface, or where labels say so."""

from __future__ import annotations

import ast
import operator
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Flags, Surface
from carillon.errors import UserError
from carillon.fem.geometry.grid import bounding_grid
from carillon.fem.geometry.labels import Labels
from carillon.fem.geometry.winding import Winding

LONGEST_TEXT = 1000
"""Most characters of an expression."""
FINEST = 64
"""Cubes along the longest side of a closed surface, by which its triangles are divided."""


class Where(ABC):
    """Part of space."""

    @abstractmethod
    def contains(self, points: Array) -> Flags:
        """Which of the `points` (p, 3) [m] are in it."""


class Everywhere(Where):
    """All of space."""

    def contains(self, points: Array) -> Flags:
        return np.ones(len(points), dtype=bool)


@dataclass(frozen=True)
class Box(Where):
    """A box along the axes, its faces included."""

    low: Array
    high: Array
    """(3,) its corners [m]."""

    def contains(self, points: Array) -> Flags:
        return np.asarray(((points >= self.low) & (points <= self.high)).all(axis=1))


@dataclass(frozen=True)
class Ball(Where):
    """A ball about a point."""

    centre: Array
    """(3,) [m]."""
    radius: float
    """[m]."""

    def contains(self, points: Array) -> Flags:
        return np.asarray(((points - self.centre) ** 2).sum(axis=1) <= self.radius**2)


class ClosedSurface(Where):
    """The inside of a surface."""

    def __init__(self, surface: Surface) -> None:
        self._grid = bounding_grid(surface, FINEST)
        self._winding = Winding(surface, self._grid)
        self._bounds = np.asarray(surface.bounds)

    def contains(self, points: Array) -> Flags:
        low, high = self._bounds
        inside = ((points >= low) & (points <= high)).all(axis=1)
        chosen = np.flatnonzero(inside)
        if len(chosen):
            places = (points[chosen] - self._grid.origin) / self._grid.edge
            inside[chosen] = self._winding.inside(places)
        return np.asarray(inside)


@dataclass(frozen=True)
class Labelled(Where):
    """Where labels have one of some numbers."""

    labels: Labels
    numbers: tuple[int, ...]

    def contains(self, points: Array) -> Flags:
        return np.isin(self.labels.at(points), self.numbers)


@dataclass(frozen=True)
class Chosen(Where):
    """Where a function says so."""

    function: Callable[[Array], Any]
    """From points (p, 3) [m] to flags (p,)."""

    def contains(self, points: Array) -> Flags:
        flags = np.asarray(self.function(points))
        if flags.shape != (len(points),) or flags.dtype != bool:
            raise UserError(
                f"the function of a region returned an array of {flags.dtype} of shape "
                f"{flags.shape}, expected flags of shape ({len(points)},)"
            )
        return flags


_COMPARISONS: dict[type, Callable[..., Any]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}
_OPERATIONS: dict[type, Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
_OF_ONE: dict[str, Callable[..., Any]] = {
    name: getattr(np, name) for name in ("sqrt", "abs", "sin", "cos")
}
_OF_SEVERAL: dict[str, Callable[..., Any]] = {
    name: getattr(np, name) for name in ("hypot", "minimum", "maximum")
}
_EXAMPLE = '"z < 0.01", or "x > 0.1 and hypot(y, z) < 0.005"'


class Expression(Where):
    """Where an expression of x, y and z [m] holds: comparisons, and, or, not, + - * / ** and some
    functions.

    Raises UserError for anything else.

    Examples
    --------
    >>> place = Expression("0 <= x < 0.5 and not z > 1")
    >>> place.contains(np.array([[0.2, 0.0, 0.0], [0.7, 0.0, 0.0], [0.2, 0.0, 2.0]])).tolist()
    [True, False, False]
    """

    def __init__(self, text: str) -> None:
        self.text = text
        try:
            if len(text) > LONGEST_TEXT:
                raise SyntaxError
            tree = ast.parse(text.strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise self._refused("cannot be read") from None
        self._tree = tree
        if not isinstance(tree, (ast.Compare, ast.BoolOp, ast.UnaryOp)):
            raise self._refused("compares nothing")
        self._flags(tree, np.zeros((1, 3)))

    def contains(self, points: Array) -> Flags:
        with np.errstate(all="ignore"):
            flags = self._flags(self._tree, points)
        return np.broadcast_to(flags, (len(points),)).astype(bool)

    def _flags(self, node: ast.expr, points: Array) -> Any:
        match node:
            case ast.BoolOp(op=ast.And()):
                return np.logical_and.reduce([self._flags(each, points) for each in node.values])
            case ast.BoolOp():
                return np.logical_or.reduce([self._flags(each, points) for each in node.values])
            case ast.UnaryOp(op=ast.Not()):
                return np.logical_not(self._flags(node.operand, points))
            case ast.Compare():
                sides = [self._number(each, points) for each in (node.left, *node.comparators)]
                flags = np.ones(len(points), dtype=bool)
                for compared, left, right in zip(node.ops, sides[:-1], sides[1:], strict=True):
                    if type(compared) not in _COMPARISONS:
                        raise self._refused("compares by something else than <, <=, > and >=")
                    flags = flags & _COMPARISONS[type(compared)](left, right)
                return flags
        raise self._refused(f"has {ast.unparse(node)[:40]!r} where a comparison belongs")

    def _number(self, node: ast.expr, points: Array) -> Any:
        match node:
            case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
                return float(value)
            case ast.Name(id="x" | "y" | "z"):
                return points[:, "xyz".index(node.id)]
            case ast.Name(id="pi"):
                return np.pi
            case ast.BinOp() if type(node.op) in _OPERATIONS:
                sides = (self._number(each, points) for each in (node.left, node.right))
                with np.errstate(all="ignore"):
                    return _OPERATIONS[type(node.op)](*map(np.asarray, sides))
            case ast.UnaryOp() if type(node.op) in _OPERATIONS:
                return _OPERATIONS[type(node.op)](self._number(node.operand, points))
            case ast.Call(func=ast.Name(id=name), keywords=[]) if name in _OF_ONE | _OF_SEVERAL:
                given = [np.asarray(self._number(each, points)) for each in node.args]
                if (name in _OF_ONE) != (len(given) == 1) or not given:
                    raise self._refused(f"gives {name} {len(given)} numbers")
                with np.errstate(all="ignore"):
                    if name in _OF_ONE:
                        return _OF_ONE[name](given[0])
                    return reduce(_OF_SEVERAL[name], given)
        raise self._refused(f"has {ast.unparse(node)[:40]!r} where a number belongs")

    def _refused(self, reason: str) -> UserError:
        return UserError(
            f"{self.text[:60]!r} {reason}; expected comparisons of x, y and z [m], such as "
            f"{_EXAMPLE}"
        )


@dataclass(frozen=True)
class Uncovered(Where):
    """Where one of several regions is seen, which later ones may lie over."""

    placement: Placement
    number: int

    def contains(self, points: Array) -> Flags:
        return np.asarray(self.placement.at(points) == self.number)


class Placement:
    """Which of several regions places are of: the last one in their order that contains them."""

    def __init__(self, places: Sequence[Where]) -> None:
        self._places = tuple(places)

    def __len__(self) -> int:
        return len(self._places)

    def at(self, points: Array) -> NDArray[np.int32]:
        """Number (p,) of the region of each of the points (p, 3) [m]; -1 where there is none."""
        found = np.full(len(points), -1, dtype=np.int32)
        # The last one decides, so the others are asked for what is left.
        for number in range(len(self._places) - 1, -1, -1):
            left = np.flatnonzero(found < 0)
            if not len(left):
                break
            found[left[self._places[number].contains(points[left])]] = number
        return found
