"""What the recipe needs to know about one agent, and proved bounds of its Jacobians over boxes in the error
coordinates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property

import sympy

from certify.bounds.intervals import add
from certify.bounds.rationals import round_up, sqrt_up
from certify.bounds.suprema import lower_bound, magnitude_bound, range_bound
from certify.units.scales import Scales, unscaled
from symbolic.plant import COST_VARIABLE, Agent, Exosystem, Interval

Matrix = tuple[tuple[Fraction, ...], ...]
Row = tuple[Fraction, ...]


@dataclass(frozen=True)
class InternalModelData:
    """``M, N, T, Ψ = Γ T⁻¹`` and ``τ = (u*, L_S u*, …)``; everything is empty when there is no internal model."""

    ell: Row = ()
    M: Matrix = ()
    N: Row = ()
    T: Matrix = ()
    psi: Row = ()
    tau: tuple[sympy.Expr, ...] = ()

    @property
    def order(self) -> int:
        return len(self.N)


@dataclass(frozen=True)
class LyapunovMatrices:
    """``V0`` (empty without zero dynamics) with its ``a0``, ``P1`` (``n − 1``), ``P2`` (internal model), ``P3``
    (``n``, observer)."""

    V0: Matrix
    a0: Fraction
    P1: Matrix
    P2: Matrix
    P3: Matrix


@dataclass(frozen=True)
class References:
    """The coordinator as one agent sees it: ``|y^r − s*| ≤ peak``, ``∫(y^r − s*)² ≤ energy``,
    ``∫(ẏ^r)² ≤ rate_energy``."""

    peak: Fraction
    energy: Fraction
    rate_energy: Fraction


@dataclass(frozen=True)
class Sublevel:
    """Magnitudes of the blocks on ``{W ≤ C}``: ``|z̄_k|``, ``|x̂_k|``, ``|η̃_k|`` and ``|ϑ|``."""

    z: Row
    x_hat: Row
    eta: Row
    vartheta: Fraction


@dataclass(frozen=True)
class AgentModel:
    """One agent with its steady state, internal model, design polynomials and the sets its exogenous variables live in.

    ``steady_state`` is ``z*`` in ``(s, v, parameters)``; ``optimum`` encloses ``s*``; ``disturbance`` encloses every
    ``v(t)``, ``|g·v(t)|² ≤ gᵀ extent g`` for every row ``g``, and ``exosystem.initial`` encloses every ``v(0)``.
    ``roots`` has an interval for every component of ``z*`` that has no closed form: in ``steady_state`` a parameter of
    ``agent`` stands for it (``bounds.roots``). ``scales`` are the units that all of it is in, ``None`` for those of the
    plant file.
    """

    agent: Agent
    exosystem: Exosystem
    steady_state: tuple[sympy.Expr, ...]
    internal_model: InternalModelData
    gamma: Row
    observer: Row
    optimum: Interval
    disturbance: tuple[Interval, ...]
    extent: Matrix
    references: References
    scales: Scales | None = None
    roots: tuple[Interval | None, ...] = ()
    _cache: dict[tuple[object, ...], Fraction] = field(default_factory=dict, compare=False, repr=False)

    @property
    def order(self) -> int:
        return self.agent.order

    @property
    def units(self) -> Scales:
        """``scales``, with ones for those of the plant file."""
        return self.scales or unscaled(self.order, len(self.agent.zero_states))

    @cached_property
    def exogenous_box(self) -> dict[sympy.Symbol, Interval]:
        """``s``, ``v`` and the parameters."""
        box = {COST_VARIABLE: self.optimum}
        box.update(zip(self.exosystem.states, self.disturbance, strict=True))
        box.update(zip(self.agent.parameters, self.agent.parameter_box, strict=True))
        return box

    @cached_property
    def initial_exogenous_box(self) -> dict[sympy.Symbol, Interval]:
        """The same with ``v(0)`` in place of ``v(t)``."""
        return {**self.exogenous_box, **dict(zip(self.exosystem.states, self.exosystem.initial, strict=True))}

    @cached_property
    def steady_range(self) -> tuple[Interval, ...]:
        """An enclosure of ``z*`` for all time."""
        return tuple(range_bound(component, self.exogenous_box).interval for component in self.steady_state)

    @cached_property
    def reference_range(self) -> Interval:
        """An enclosure of ``y^r``."""
        return add(self.optimum, _symmetric(self.references.peak))

    @cached_property
    def input_gain(self) -> Interval:
        """``[b_min, b_max]`` on ``W``."""
        box = dict(zip(self.agent.parameters, self.agent.parameter_box, strict=True))
        return Interval(lower_bound(self.agent.b, box).value, magnitude_bound(self.agent.b, box).value)

    def feedback_row(self, g: Fraction) -> Row:
        """``g^(n−1) γ_k`` for ``k < n``: ``x̄_n = ϑ − Σ g^(n−1) γ_k x̂_k``."""
        return tuple(g ** (self.order - 1) * gamma for gamma in self.gamma)

    def box(self, level: Sublevel, g: Fraction) -> dict[sympy.Symbol, Interval]:
        """The original states ``z, x`` with ``s, v, w`` over all error coordinates in ``level``."""
        box = dict(self.exogenous_box)
        for state, steady, bound in zip(self.agent.zero_states, self.steady_range, level.z, strict=True):
            box[state] = add(steady, _symmetric(bound))
        n, chain = self.order, self.agent.chain
        for k in range(1, n):
            box[chain[k - 1]] = _symmetric(g ** (k - 1) * level.x_hat[k - 1])
        feedback = sum((a * x for a, x in zip(self.feedback_row(g), level.x_hat, strict=True)), Fraction(0))
        box[chain[n - 1]] = _symmetric(level.vartheta + feedback)
        box[chain[0]] = add(box[chain[0]], self.reference_range)
        return box

    def reference_box(self) -> dict[sympy.Symbol, Interval]:
        """``z = z*``, ``x = (y^r, 0, …)``: the states the increments in ``y^r`` are taken at."""
        flat = Sublevel(
            (Fraction(0),) * len(self.agent.zero_states), (Fraction(0),) * (self.order - 1), (), Fraction(0)
        )
        return self.box(flat, Fraction(1))

    @cached_property
    def _gradient(self) -> dict[sympy.Symbol, sympy.Expr]:
        return {x: sympy.expand(sympy.diff(self.agent.f, x)) for x in (*self.agent.zero_states, *self.agent.chain)}

    def zero_slope(self, box: Mapping[sympy.Symbol, Interval]) -> Fraction:
        """``‖∂f1/∂z‖`` on a box; 0 without zero dynamics."""
        return self._norm([self._gradient[z] for z in self.agent.zero_states], box)

    def chain_slope(self, box: Mapping[sympy.Symbol, Interval], g: Fraction, *, with_design: bool) -> Fraction:
        """``‖∂f̂/∂x̂‖`` at fixed ``ϑ`` (``with_design``), or ``‖∂f̄1/∂x̂‖``, on a box; 0 for ``n = 1``."""
        n, gamma, chain = self.order, self.gamma, self.agent.chain
        entries = []
        for k in range(1, n):
            entry = _rational(g ** (k - 1)) * self._gradient[chain[k - 1]]
            entry -= _rational(g ** (n - 1) * gamma[k - 1]) * self._gradient[chain[n - 1]]
            if with_design:
                linear = -(g**n) * gamma[n - 2] * gamma[k - 1] + (g**n * gamma[k - 2] if k >= 2 else 0)
                entry += _rational(linear)
            entries.append(entry)
        return self._norm(entries, box)

    def last_slope(self, box: Mapping[sympy.Symbol, Interval]) -> Fraction:
        """``|∂f1/∂x_n|`` on a box."""
        return self._norm([self._gradient[self.agent.chain[-1]]], box)

    def output_slope(self) -> Fraction:
        """``ς_f = |∂f1/∂x1|`` along the reference."""
        return self._norm([self._gradient[self.agent.chain[0]]], self.reference_box())

    def zero_input_slope(self, box: Mapping[sympy.Symbol, Interval]) -> Fraction:
        """``‖∂f0/∂x1‖`` on a box (``ς2``; ``ς3`` on the reference box)."""
        return self._norm([sympy.diff(f0, self.agent.chain[0]) for f0 in self.agent.zero_dynamics], box)

    def _norm(self, entries: Sequence[sympy.Expr], box: Mapping[sympy.Symbol, Interval]) -> Fraction:
        return euclidean_norm([self._magnitude(entry, box) for entry in entries])

    def _magnitude(self, entry: sympy.Expr, box: Mapping[sympy.Symbol, Interval]) -> Fraction:
        relevant = tuple(sorted(((x.name, box[x]) for x in entry.free_symbols), key=lambda item: item[0]))
        key = (entry, *((name, side.lo, side.hi) for name, side in relevant))
        if key not in self._cache:
            self._cache[key] = magnitude_bound(entry, box).value
        return self._cache[key]


def euclidean_norm(entries: Sequence[Fraction]) -> Fraction:
    """A rational upper bound of the Euclidean norm of a vector."""
    return sqrt_up(sum((entry * entry for entry in entries), Fraction(0)))


def quadratic_form_bound(matrix: Matrix, magnitudes: Sequence[Fraction]) -> Fraction:
    """``Σ |P_jk| m_j m_k ≥ xᵀPx`` for all ``|x_k| ≤ m_k``."""
    pairs = (
        (abs(p), m, o) for row, m in zip(matrix, magnitudes, strict=True) for p, o in zip(row, magnitudes, strict=True)
    )
    return round_up(sum((p * m * o for p, m, o in pairs), Fraction(0)))


def row_sum_norm(matrix: Matrix) -> Fraction:
    """``max_j Σ_k |P_jk|``, an upper bound of the largest eigenvalue of a symmetric matrix; 0 for an empty one."""
    return max((sum((abs(entry) for entry in row), Fraction(0)) for row in matrix), default=Fraction(0))


def _symmetric(bound: Fraction) -> Interval:
    return Interval(-bound, bound)


def _rational(value: Fraction | int) -> sympy.Rational:
    value = Fraction(value)
    return sympy.Rational(value.numerator, value.denominator)
