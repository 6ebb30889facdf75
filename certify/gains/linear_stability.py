"""A necessary condition on given gains: the linearised loop of each agent at its steady state (theory.md section 7,
F20).

Where the linearisation does not depend on the exosystem it is decided exactly: an eigenvalue with a positive real part
makes the steady state unstable, at whatever parameters of the box it occurs. Where it does, it varies with time; then a
quadratic form that grows for every value in the exosystem's box proves instability, and frozen values prove nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from typing import Literal

import sympy

from certify.bounds.balls import NonFiniteError
from certify.bounds.rationals import log10_estimate, scientific
from certify.gains.frozen_loop import Frozen, FrozenLoops, TooManyError
from certify.gains.loop_matrix import plant_slopes
from certify.inequalities.instability import InstabilityProof, prove_instability
from certify.optimum import Optimum
from symbolic.controller import AgentController
from symbolic.plant import Agent, Interval
from symbolic.point_parameters import without_point_parameters
from symbolic.steady_state import SteadyState

Status = Literal["refuted", "passes", "inconclusive"]
Point = tuple[tuple[str, Fraction], ...]
_MOST_VERTICES = 1024
_MOST_ATTEMPTS = 4


@dataclass(frozen=True)
class LinearVerdict:
    """``refuted`` with a proof, ``passes`` (a necessary condition only, nothing is certified) or ``inconclusive``.

    ``determinant`` is the first Hurwitz determinant that is not positive, ``Δ_index`` of the monic characteristic
    polynomial at ``vertex`` (parameters, and exosystem values where it depends on them). With the other gains kept all
    determinants are positive at every vertex for every ``h >= smallest_h``, and not so at some ``h`` between
    ``largest_failing_h`` and there. ``growing_form`` proves the instability of a loop that varies with time.
    """

    status: Status
    reason: str
    vertex: Point | None = None
    determinant_index: int | None = None
    determinant: Fraction | None = None
    smallest_h: Fraction | None = None
    largest_failing_h: Fraction | None = None
    growing_form: InstabilityProof | None = None

    @property
    def log10_determinant(self) -> float | None:
        """``log10 |determinant|``, an estimate to be shown."""
        return None if not self.determinant else log10_estimate(self.determinant)


def necessary_condition(
    agent: Agent,
    controller: AgentController,
    steady_state: SteadyState,
    s_star: Fraction | Interval | Optimum,
    exosystem_box: Sequence[Interval],
    exosystem_states: Sequence[sympy.Symbol],
) -> LinearVerdict:
    """Decide whether the loop of one agent can be stable near its steady state with the controller's gains.

    ``exosystem_box`` holds the ``exosystem_states`` for all time. Where ``s_star`` is an interval, or a slope is
    irrational, the sign of a determinant must be certain on the whole enclosure. Raises ``ValueError`` when the shapes
    do not match.
    """
    agent = without_point_parameters(agent)
    _check_shapes(agent, controller, steady_state)
    slopes = plant_slopes(agent, steady_state)
    names = [name for name in agent.parameters if any(entry.has(name) for entry in slopes.entries)]
    box = dict(zip(agent.parameters, agent.parameter_box, strict=True))
    if 2 ** len(names) > _MOST_VERTICES:
        return LinearVerdict("inconclusive", f"the box of {len(names)} parameters has too many vertices to be tried")
    optimum = s_star.enclosure if isinstance(s_star, Optimum) else s_star
    disturbance = dict(zip(exosystem_states, exosystem_box, strict=True))
    loops = FrozenLoops(agent, controller, slopes, optimum, disturbance)
    try:
        frozen = [
            state
            for vertex in product(*((box[name].lo, box[name].hi) for name in names))
            for state in loops.at_vertex(dict(zip(names, vertex, strict=True)))
        ]
        return _verdict(loops, frozen)
    except (NonFiniteError, TooManyError) as error:
        return LinearVerdict("inconclusive", f"the linearised loop could not be evaluated: {error}")


def _check_shapes(agent: Agent, controller: AgentController, steady_state: SteadyState) -> None:
    n = agent.order
    if len(steady_state.z_star) != len(agent.zero_states):
        raise ValueError("the steady state must have one entry per zero state")
    if len(controller.gamma) != n - 1 or (n > 1 and len(controller.observer) != n):
        raise ValueError(f"a controller for an agent of order {n} is needed")
    if n > 1 and controller.h is None:
        raise ValueError("an agent of order 2 or more needs the observer gain h")


def _verdict(loops: FrozenLoops, frozen: Sequence[Frozen]) -> LinearVerdict:
    failures = [state for state in frozen if state.status == "unstable"]
    proof = None
    if not loops.varies_with_time:
        proved = failures[:1]
    else:
        proved = []
        for state in failures[:_MOST_ATTEMPTS]:
            found = prove_instability(loops.hull_vertices(state.parameters))
            if isinstance(found, InstabilityProof):
                proved, proof = [state], found
                break
    below, above, note = _threshold(loops, frozen)
    if proved:
        why = "an eigenvalue has a positive real part" if proof is None else "a quadratic form grows whatever v(t) is"
        reason = f"the steady state is unstable{_where(proved[0])}: {_determinant(proved[0])}, {why}{note}"
        return _with(proved[0], "refuted", reason, below, above, proof)
    if failures:
        place, size = _where(failures[0]), _determinant(failures[0])
        reason = (
            f"the loop frozen{place} is unstable, {size}, but v(t) moves and no growing quadratic form was found{note}"
        )
        return _with(failures[0], "inconclusive", reason, below, above, None)
    doubtful = [state for state in frozen if state.status != "stable"]
    if doubtful:
        reason = f"neither stable nor unstable for certain{_where(doubtful[0])}: {_determinant(doubtful[0])}{note}"
        return _with(doubtful[0], "inconclusive", reason, below, above, None)
    frozen_words = ", frozen at the vertices of the exosystem's box," if loops.varies_with_time else ""
    reason = (
        f"the linearised loop{frozen_words} is stable at every vertex of the parameter box; a necessary condition only"
    )
    return LinearVerdict("passes", reason, smallest_h=above, largest_failing_h=below)


def _with(
    state: Frozen,
    status: Status,
    reason: str,
    below: Fraction | None,
    above: Fraction | None,
    proof: InstabilityProof | None,
) -> LinearVerdict:
    point = tuple((str(name), value) for name, value in (*state.parameters.items(), *state.exosystem.items()))
    return LinearVerdict(status, reason, point, state.index, state.determinant, above, below, proof)


def _threshold(loops: FrozenLoops, frozen: Sequence[Frozen]) -> tuple[Fraction | None, Fraction | None, str]:
    """The observer gain from which on every frozen loop is stable, and a phrase about it."""
    if not loops.has_observer or not all(state.exact for state in frozen):
        return None, None, ""
    thresholds = [loops.threshold(state) for state in frozen]
    known = [threshold for threshold in thresholds if threshold is not None]
    if len(known) < len(thresholds):
        return None, None, "; no h is enough while the other gains are kept"
    below, above = max(threshold.below for threshold in known), max(threshold.above for threshold in known)
    frozen_words = "the frozen loops take" if loops.varies_with_time else "it takes"
    return below, above, f"; with the other gains kept {frozen_words} an h of about {scientific(above, 4)}"


def _where(state: Frozen) -> str:
    values = [f"{name} = {value}" for name, value in (*state.parameters.items(), *state.exosystem.items())]
    return f" at {', '.join(values)}" if values else ""


def _determinant(state: Frozen) -> str:
    return f"the Hurwitz determinant of order {state.index} is {scientific(state.determinant)}"
