"""The derived coordinates of each type of agent: agents whose expressions differ at most in numbers."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import sympy

from reports import cells
from reports.error_equations import equations, formula, typst_names
from reports.tables import grouped
from reports.typst_math import column, dotted, matrix, typst
from symbolic.design import DesignPolynomials
from symbolic.exact_field import Number, as_expression
from symbolic.internal_model import InternalModel, NoInternalModel
from symbolic.named_equations import NamedEquations
from symbolic.plant import Agent
from symbolic.steady_state import NoSteadyState, SteadyState

if TYPE_CHECKING:
    from symbolic.derived import AgentDerivation, Derivation

MAX_TYPES = 10

Part = dict[str, Any]
Pair = tuple[Agent, "AgentDerivation"]


def coordinates_section(derivation: Derivation, agents: Sequence[Agent]) -> dict[str, Any]:
    """The data of ``coordinates.typ``: the types in full up to ten, the others by name."""
    groups = agent_types(derivation, agents)
    rest = [agent.id for group in groups[MAX_TYPES:] for agent, _ in group]
    left_out = (
        f"{cells.agents_named(rest)}: {len(groups) - MAX_TYPES} further types, not printed here." if rest else None
    )
    return {
        "list": [_type(group) for group in groups[:MAX_TYPES]],
        "left_out": None if left_out is None else cells.text(left_out),
    }


def _type(group: Sequence[Pair]) -> dict[str, Any]:
    agent, derived = group[0]
    alike = len({(a.zero_dynamics, a.f, a.b) for a, _ in group}) == 1
    others = cells.agents([a.id for a, _ in group[1:]])
    remark = (
        None
        if alike
        else f"The numbers are those of agent {agent.id}; agents {others} have the same structure with other numbers."
    )
    parts = [_dynamics(agent), _steady_state(agent, derived.steady_state)]
    if isinstance(derived.steady_state, SteadyState):
        parts.append(_part("Steady-state input", [f"u^(star.op) = {formula(derived.steady_state.u_star)}"]))
    if derived.internal_model is not None:
        parts.append(_internal_model(derived.internal_model))
    parts.append(_design(agent.order, derived.design))
    if derived.equations is not None:
        parts += _error_system(derived.equations)
    return {
        "title": cells.agents_named(a.id for a, _ in group),
        "remark": None if remark is None else cells.text(remark),
        "parts": parts,
    }


def _part(label: str, lines: Iterable[str] = (), text: str | None = None) -> Part:
    return {"label": label, "lines": list(lines), "text": None if text is None else cells.text(text)}


def _dynamics(agent: Agent) -> Part:
    zero = [
        f"{dotted(name)} = {formula(expr)}" for name, expr in zip(agent.zero_states, agent.zero_dynamics, strict=True)
    ]
    chain = [f"dot(x)_{k} = x_{k + 1}" for k in range(1, agent.order)]
    drift = "" if agent.f == 0 else f"{formula(agent.f)} + "
    return _part(
        "Dynamics", [*zero, ", quad ".join([*chain, f"dot(x)_{agent.order} = {drift}{_coefficient(agent.b)} u"])]
    )


def _coefficient(b: sympy.Expr) -> str:
    if b == 1:
        return ""
    return f"({formula(b)})" if isinstance(b, sympy.Add) else formula(b)


def _steady_state(agent: Agent, found: SteadyState | NoSteadyState) -> Part:
    if isinstance(found, NoSteadyState):
        return _part("Steady state", text=found.reason)
    lines = [
        f"{typst(name)}^(star.op) = {formula(expr)}" for name, expr in zip(agent.zero_states, found.z_star, strict=True)
    ]
    return _part("Steady state of the zero dynamics", lines, None if lines else "There are no zero dynamics.")


def _internal_model(model: InternalModel | NoInternalModel) -> Part:
    """``s_i``, the generator ``ℓ`` of ``u*`` and the matrices of the internal model."""
    if isinstance(model, NoInternalModel):
        return _part("Internal model", text=model.reason)
    if model.order == 0:
        return _part(
            "Internal model", text="The steady-state input vanishes at the optimum: no internal model is needed."
        )
    lines = [
        f"{_derivative(model.order)} = {_generator(model.ell)}",
        f"Phi = {_matrix(model.Phi)}, quad Gamma = {_matrix([model.Gamma])}, "
        f"quad M = {_matrix(model.M)}, quad N = {_column(model.N)}",
        f"T = {_matrix(model.T)}, quad Psi = Gamma T^(-1) = {_matrix([model.psi])}",
    ]
    return _part(f"Internal model of order $s_i = {model.order}$", lines)


def _generator(ell: Sequence[Number]) -> str:
    """``ℓ_1 u* + ℓ_2 du*/dt + …`` without the terms that vanish."""
    terms = [f"{_value(value)} {_derivative(k)}" for k, value in enumerate(ell) if value != 0]
    return " + ".join(terms).replace("+ -", "- ") or "0"


def _derivative(k: int) -> str:
    if k == 0:
        return "u^(star.op)"
    power = "" if k == 1 else f"^{k}"
    return f"frac(dif{power} u^(star.op), dif t{power})"


def _design(n: int, design: DesignPolynomials) -> Part:
    """``γ``, ``c`` and the matrices they make: ``A_c, B_c, E_3``."""
    if n == 1:
        return _part("Design", text="Order 1: no coordinates besides the output, no observer.")
    A = [[Fraction(int(j == i + 1)) for j in range(n - 1)] for i in range(n - 2)] + [[-value for value in design.gamma]]
    B = [*("0" for _ in range(n - 2)), "1" if n == 2 else f"g^({2 - n})"]
    E3 = [[-design.observer[n - 1 - i] if j == 0 else Fraction(int(j == i + 1)) for j in range(n)] for i in range(n)]
    polynomials = (
        f"gamma = ({', '.join(map(_value, design.gamma))}), quad c = ({', '.join(map(_value, design.observer))})"
    )
    return _part(
        "Design polynomials and their matrices",
        [polynomials, f"A_c = {_matrix(A)}, quad B_c = {column(B)}, quad E_3 = {_matrix(E3)}"],
    )


def _error_system(found: NamedEquations) -> list[Part]:
    """Scaled coordinates, functions and equations of the error system."""
    names = typst_names(found.symbols)
    rows = ({*found.symbols.xhat, found.symbols.vartheta}, set(found.symbols.e))
    coordinates = [equations([entry for entry in found.coordinates if entry.left in row], names) for row in rows]
    return [
        _part("Coordinates", [", quad ".join(row) for row in coordinates if row]),
        _part("Functions", equations(found.functions, names)),
        _part("Error equations", equations(found.rates, names)),
    ]


def _value(value: Number) -> str:
    return typst(as_expression(value))


def _matrix(rows: Sequence[Sequence[Number]]) -> str:
    return matrix([[_value(entry) for entry in row] for row in rows])


def _column(entries: Sequence[Number]) -> str:
    return column([_value(entry) for entry in entries])


def agent_types(derivation: Derivation, agents: Sequence[Agent]) -> list[list[Pair]]:
    """Agents whose ``f0, f, b`` agree up to numerical coefficients and whose internal models have the same matrices."""
    paired = zip(agents, derivation.agents, strict=True)
    return grouped(paired, lambda pair: (skeleton(pair[0]), _outcome(pair[1])))


def _outcome(derived: AgentDerivation) -> object:
    model = derived.internal_model
    return (model.order, model.M, model.N) if isinstance(model, InternalModel) else derived.verdict


def skeleton(agent: Agent) -> tuple[object, ...]:
    """The right-hand sides with every numerical coefficient replaced by one placeholder."""
    placeholder = sympy.Symbol("#")
    expressions = (*agent.zero_dynamics, agent.f, agent.b)
    return (agent.order, agent.zero_states, *(_without_numbers(expr, placeholder) for expr in expressions))


def _without_numbers(expr: sympy.Expr, placeholder: sympy.Symbol) -> sympy.Expr:
    if expr.is_number:
        return placeholder if expr != 0 else expr
    if isinstance(expr, sympy.Pow) and expr.exp.is_number:
        return sympy.Pow(_without_numbers(expr.base, placeholder), expr.exp, evaluate=False)
    if not expr.args:
        return expr
    return expr.func(*(_without_numbers(part, placeholder) for part in expr.args))
