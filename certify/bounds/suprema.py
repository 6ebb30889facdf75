"""Rigorous suprema of an expression over a box (theory.md section 5, last paragraph)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product

import sympy
from flint import ctx

from certify.bounds.balls import PRECISION, Program, compile_expression
from certify.bounds.branch_and_bound import Search
from symbolic.plant import Interval

DEFAULT_TOLERANCE = Fraction(1, 100)
DEFAULT_BOXES = 2000
_MOST_VERTICES = 256

Box = Mapping[sympy.Symbol, Interval]


@dataclass(frozen=True)
class Bound:
    """``value`` is proved to bound the expression on the box; at ``point`` the expression does reach ``attained``.

    For an upper bound ``attained <= sup <= value``, for a lower one ``value <= inf <= attained``. The point lists the
    symbols that occur (``dict(bound.point)``); ``boxes`` were examined.
    """

    value: Fraction
    attained: Fraction
    point: tuple[tuple[sympy.Symbol, Fraction], ...]
    boxes: int


@dataclass(frozen=True)
class RangeBound:
    """A proved lower and a proved upper bound of one expression."""

    lower: Bound
    upper: Bound

    @property
    def interval(self) -> Interval:
        return Interval(self.lower.value, self.upper.value)


def upper_bound(
    expression: sympy.Expr,
    box: Box,
    *,
    rtol: Fraction = DEFAULT_TOLERANCE,
    atol: Fraction = Fraction(0),
    max_boxes: int = DEFAULT_BOXES,
    floor: Fraction | None = None,
) -> Bound:
    """A proved upper bound of ``expression`` over ``box``.

    It is within ``rtol`` (relative) or ``atol`` of the supremum if ``max_boxes`` suffice, and looser if not. With a
    ``floor`` the search stops as soon as the bound is proved to be at most that. Symbols of the box that do not occur
    are ignored. Raises ``ValueError`` for what cannot be compiled (``balls.compile_expression``) or a missing symbol,
    and ``NonFiniteError`` when no finite bound is found: a pole is on the box, or an undefined value may be.
    """
    if not isinstance(expression, sympy.Expr):
        raise ValueError(f"{expression!r} is not a SymPy expression")
    names = tuple(sorted(expression.free_symbols, key=str))
    missing = [str(name) for name in names if name not in box]
    if missing:
        raise ValueError(f"the box says nothing about {', '.join(missing)}")
    if max_boxes < 1:
        raise ValueError("max_boxes must be positive")
    program = compile_expression(expression, names)
    sides = tuple(box[name] for name in names)
    vertices = _vertex_maximum(program, names, sides)
    if vertices is not None:
        return vertices
    with ctx.workprec(PRECISION):
        supremum = Search(expression, program, sides).run(rtol, atol, max_boxes, floor)
    return Bound(supremum.value, supremum.attained, tuple(zip(names, supremum.point, strict=True)), supremum.boxes)


def lower_bound(
    expression: sympy.Expr, box: Box, *, rtol: Fraction = DEFAULT_TOLERANCE, max_boxes: int = DEFAULT_BOXES
) -> Bound:
    """A proved lower bound of ``expression`` over ``box``; see ``upper_bound``."""
    bound = upper_bound(-expression, box, rtol=rtol, max_boxes=max_boxes)
    return Bound(-bound.value, -bound.attained, bound.point, bound.boxes)


def range_bound(
    expression: sympy.Expr, box: Box, *, rtol: Fraction = DEFAULT_TOLERANCE, max_boxes: int = DEFAULT_BOXES
) -> RangeBound:
    """Proved lower and upper bounds of ``expression`` over ``box``; see ``upper_bound``."""
    return RangeBound(
        lower_bound(expression, box, rtol=rtol, max_boxes=max_boxes),
        upper_bound(expression, box, rtol=rtol, max_boxes=max_boxes),
    )


def magnitude_bound(
    expression: sympy.Expr, box: Box, *, rtol: Fraction = DEFAULT_TOLERANCE, max_boxes: int = DEFAULT_BOXES
) -> Bound:
    """A proved upper bound of ``|expression|`` over ``box``; see ``upper_bound``."""
    above = upper_bound(expression, box, rtol=rtol, max_boxes=max_boxes)
    below = upper_bound(-expression, box, rtol=rtol, max_boxes=max_boxes, floor=above.value)
    larger = max(above, below, key=lambda bound: bound.attained)
    return Bound(max(above.value, below.value), larger.attained, larger.point, above.boxes + below.boxes)


def _vertex_maximum(program: Program, names: Sequence[sympy.Symbol], sides: Sequence[Interval]) -> Bound | None:
    """The exact maximum of a multi-affine polynomial with rational coefficients: it is reached at a vertex."""
    wide = [side for side in sides if not side.is_point]
    if any(
        degree is None or degree > 1 for degree, side in zip(program.degrees, sides, strict=True) if not side.is_point
    ):
        return None
    if 1 << len(wide) > _MOST_VERTICES:
        return None
    values: list[tuple[Fraction, tuple[Fraction, ...]]] = []
    for vertex in product(*((side.lo,) if side.is_point else (side.lo, side.hi) for side in sides)):
        value = program.exact(vertex)
        if value is None:
            return None
        values.append((value, vertex))
    best, point = max(values)
    return Bound(best, best, tuple(zip(names, point, strict=True)), len(values))
