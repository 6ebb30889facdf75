"""The regulator equation ``∂z*/∂v · S v = f0(z*, s, v, w)``, ``z*(0, 0, w) = 0`` (theory.md section 2, A3)."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import sympy

from symbolic.identity import zero_test
from symbolic.plant import COST_VARIABLE, Agent, Exosystem
from symbolic.point_parameters import without_point_parameters
from symbolic.regulator_obstacles import pole, resonance
from symbolic.steady_state import (
    NoSteadyState,
    SteadyState,
    parameter_box,
    proved,
    right_hand_side,
    root_symbol,
    steady_input,
    verified,
)
from symbolic.steady_state_series import Inconsistent, NotFound, Outcome, RegulatorProblem

__all__ = ["NoSteadyState", "SteadyState", "solve_regulator"]


@lru_cache(maxsize=256)  # the assumptions and the derivation ask for the same
def solve_regulator(agent: Agent, exosystem: Exosystem) -> SteadyState | NoSteadyState:
    """Verifies the user's ``steady_state``, or finds z* by matching polynomials in v or in (s, v) up to degree 8.

    A solution counts only after its residual is proved to vanish identically and its denominators to have no zero on
    the parameter box. Raises ``InputError`` if the user's expressions use names other than s, v and the parameters.
    """
    agent = without_point_parameters(agent)
    if not agent.zero_states:
        return SteadyState((), steady_input(agent, ()), "none")
    origin = dict.fromkeys((*agent.zero_states, COST_VARIABLE, *exosystem.states), sympy.Integer(0))
    for name, expr in zip(agent.zero_states, right_hand_side(agent), strict=True):
        at_origin = zero_test(expr.xreplace(origin), parameter_box(agent))
        if at_origin.verdict == "fails":
            return NoSteadyState(
                "fails",
                f"f0(0, 0, 0, w) is not 0 in the equation of {name}, so z*(0, 0, w) = 0 is impossible",
                {"equation": str(name), **at_origin.at},
            )
    if agent.steady_state is None:
        return _searched(agent, exosystem)
    answer = verified(agent, exosystem, agent.steady_state)
    if isinstance(answer, SteadyState):
        return answer
    found = _searched(agent, exosystem)
    hint = (
        {f"{name}* found": str(z) for name, z in zip(agent.zero_states, found.z_star, strict=True)}
        if isinstance(found, SteadyState)
        else {}
    )
    return NoSteadyState(answer.verdict, answer.reason, {**answer.evidence, **hint})


def _searched(agent: Agent, exosystem: Exosystem) -> SteadyState | NoSteadyState:
    """All components at once if f0 is affine in z (then the search decides), otherwise block by block."""
    box = parameter_box(agent)
    problem = _problem(agent.zero_states, right_hand_side(agent), exosystem, linear=True)
    outcome = problem.solve()
    if isinstance(outcome, NotFound):
        return _by_blocks(agent, exosystem)
    if isinstance(outcome, Inconsistent):
        return resonance(problem, outcome, box)
    return pole(problem, outcome, box) or _accepted(agent, exosystem, outcome.z_star)


def _by_blocks(agent: Agent, exosystem: Exosystem) -> SteadyState | NoSteadyState:
    """Solves the zero dynamics along their dependence, each block after those it depends on."""
    z, f0, box = agent.zero_states, right_hand_side(agent), parameter_box(agent)
    known: dict[sympy.Symbol, sympy.Expr] = {}
    roots: list[sympy.Symbol] = []
    for block in _blocks(z, f0):
        tried: list[str] = []
        equations = tuple(f0[z.index(name)].xreplace(known) for name in block)
        unsolved = [name for name in roots if any(f.has(root_symbol(name)) for f in equations)]
        if unsolved:
            return NoSteadyState(
                "unknown",
                f"the equation of {block[0]} depends on {unsolved[0]}, whose steady state has no closed form: "
                "give steady_state",
            )
        problem, outcome = _solved_block(block, equations, exosystem, tried)
        if isinstance(outcome, NotFound) and _is_root(block, equations, agent):
            roots.append(block[0])
            known[block[0]] = root_symbol(block[0])
            continue
        if isinstance(outcome, NotFound):
            names = ", ".join(str(name) for name in block)
            return NoSteadyState(
                "unknown",
                f"no steady state of {names} was found: give steady_state",
                {f"try {k}": what for k, what in enumerate(tried, 1)},
            )
        if isinstance(outcome, Inconsistent):
            obstacle: NoSteadyState | None = resonance(problem, outcome, box)
        else:
            obstacle = pole(problem, outcome, box)
            known |= dict(zip(block, outcome.z_star, strict=True))
        if obstacle is not None:
            first = not any(f0[z.index(name)].has(*set(z) - set(block)) for name in block)
            return (
                obstacle
                if first
                else NoSteadyState("unknown", f"for the part of z* found before, {obstacle.reason}", obstacle.evidence)
            )
    return _accepted(agent, exosystem, tuple(known[name] for name in z), tuple(roots))


def _is_root(block: tuple[sympy.Symbol, ...], equations: tuple[sympy.Expr, ...], agent: Agent) -> bool:
    """One component that the consensus value and the parameters alone drive rests at a zero of its ``f0``."""
    return len(block) == 1 and equations[0].free_symbols <= {*block, COST_VARIABLE, *agent.parameters}


def _accepted(
    agent: Agent, exosystem: Exosystem, z_star: tuple[sympy.Expr, ...], roots: tuple[sympy.Symbol, ...] = ()
) -> SteadyState | NoSteadyState:
    """The last word on what the search has found is the residual in the original equations."""
    answer = proved(agent, exosystem, z_star, "root" if roots else "ansatz", roots)
    if isinstance(answer, SteadyState):
        return answer
    return NoSteadyState("unknown", f"the ansatz gave an expression of which {answer.reason}", answer.evidence)


def _problem(
    z: tuple[sympy.Symbol, ...], f0: tuple[sympy.Expr, ...], exosystem: Exosystem, *, linear: bool
) -> RegulatorProblem:
    variables = exosystem.states if linear else (COST_VARIABLE, *exosystem.states)
    return RegulatorProblem(z, f0, variables, exosystem.states, exosystem.S, linear)


def _solved_block(
    block: tuple[sympy.Symbol, ...], equations: tuple[sympy.Expr, ...], exosystem: Exosystem, tried: list[str]
) -> tuple[RegulatorProblem, Outcome]:
    """Polynomials in v, then in (s, v); what did not work is added to ``tried``."""
    linear = _problem(block, equations, exosystem, linear=True)
    outcome = linear.solve()
    if not isinstance(outcome, NotFound):
        return linear, outcome
    tried.append(f"polynomials in v: {outcome.reason}")
    graded = _problem(block, equations, exosystem, linear=False)
    outcome = graded.solve()
    if isinstance(outcome, NotFound):
        tried.append(f"polynomials in (s, v): {outcome.reason}")
    return graded, outcome


def _blocks(z: tuple[sympy.Symbol, ...], f0: tuple[sympy.Expr, ...]) -> Iterator[tuple[sympy.Symbol, ...]]:
    if len(z) < 2:
        yield from [z] if z else []
        return
    import networkx

    graph = networkx.DiGraph()
    graph.add_nodes_from(z)
    graph.add_edges_from((other, name) for name, expr in zip(z, f0, strict=True) for other in z if expr.has(other))
    condensed = networkx.condensation(graph)
    members = {block: sorted(condensed.nodes[block]["members"], key=z.index) for block in condensed}
    for block in networkx.lexicographical_topological_sort(condensed, key=lambda b: z.index(members[b][0])):
        yield tuple(members[block])
