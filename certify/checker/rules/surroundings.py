"""What acts on one agent from outside, in time: the exosystem, the reference, and the steady state they imply.

See "Time data" in section 3 of docs/certificate-direct.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache, partial
from itertools import product

from flint import arb_mat, fmpq

from certify.checker import functions, linear
from certify.checker.balls import BITS, exact, interval, precision
from certify.checker.derivatives import gradient
from certify.checker.expressions import Node, evaluate, names_in
from certify.checker.intervals import Interval, between, enclose, hull, quadratic_bound, symmetric, total
from certify.checker.linear import Matrix
from certify.checker.plant import Box
from certify.checker.rules.reference import Range, Reference
from certify.checker.verdict import Undecided, spend

PARTS, FINE_PARTS = (1, 8, 4, 2), (1, 64, 12, 3)  # of a parameter of z*, by how many there are; the last for more
MOST_CUT = 6  # parameters


@dataclass(frozen=True)
class Surroundings:
    """Enclosures of ``v``, ``y^r`` and ``z*`` during some time; ``|y^r − s*| ≤ distance``, ``|ẏ^r| ≤ speed``."""

    v: Mapping[str, Interval]
    steady_state: tuple[Interval, ...]
    y: Interval
    distance: Interval
    speed: Interval


class Exosystem:
    """``v(t) ∈ e^(St) V0``, and ``|v_k(t)| ≤ v̂_k``, ``v vᵀ ⪯ W`` for all time."""

    def __init__(self, S: Matrix, Q: Matrix, at_start: Mapping[str, Interval], forever: Mapping[str, Interval]) -> None:
        """``Q`` is already known to be kept."""
        self.S, self.at_start, self.forever = S, at_start, forever
        energy = quadratic_bound(Q, list(at_start.values()))
        self.W = [[(energy * entry).magnitude for entry in row] for row in linear.inverse(Q)]
        sizes = [v.magnitude for v in forever.values()]
        self.bend = (
            [
                total(abs(entry) * size for entry, size in zip(row, sizes, strict=True)).upper
                for row in linear.product(self.S, self.S)
            ]
            if self.S
            else []
        )
        self.at = lru_cache(maxsize=4)(self._at)

    def _at(self, t: Fraction) -> list[Interval]:
        spend(2_000 * (1 + len(self.S) ** 3))
        with precision(BITS):
            flow = arb_mat(exact(self.S) * fmpq(t.numerator, t.denominator)).exp().tolist()
        v = self.at_start.values()
        return [total(interval(entry) * start for entry, start in zip(row, v, strict=True)) for row in flow]

    def during(self, start: Fraction, end: Fraction) -> dict[str, Interval]:
        """Between its values at both ends, up to ``(end − start)²/8·|v''|``, ``v'' = S²v``."""
        if not self.S:
            return {}
        result = {}
        rows = zip(self.forever.items(), self.at(start), self.at(end), self.bend, strict=True)
        for (name, limit), a, b, bend in rows:
            chord = hull(a, b) + symmetric((end - start) ** 2 / 8 * bend)
            result[name] = common(chord, limit)
        return result


class Outside:
    """The surroundings of one agent, as functions of time."""

    def __init__(
        self,
        exosystem: Exosystem,
        reference: Reference,
        nodes: Sequence[Node],
        parameters: Mapping[str, Box],
        roots: Mapping[str, Interval],
    ) -> None:
        """``nodes`` are ``z*`` in ``s, v``, the parameters and the constants ``roots``."""
        self.exosystem, self.reference = exosystem, reference
        self.around = {"s": reference.optimum, **roots}
        self.nodes = [(node, _pieces(node, parameters, PARTS)) for node in nodes]
        self.fine = [(node, _pieces(node, parameters, FINE_PARTS)) for node in nodes]
        self.until = lru_cache(maxsize=None)(partial(self.during, Fraction(0)))

    def during(self, start: Fraction, end: Fraction) -> Surroundings:
        v = self.exosystem.during(start, end)
        box = {**self.around, **v}
        z = [hull(*(_value(node, {**box, **piece}) for piece in pieces)) for node, pieces in self.nodes]
        return self._around(v, z, self.reference.during(start, end))

    def in_tail(self) -> Surroundings:
        v = self.exosystem.forever
        z = [hull(*(self._steady_forever(node, piece) for piece in pieces)) for node, pieces in self.fine]
        return self._around(v, z, self.reference.tail())

    def _around(self, v: Mapping[str, Interval], z: Sequence[Interval], found: Range) -> Surroundings:
        return Surroundings(v, tuple(z), found.y, found.distance, found.speed)

    def _steady_forever(self, node: Node, piece: Mapping[str, Interval]) -> Interval:
        """By ``±v̂``, and by ``z*(s, 0, w) ± √(Σ_jk |W_jk| ĝ_j ĝ_k)``."""
        box = {**self.around, **self.exosystem.forever, **piece}
        at_zero = _value(node, {**box, **dict.fromkeys(self.exosystem.forever, Interval(0, 0))})
        sizes = [entry.magnitude for entry in gradient(node, box, self.exosystem.forever).values()]
        square = total(
            W * a * b for row, a in zip(self.exosystem.W, sizes, strict=True) for W, b in zip(row, sizes, strict=True)
        )
        return common(_value(node, box), at_zero + symmetric(square.upper.sqrt()))


def common(x: Interval, y: Interval) -> Interval:
    """The common part of two enclosures of one number."""
    lo, hi = max(x.lower, y.lower), min(x.upper, y.upper)
    if lo > hi:
        raise Undecided(f"the enclosures {x} and {y} of one number have nothing in common")
    return hull(lo, hi)


def _value(node: Node, box: Mapping[str, Interval]) -> Interval:
    value: Interval = evaluate(node, box, enclose, functions.call)
    return value


def _pieces(node: Node, parameters: Mapping[str, Box], by_count: Sequence[int]) -> list[dict[str, Interval]]:
    """The box of the parameters, cut into equal parts along those that occur in ``node``."""
    whole = {name: between(*box) for name, box in parameters.items()}
    cut = sorted(name for name in names_in(node) & whole.keys() if parameters[name][0] < parameters[name][1])[:MOST_CUT]
    parts = by_count[min(len(cut), 3)]
    choices = []
    for name in cut:
        lo, width = parameters[name][0], parameters[name][1] - parameters[name][0]
        choices.append([between(lo + width * k / parts, lo + width * (k + 1) / parts) for k in range(parts)])
    return [{**whole, **dict(zip(cut, choice, strict=True))} for choice in product(*choices)]
