"""Do the two plant readers read the same plant? They share no code, so what they agree on is what the file says.

Both readings are turned into the same plain data (tables, lists, rationals, and expressions by their values at a point,
in balls) and compared entry by entry. Suggestions that bind nobody (``steady_state``, ``zero_dynamics_lyapunov``) are
read by the checker and not kept, so they are not compared.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from fractions import Fraction
from typing import Any

import sympy
from flint import arb, ctx

from certify.bounds.balls import NonFiniteError, compile_expression
from certify.bounds.conversions import rational_ball
from certify.checker.expressions import Node, evaluate
from certify.checker.plant import Plant as CheckerPlant
from symbolic.network import laplacian
from symbolic.plant import COST_VARIABLE, Interval, Plant

Outcome = tuple[str, Any]
HARMLESS = {
    "division by zero": "a denominator that vanishes identically: the checker encloses nothing that is divided by it",
    "sqrt of a number with more than": "a real number that is too large for the tool's algebra",
    "log inside exp": "a function that the tool's algebra does not keep apart from a power",
    "becomes Abs": "the root of a square, which the tool's algebra makes an absolute value",
    "is too large: its": "an expression that the tool would not expand",
    "is nested too deeply": "a constant that takes the tool's algebra too long",
    "write it like that": "a constant that is rational by more than arithmetic of fractions",
}
PRECISION = 128
POINT = [Fraction(k, 7 + k) for k in range(1, 200)]


@dataclass(frozen=True)
class Value:
    """An expression by its value at the point; one that is not finite there says nothing."""

    ball: arb

    def agrees(self, other: Value) -> bool:
        return bool(self.ball.overlaps(other.ball)) or not (self.ball.is_finite() and other.ball.is_finite())


def difference(mine: Outcome, theirs: Outcome) -> str | None:
    """``None`` when both accept the same plant or both refuse."""
    if mine[0] != theirs[0]:
        reader = "the checker's reader" if mine[0] == "accepted" else "the tool's reader"
        return f"only {reader} accepts{_why(mine)}{_why(theirs)}"
    if mine[0] != "accepted":
        return None
    with ctx.workprec(PRECISION):
        place = _unequal(_checkers(mine[1]), _tools(theirs[1]), "plant")
    return None if place is None else f"read differently: {place}"


def harmless(reason: str) -> bool:
    """Whether only the checker accepts, and only because the tool will not compute with what the file says."""
    return reason.startswith("only the checker's reader accepts") and any(part in reason for part in HARMLESS)


def _why(outcome: Outcome) -> str:
    return f" ({outcome[1]})" if outcome[0] == "refused" else ""


def _unequal(mine: Any, theirs: Any, place: str) -> str | None:
    """The first place at which two trees differ."""
    if isinstance(mine, Value) and isinstance(theirs, Value):
        return None if mine.agrees(theirs) else f"{place}: {mine.ball} is not {theirs.ball}"
    if isinstance(mine, Mapping) and isinstance(theirs, Mapping) and list(mine) == list(theirs):
        found = (_unequal(mine[key], theirs[key], f"{place}.{key}") for key in mine)
        return next((where for where in found if where), None)
    if isinstance(mine, list) and isinstance(theirs, list) and len(mine) == len(theirs):
        pairs = enumerate(zip(mine, theirs, strict=True), 1)
        found = (_unequal(left, right, f"{place}[{k}]") for k, (left, right) in pairs)
        return next((where for where in found if where), None)
    return None if type(mine) is type(theirs) and mine == theirs else f"{place}: {mine!r:.80} is not {theirs!r:.80}"


def _plain(value: Any) -> Any:
    """Dataclasses as tables, intervals as pairs, tuples as lists, numbers as rationals."""
    if isinstance(value, Interval):
        return [value.lo, value.hi]
    if is_dataclass(value):
        return {field.name: _plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, (tuple, list)):
        return [_plain(entry) for entry in value]
    return Fraction(value) if isinstance(value, int) and not isinstance(value, bool) else value


def _asked(plant: Plant | CheckerPlant, count: int) -> dict[str, Any]:
    numbers = range(1, count + 1)
    return {
        "sha256": plant.sha256,
        "coordinator": _plain(plant.coordinator),
        "gains": [_plain(plant.gains_of(number)) for number in numbers],
        "requirements": [_plain(plant.requirements_of(number)) for number in numbers],
        "implementation": [_plain(plant.implementation_of(number)) for number in numbers],
    }


def _checkers(plant: CheckerPlant) -> dict[str, Any]:
    """What the checker's reader read."""
    agents = []
    for agent in plant.agents:
        names = [*agent.zero_states, *agent.chain, *plant.exosystem, *agent.parameters, "s"]
        point = dict(zip(names, map(rational_ball, POINT), strict=False))
        initial = {
            "z": agent.z_box,
            "x": agent.x_box,
            "observer": agent.observer_box,
            "eta": agent.eta_box,
            "reference": agent.reference_box,
        }
        agents.append(
            {
                "id": agent.id,
                "names": names,
                "zero_dynamics": [_node_value(node, point) for node in agent.zero_dynamics],
                "f": _node_value(agent.f, point),
                "b": _node_value(agent.b, point),
                "cost": _node_value(agent.cost, point),
                "uncertain": _plain(agent.parameters),
                "initial": _plain(initial),
                "gamma": _plain(agent.gamma),
                "observer": _plain(agent.observer),
                "internal_model": _plain(agent.internal_model),
            }
        )
    S = _plain(plant.S) if plant.exosystem else []
    network = {"laplacian": _plain(plant.laplacian), "exosystem": _plain(plant.exosystem), "S": S}
    return {**_asked(plant, len(agents)), **network, "agents": agents}


def _tools(plant: Plant) -> dict[str, Any]:
    """What the tool's reader read."""
    agents = []
    for agent in plant.agents:
        symbols = [*agent.zero_states, *agent.chain, *plant.exosystem.states, *agent.parameters, COST_VARIABLE]
        point = dict(zip(symbols, map(rational_ball, POINT), strict=False))
        model = agent.internal_model
        agents.append(
            {
                "id": agent.id,
                "names": [symbol.name for symbol in symbols],
                "zero_dynamics": [_expr_value(expr, point) for expr in agent.zero_dynamics],
                "f": _expr_value(agent.f, point),
                "b": _expr_value(agent.b, point),
                "cost": _expr_value(agent.cost, point),
                "uncertain": _plain(dict(zip(agent.parameters, agent.parameter_box, strict=True))),
                "initial": _plain(
                    {key: getattr(agent.initial, key) for key in ("z", "x", "observer", "eta", "reference")}
                ),
                "gamma": _plain(agent.gamma),
                "observer": _plain(agent.observer),
                "internal_model": None if model is None else _plain((model.M, model.N)),
            }
        )
    exosystem = plant.exosystem
    rational = all(entry.is_Rational for entry in exosystem.S)
    S = [[Fraction(int(entry.p), int(entry.q)) for entry in row] for row in exosystem.S.tolist()] if rational else None
    network = {
        "laplacian": _plain(laplacian(plant.digraph)),
        "exosystem": _plain(dict(zip(exosystem.states, exosystem.initial, strict=True))),
        "S": S if exosystem.states else [],
    }
    return {**_asked(plant, len(agents)), **network, "agents": agents}


def _node_value(node: Node, point: Mapping[str, arb]) -> Value:
    return Value(evaluate(node, point, rational_ball, lambda function, argument: getattr(argument, function)()))


def _expr_value(expr: sympy.Expr, point: Mapping[sympy.Symbol, arb]) -> Value:
    try:
        return Value(compile_expression(expr, tuple(point))(list(point.values())))
    except NonFiniteError:
        return Value(arb("nan"))
