"""What a steady state is, and the proof that given expressions are one (theory.md section 2, A3)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import sympy

from symbolic.errors import InputError
from symbolic.identity import MAX_OPERATIONS, Box, excerpt, normal_form, zero_test
from symbolic.plant import COST_VARIABLE, Agent, Exosystem
from symbolic.ranges import as_range, enclosure, nonvanishing

_SMOOTH_EVERYWHERE = (sympy.exp, sympy.sin, sympy.cos, sympy.tanh, sympy.sinh, sympy.cosh, sympy.atan)


@dataclass(frozen=True)
class SteadyState:
    """``z*(s, v, w)``, one entry per zero state, and ``u*(s, v, w) = −f(z*, s, 0, v, w)/b(w)``, as exact expressions.

    ``source``: ``none`` (no zero dynamics), ``ansatz`` (found here), ``user`` (given, and proved to be one) or
    ``root``: the components of ``roots`` have no closed form, and ``root_symbol`` stands for the only zero of their
    ``f0``.
    Parameters whose interval is a single point are replaced by their value.
    """

    z_star: tuple[sympy.Expr, ...]
    u_star: sympy.Expr
    source: str
    roots: tuple[sympy.Symbol, ...] = ()


@dataclass(frozen=True)
class NoSteadyState:
    """``fails`` with a proof (the monomial and the parameter point), or ``unknown`` with what was tried."""

    verdict: str
    reason: str
    evidence: Mapping[str, str] = field(default_factory=dict)


def root_symbol(z: sympy.Symbol) -> sympy.Symbol:
    """What stands for ``z*`` where it has no closed form; no name of a user's holds an asterisk."""
    return sympy.Symbol(f"{z}*", real=True)


def parameter_box(agent: Agent) -> Box:
    return dict(zip(agent.parameters, agent.parameter_box, strict=True))


def right_hand_side(agent: Agent) -> tuple[sympy.Expr, ...]:
    """``f0(z, s, v, w)``: the zero dynamics driven by the consensus value."""
    return tuple(expr.xreplace({agent.chain[0]: COST_VARIABLE}) for expr in agent.zero_dynamics)


def regulator_residuals(agent: Agent, exosystem: Exosystem, z_star: tuple[sympy.Expr, ...]) -> tuple[sympy.Expr, ...]:
    """``∂z*/∂v · S v − f0(z*, s, v, w)``, one entry per zero state: all vanish iff z* is a steady state."""
    velocity = tuple(exosystem.S * sympy.Matrix(exosystem.states)) if exosystem.states else ()
    values = dict(zip(agent.zero_states, z_star, strict=True))
    drift = [
        sympy.Add(*(z.diff(name) * speed for name, speed in zip(exosystem.states, velocity, strict=True)))
        for z in z_star
    ]
    return tuple(change - f0.xreplace(values) for change, f0 in zip(drift, right_hand_side(agent), strict=True))


def steady_input(agent: Agent, z_star: tuple[sympy.Expr, ...]) -> sympy.Expr:
    """``u* = −f(z*, s, 0, v, w)/b(w)``."""
    at_rest = dict.fromkeys(agent.chain, sympy.Integer(0)) | {agent.chain[0]: COST_VARIABLE}
    return normal_form(-agent.f.xreplace(at_rest | dict(zip(agent.zero_states, z_star, strict=True))) / agent.b)


def proved(
    agent: Agent,
    exosystem: Exosystem,
    z_star: tuple[sympy.Expr, ...],
    source: str,
    roots: tuple[sympy.Symbol, ...] = (),
) -> SteadyState | NoSteadyState:
    """The steady state if every residual and z*(0, 0, w) are proved to be zero; otherwise the first that is not.

    Of the components in ``roots`` nothing is said but that ``f0`` depends on that component, ``s`` and ``w`` alone.
    """
    box = parameter_box(agent)
    origin = dict.fromkeys((COST_VARIABLE, *exosystem.states), sympy.Integer(0))
    residuals = regulator_residuals(agent, exosystem, z_star)
    for name, z, residual in zip(agent.zero_states, z_star, residuals, strict=True):
        if name in roots:
            continue
        for what, expr in (
            (f"{name}*(0, 0, w)", z.xreplace(origin)),
            (f"the residual of the regulator equation of {name}", residual),
        ):
            test = zero_test(expr, box)
            if test.verdict != "holds":
                shown = excerpt(normal_form(expr)) if expr.count_ops() <= MAX_OPERATIONS else excerpt(expr)
                reason = f"{what} is {'not zero' if test.verdict == 'fails' else 'not shown to be zero'}"
                return NoSteadyState(test.verdict, reason, {"residual": shown, **test.at})
    return SteadyState(z_star, steady_input(agent, z_star), source, roots)


def verified(agent: Agent, exosystem: Exosystem, given: tuple[sympy.Expr, ...]) -> SteadyState | NoSteadyState:
    """The user's z*: its names, the regulator equation, and that it is smooth for every s, v and every w in the box.

    Raises ``InputError`` if it uses names other than s, the exosystem's states and the parameters.
    """
    allowed = {COST_VARIABLE, *exosystem.states, *agent.parameters}
    for name, expr in zip(agent.zero_states, given, strict=True):
        foreign = ", ".join(sorted(str(symbol) for symbol in expr.free_symbols - allowed))
        if foreign:
            raise InputError(f"agent {agent.id}: steady_state.{name}: {foreign} may not appear in z*(s, v, w)")
    answer = proved(agent, exosystem, given, "user")
    if isinstance(answer, NoSteadyState):
        return NoSteadyState(answer.verdict, f"the given steady state: {answer.reason}", answer.evidence)
    everywhere: Box = {**parameter_box(agent), COST_VARIABLE: None, **dict.fromkeys(exosystem.states)}
    for name, expr in zip(agent.zero_states, given, strict=True):
        obstacle = _singularity(expr, everywhere)
        if obstacle is not None:
            return NoSteadyState(obstacle[0], f"the given steady state: {name}* {obstacle[1]}", {f"{name}*": str(expr)})
    return answer


def _singularity(expr: sympy.Expr, box: Box) -> tuple[str, str] | None:
    """Where the expression might not be defined and smooth: a verdict and a phrase, or ``None`` if it is everywhere."""
    answer = nonvanishing(sympy.fraction(sympy.together(expr))[1], box)
    if answer.verdict != "holds":
        proved_pole = answer.verdict == "fails"
        return answer.verdict, f"{'is' if proved_pole else 'may be'} undefined somewhere: {answer.reason}"
    ranges = {name: as_range(interval) for name, interval in box.items()}
    for node in sympy.preorder_traversal(expr):
        root = isinstance(node, sympy.Pow) and not node.exp.is_Integer
        if root or (isinstance(node, sympy.Function) and not isinstance(node, _SMOOTH_EVERYWHERE)):
            lower = enclosure(node.args[0], ranges)[0]
            if isinstance(node, sympy.tan) or lower is None or lower <= 0:
                return "unknown", f"may not be smooth everywhere: {node}"
    return None
