"""Best-first branch and bound for the supremum of a program over a box.

Every box carries a proved upper bound, the smaller of the natural interval extension and the mean-value form. A
variable in which the expression is monotone moves to its better end; one in which it is affine or convex is only ever
split into its two ends, so that multi-affine and convex expressions are decided at vertices. The result is sound
whenever it stops.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import sympy
from flint import arb

from certify.bounds import ranges
from certify.bounds.balls import (
    PRECISION,
    NonFiniteError,
    Program,
    compile_expression,
    lower,
    to_arb,
    to_ends,
    upper,
)
from certify.bounds.ranges import Ends, Pair
from symbolic.plant import Interval


@dataclass(frozen=True)
class Supremum:
    """The supremum lies in ``[attained, value]``; ``attained`` is at most the value at ``point``."""

    value: Fraction
    attained: Fraction
    point: tuple[Fraction, ...]
    boxes: int


@dataclass(frozen=True)
class Node:
    """A box (monotone variables already at their better ends), its proved bound (``None``: infinite) and slopes."""

    bound: arb | None
    box: tuple[Pair, ...]
    slopes: tuple[Ends, ...]

    def __lt__(self, other: Node) -> bool:
        """Larger bounds come first."""
        return other.bound is not None and (self.bound is None or bool(self.bound > other.bound))


class Search:
    """Branch and bound for the supremum of one program over one box; runs at working precision."""

    def __init__(self, expression: sympy.Expr, program: Program, sides: Sequence[Interval]) -> None:
        self.expression = expression
        self.program = program
        self.sides = tuple(sides)
        self.root = tuple(pair for side in sides if (pair := to_ends(side)) is not None)
        self.true_ends = tuple((to_arb(side.lo), to_arb(side.hi)) for side in sides)
        self.is_point = tuple(side.is_point for side in sides)
        self.at_ends: tuple[bool, ...] | None = None
        self.best: arb | None = None
        self.best_point: tuple[arb, ...] = ()

    def run(self, rtol: Fraction, atol: Fraction, max_boxes: int, floor: Fraction | None) -> Supremum:
        relative, absolute = to_arb(rtol), to_arb(atol)
        enough = None if floor is None else to_arb(floor).lower()
        finished: list[arb] = []
        frontier = [self.node(self.root, None)]
        examined = 1
        while frontier and examined < max_boxes:
            bound = frontier[0].bound
            if bound is not None:
                bound = max([bound, *finished])
                if enough is not None and bound <= enough:
                    break
                if self.best is not None and bound - self.best <= (relative * abs(bound)).max(absolute):
                    break
            node = heapq.heappop(frontier)
            parts = self.split(node)
            if not parts and node.bound is None:
                raise NonFiniteError("the expression is unbounded or undefined at a point of the box")
            if not parts and node.bound is not None:
                finished.append(node.bound)
            for part in parts:
                heapq.heappush(frontier, self.node(part, node.bound))
            examined += len(parts)
        tops = [*finished, *(node.bound for node in frontier[:1])]
        if self.best is None or any(top is None for top in tops):
            raise NonFiniteError(
                f"no finite bound was found with {examined} boxes; a pole or an undefined value is near"
            )
        value = max(upper(top) for top in tops if top is not None)
        point = self.rational(self.best_point)
        exact = self.program.exact(point)
        return Supremum(value, lower(self.best) if exact is None else exact, point, examined)

    def node(self, box: tuple[Pair, ...], parent: arb | None) -> Node:
        """Bound one box, and sample it."""
        value, slopes = self.program.ends_and_slopes(box)
        reduced = self.toward_better_ends(box, slopes)
        while reduced != box:
            box = reduced
            value, slopes = self.program.ends_and_slopes(box)
            reduced = self.toward_better_ends(box, slopes)
        bounds = [] if parent is None else [parent]
        centre = self.sample(tuple(((low + high) / 2).mid() for low, high in box))
        self.sample(tuple(high if _rises(slope) else low for (low, high), slope in zip(box, slopes, strict=True)))
        if value is not None:
            bounds.append(value[1])
            if centre is not None and all(slope is not None for slope in slopes):
                bounds.append(self.mean_value(centre, box, slopes))
        return Node(min(bounds) if bounds else None, box, slopes)

    def toward_better_ends(self, box: tuple[Pair, ...], slopes: Sequence[Ends]) -> tuple[Pair, ...]:
        sides = list(box)
        for k, slope in enumerate(slopes):
            low, high = box[k]
            if slope is None or low == high:
                continue
            if slope[0] >= 0:
                sides[k] = (high, high)
            elif slope[1] <= 0:
                sides[k] = (low, low)
        return tuple(sides)

    def sample(self, point: Sequence[arb]) -> arb | None:
        """The value at a point that is truly inside the box; keeps the best one."""
        inside = [
            ends[0] if fixed or x == root[0] else ends[1] if x == root[1] else x
            for x, root, ends, fixed in zip(point, self.root, self.true_ends, self.is_point, strict=True)
        ]
        value = self.program(inside)
        if not value.is_finite():
            return None
        low = value.lower()
        if self.best is None or low > self.best:
            self.best, self.best_point = low, tuple(point)
        return value

    def rational(self, point: Sequence[arb]) -> tuple[Fraction, ...]:
        """A sampled point in exact coordinates."""
        return tuple(
            side.lo if side.is_point or x == root[0] else side.hi if x == root[1] else lower(x)
            for x, root, side in zip(point, self.root, self.sides, strict=True)
        )

    @staticmethod
    def mean_value(centre: arb, box: Sequence[Pair], slopes: Sequence[Ends]) -> arb:
        """``f(c) + Σ max|∂f/∂x_k| · max|x_k − c_k|``; the sampled centre may be off by the rounding of the ends."""
        total = centre
        for (low, high), slope in zip(box, slopes, strict=True):
            if slope is not None:
                steepest = ranges.absolute(slope)
                reach = (high - low) / 2 + (high.max(-low) * arb(2) ** (4 - PRECISION) if low != high else 0)
                total += reach * (steepest[1] if steepest is not None else 0)
        return total.upper()

    def split(self, node: Node) -> list[tuple[Pair, ...]]:
        """Two smaller boxes, or none when nothing is left to split."""
        choices = []
        for k, (low, high) in enumerate(node.box):
            middle = ((low + high) / 2).mid()
            if not self.is_point[k] and low < middle < high:
                choices.append((self.importance(k, node), k, middle))
        if not choices:
            return []
        _, k, middle = max(choices, key=lambda choice: (choice[0], -choice[1]))
        low, high = node.box[k]
        sides: tuple[Pair, Pair] = (
            ((low, low), (high, high)) if self.decided_at_ends(k) else ((low, middle), (middle, high))
        )
        return [(*node.box[:k], side, *node.box[k + 1 :]) for side in sides]

    def importance(self, k: int, node: Node) -> tuple[bool, float]:
        """Steepness times width; variables without a finite slope first, by width relative to the whole box."""
        low, high = node.box[k]
        slope = node.slopes[k]
        if slope is None or node.bound is None:
            return True, float((high - low) / (self.root[k][1] - self.root[k][0]))
        steepest = ranges.absolute(slope)
        weight = (high - low) * (steepest[1] if steepest is not None else 0)
        return False, float(weight.log().mid()) if weight > 0 else float("-inf")

    def decided_at_ends(self, k: int) -> bool:
        """Whether the expression is affine or convex in variable ``k`` over the whole box."""
        if self.at_ends is None:
            self.at_ends = tuple(self.is_convex(j) for j in range(len(self.root)))
        return self.at_ends[k]

    def is_convex(self, k: int) -> bool:
        degree = self.program.degrees[k]
        if degree is not None and degree <= 1:
            return True
        try:
            curvature = compile_expression(
                sympy.diff(self.expression, self.program.symbols[k], 2), self.program.symbols
            )
        except ValueError:
            return False
        ends = curvature.ends(self.root)
        return ends is not None and bool(ends[0] >= 0)


def _rises(slope: Ends) -> bool:
    return slope is None or bool(slope[0] + slope[1] >= 0)
