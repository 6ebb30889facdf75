"""The linearised loop at fixed parameters and exosystem values, with its Hurwitz determinants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product

import sympy
from flint import arb

from certify.bounds.balls import NonFiniteError, lower, to_arb, upper
from certify.bounds.suprema import range_bound
from certify.gains.hurwitz_boundary import Threshold, enclosed_determinants, hurwitz_determinants, observer_threshold
from certify.gains.loop_matrix import PlantSlopes, assemble
from certify.inequalities.matrices import Matrix
from symbolic.controller import AgentController
from symbolic.plant import COST_VARIABLE, Agent, Interval

_MOST_CORNERS = 64
_TOLERANCE = Fraction(1, 10**6)

Values = Mapping[sympy.Symbol, Fraction]


class TooManyError(ArithmeticError):
    """More corners than are worth trying."""


@dataclass(frozen=True)
class Frozen:
    """``stable``: all determinants are positive; ``unstable``: one is negative; ``uncertain``: neither is proved.

    ``index`` and ``determinant`` are of the first one that is not proved positive (its upper bound where entries are
    only enclosed, ``exact = False``); for a stable loop they are of the last one.
    """

    parameters: Values
    exosystem: Values
    status: str
    index: int
    determinant: Fraction
    exact: bool


class FrozenLoops:
    """The loop of one agent with its controller, at the values that are asked for."""

    def __init__(
        self,
        agent: Agent,
        controller: AgentController,
        slopes: PlantSlopes,
        s_star: Fraction | Interval,
        exosystem_box: Mapping[sympy.Symbol, Interval],
    ) -> None:
        self.agent, self.controller, self.slopes = agent, controller, slopes
        if isinstance(s_star, Interval) and s_star.is_point:
            s_star = s_star.lo
        self.s_star = s_star
        free = set().union(*(entry.free_symbols for entry in slopes.entries))
        unknown = free - set(agent.parameters) - set(exosystem_box) - {COST_VARIABLE}
        if unknown:
            raise ValueError(f"no interval is given for {', '.join(sorted(map(str, unknown)))}")
        self.moving = [name for name in exosystem_box if name in free]
        self.exosystem_box = exosystem_box
        self._thresholds: dict[tuple[Fraction, ...], Threshold | None] = {}

    @property
    def varies_with_time(self) -> bool:
        return any(not self.exosystem_box[name].is_point for name in self.moving)

    @property
    def has_observer(self) -> bool:
        return self.agent.order > 1

    def at_vertex(self, parameters: Values) -> list[Frozen]:
        """The loop at one vertex of the parameter box, at every vertex of the exosystem's box that matters to it."""
        sides = [sorted({self.exosystem_box[name].lo, self.exosystem_box[name].hi}) for name in self.moving]
        if 2 ** len(self.moving) > _MOST_CORNERS:
            raise TooManyError(f"it depends on {len(self.moving)} exosystem states")
        return [self.frozen(parameters, dict(zip(self.moving, corner, strict=True))) for corner in product(*sides)]

    def frozen(self, parameters: Values, exosystem: Values) -> Frozen:
        """The determinants at one point, exact where the slopes are rational."""
        values = [self.value(entry, {**parameters, **exosystem}, {}) for entry in self.slopes.entries]
        exact = [value for value in values if isinstance(value, Fraction)]
        if len(exact) == len(values):
            matrix = assemble(self.agent, self.controller, exact).at(self.controller.h)
            minors = [Interval(minor, minor) for minor in hurwitz_determinants(matrix)]
        else:
            matrices = self.corner_matrices(values)
            minors = [Interval(lower(minor), upper(minor)) for minor in enclosed_determinants(_hull(matrices))]
        index = next((k for k, minor in enumerate(minors) if minor.lo <= 0), len(minors) - 1)
        if minors[index].lo > 0:
            status = "stable"
        else:
            status = "unstable" if any(minor.hi < 0 for minor in minors) else "uncertain"
        return Frozen(parameters, exosystem, status, index + 1, minors[index].hi, len(exact) == len(values))

    def threshold(self, state: Frozen) -> Threshold | None:
        """The observer gain from which on the loop is stable at this state, which must be an exact one."""
        values = [self.value(entry, {**state.parameters, **state.exosystem}, {}) for entry in self.slopes.entries]
        key = tuple(value for value in values if isinstance(value, Fraction))
        if key not in self._thresholds:
            self._thresholds[key] = observer_threshold(assemble(self.agent, self.controller, key))
        return self._thresholds[key]

    def hull_vertices(self, parameters: Values) -> list[Matrix]:
        """Matrices whose convex hull holds the loop for every value of the exosystem in its box."""
        box = {name: self.exosystem_box[name] for name in self.moving}
        return self.corner_matrices([self.value(entry, parameters, box) for entry in self.slopes.entries])

    def value(self, entry: sympy.Expr, at: Values, box: Mapping[sympy.Symbol, Interval]) -> Fraction | Interval:
        """A slope at a point, or its range over the exosystem's box and the enclosure of ``s*``.

        Raises ``NonFiniteError`` where it has a pole or cannot be enclosed.
        """
        known = dict(at)
        sides = dict(box)
        if isinstance(self.s_star, Interval):
            sides[COST_VARIABLE] = self.s_star
        else:
            known[COST_VARIABLE] = self.s_star
        numbers = {name: sympy.Rational(value.numerator, value.denominator) for name, value in known.items()}
        value = sympy.expand(entry.xreplace(numbers))
        if isinstance(value, sympy.Rational):
            return Fraction(int(value.p), int(value.q))
        try:
            return range_bound(value, sides, rtol=_TOLERANCE).interval
        except ValueError as error:
            raise NonFiniteError(str(error)) from error

    def corner_matrices(self, values: Sequence[Fraction | Interval]) -> list[Matrix]:
        """The loop is affine in each slope: its values at the corners of their ranges span all others."""
        sides = [(value,) if isinstance(value, Fraction) else (value.lo, value.hi) for value in values]
        if sum(len(side) > 1 for side in sides) > _MOST_CORNERS.bit_length() - 1:
            raise TooManyError("too many of its entries are not known exactly")
        return [assemble(self.agent, self.controller, corner).at(self.controller.h) for corner in product(*sides)]


def _hull(matrices: Sequence[Matrix]) -> list[list[arb]]:
    """The smallest intervals around the entries, as balls."""
    rows = range(len(matrices[0]))
    columns = [[[matrix[i][j] for matrix in matrices] for j in rows] for i in rows]
    return [[to_arb(Interval(min(entries), max(entries))) for entries in row] for row in columns]
