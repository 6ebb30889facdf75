"""A derivation as text, as LaTeX and as a dictionary of strings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sympy
from sympy.printing.str import StrPrinter

from symbolic.annihilator import LAMBDA
from symbolic.derived import AgentDerivation, Derivation
from symbolic.error_symbols import ErrorSymbols
from symbolic.exact_field import Number
from symbolic.identity import excerpt
from symbolic.internal_model import InternalModel, NoInternalModel
from symbolic.latex import latex_align, latex_equation, latex_expression, latex_matrix, latex_names, latex_number
from symbolic.named_equations import SATURATION, NamedEquation, NamedEquations
from symbolic.plant import COST_VARIABLE, Agent
from symbolic.steady_state import SteadyState, right_hand_side


def as_text(derivation: Derivation) -> str:
    """The derivation in plain text, one section per agent type."""
    known = derivation.s_star != COST_VARIABLE
    optimum = f"s* = {derivation.s_star}" if known else "s* is not a known rational number, and written s"
    sections = [f"{derivation.plant}: {optimum}"]
    for ids in derivation.types:
        derived = derivation.representative(ids)
        title = f"agent{'s' if len(ids) > 1 else ''} {', '.join(map(str, ids))}: order {derived.agent.order}"
        sections.append("\n".join([title, *(f"  {line}" for line in _lines(derived))]))
    return "\n\n".join(sections) + "\n"


def as_latex(derivation: Derivation) -> str:
    """The derivation as LaTeX paragraphs and ``align*`` environments (needs amsmath), one paragraph per agent type."""
    parts = [rf"\paragraph{{Consensus value}} $s^\star = {latex_expression(derivation.s_star)}$."]
    for ids in derivation.types:
        derived = derivation.representative(ids)
        title = f"Agent{'s' if len(ids) > 1 else ''} {', '.join(map(str, ids))}, order {derived.agent.order}"
        parts += [rf"\paragraph{{{title}}}", *_latex_parts(derived)]
    return "\n".join(parts) + "\n"


def as_dict(derivation: Derivation) -> dict[str, Any]:
    """For JSON: exact numbers and expressions as strings."""
    return {
        "plant": derivation.plant,
        "status": derivation.verdict,
        "s_star": str(derivation.s_star),
        "types": [list(ids) for ids in derivation.types],
        "agents": [_agent_dict(agent) for agent in derivation.agents],
    }


def _lines(derived: AgentDerivation) -> list[str]:
    steady, model, agent = derived.steady_state, derived.internal_model, derived.agent
    if not isinstance(steady, SteadyState):
        return [f"no steady state ({steady.verdict}): {steady.reason}"]
    lines = [f"{name}*(s, v, w) {value}" for name, value in _steady_values(agent, steady)]
    lines.append(f"u*(s, v, w) = {steady.u_star}")
    if not isinstance(model, InternalModel):
        return [*lines, f"no internal model ({model.verdict}): {model.reason}" if model else "no internal model"]
    lines += _model_lines(model)
    if agent.order > 1:
        lines.append(f"γ = {_row(derived.design.gamma)}, c = {_row(derived.design.observer)}")
    equations = derived.equations
    assert equations is not None
    for title, group in (
        ("coordinates", equations.coordinates),
        ("functions", equations.functions),
        ("error equations", equations.rates),
    ):
        lines += [f"{title}:", *(f"  {_equation_text(equation, equations.symbols)}" for equation in group)]
    return lines


def _model_lines(model: InternalModel) -> list[str]:
    if model.order == 0:
        return ["no internal model: u* vanishes"]
    return [
        f"s_i = {model.order}{'' if model.least else ' (perhaps not the least)'}, ℓ = {_row(model.ell)}, "
        f"characteristic polynomial {_UnicodePrinter({LAMBDA: 'λ'}).doprint(model.characteristic)}",
        f"Φ = {_matrix(model.Phi)}, Γ = {_row(model.Gamma)}",
        f"M = {_matrix(model.M)}, N = {_row(model.N)}",
        f"T = {_matrix(model.T)}",
        f"Ψ = Γ T⁻¹ = {_row(model.psi)}",
    ]


def _steady_values(agent: Agent, steady: SteadyState) -> list[tuple[sympy.Symbol, str]]:
    """``= z*``, or what a component without closed form is a zero of."""
    return [
        (name, f"is the zero of {excerpt(f0)} in {name}" if name in steady.roots else f"= {z}")
        for name, z, f0 in zip(agent.zero_states, steady.z_star, right_hand_side(agent), strict=True)
    ]


def _latex_parts(derived: AgentDerivation) -> list[str]:
    steady, model = derived.steady_state, derived.internal_model
    if not isinstance(steady, SteadyState):
        return [f"No steady state ({steady.verdict})."]
    lines = [
        rf"{latex_expression(f0)} &= 0 \text{{ at }} {latex_expression(name)} = {latex_expression(name)}^\star(s, w)"
        if name in steady.roots
        else rf"{latex_expression(name)}^\star(s, v, w) &= {latex_expression(z)}"
        for name, z, f0 in zip(derived.agent.zero_states, steady.z_star, right_hand_side(derived.agent), strict=True)
    ]
    lines.append(rf"u^\star(s, v, w) &= {latex_expression(steady.u_star)}")
    if isinstance(model, NoInternalModel) or model is None or derived.equations is None:
        return [latex_align(lines), "No internal model."]
    if model.order:
        column = [[entry] for entry in model.N]
        lines += [
            rf"\ell &= ({', '.join(latex_number(entry) for entry in model.ell)})",
            rf"\Phi &= {latex_matrix(model.Phi)}, \quad \Gamma = {latex_matrix([model.Gamma])}",
            rf"M &= {latex_matrix(model.M)}, \quad N = {latex_matrix(column)}",
            rf"T &= {latex_matrix(model.T)}, \quad \Psi = \Gamma T^{{-1}} = {latex_matrix([model.psi])}",
        ]
    names = latex_names(derived.equations.symbols)
    groups = (derived.equations.coordinates, derived.equations.functions, derived.equations.rates)
    blocks = [[latex_equation(equation, names) for equation in group] for group in groups]
    return [latex_align(block) for block in (lines, *blocks)]


def _agent_dict(derived: AgentDerivation) -> dict[str, Any]:
    steady, model, equations = derived.steady_state, derived.internal_model, derived.equations
    result: dict[str, Any] = {
        "id": derived.id,
        "order": derived.agent.order,
        "status": derived.verdict,
        "gamma": _strings(derived.design.gamma),
        "observer": _strings(derived.design.observer),
    }
    if isinstance(steady, SteadyState):
        result["steady_state"] = {
            "source": steady.source,
            "u": str(steady.u_star),
            "z": {str(name): str(z) for name, z in zip(derived.agent.zero_states, steady.z_star, strict=True)},
        }
    else:
        result["steady_state"] = {"verdict": steady.verdict, "reason": steady.reason, "evidence": dict(steady.evidence)}
    if isinstance(model, InternalModel):
        result["internal_model"] = {
            "order": model.order,
            "least": model.least,
            "ell": _strings(model.ell),
            **{
                name: [_strings(row) for row in rows]
                for name, rows in (("Phi", model.Phi), ("M", model.M), ("T", model.T))
            },
            "Gamma": _strings(model.Gamma),
            "N": _strings(model.N),
            "psi": _strings(model.psi),
        }
    elif model is not None:
        result["internal_model"] = {"verdict": model.verdict, "reason": model.reason, "evidence": dict(model.evidence)}
    if equations is not None:
        result["equations"] = _equation_dict(equations)
    return result


def _equation_dict(equations: NamedEquations) -> dict[str, dict[str, str]]:
    return {
        title: {f"{equation.left}{_prime(equation)}": str(equation.right) for equation in group}
        for title, group in (
            ("coordinates", equations.coordinates),
            ("functions", equations.functions),
            ("rates", equations.rates),
        )
    }


class _UnicodePrinter(StrPrinter):
    """SymPy's text with the notation of the theory for some symbols."""

    def __init__(self, names: dict[sympy.Symbol, str]) -> None:
        super().__init__()
        self.names = names

    def _print_Symbol(self, expr: sympy.Symbol) -> str:
        return self.names.get(expr, expr.name)

    def _print_Function(self, expr: sympy.Function) -> str:
        if expr.func == SATURATION:
            return f"sat_δ({self.doprint(expr.args[0])})"
        return str(super()._print_Function(expr))


def _unicode_names(symbols: ErrorSymbols) -> dict[sympy.Symbol, str]:
    families = (
        (symbols.zbar, "z̄"),
        (symbols.xhat, "x̂"),
        (symbols.etatilde, "η̃"),
        (symbols.eta, "η"),
        (symbols.observer, "x̃"),
        (symbols.xbar, "x̄"),
        (symbols.f0_bar, "f̄0_"),
        (symbols.f0_hat, "f̂0_"),
        (symbols.gains.gamma, "γ"),
    )
    names = {symbol: f"{head}{k}" for family, head in families for k, symbol in enumerate(family, 1)}
    names |= {symbol: f"z{k}*" for k, symbol in enumerate(symbols.zstar, 1)}
    return names | {
        symbols.vartheta: "ϑ",
        symbols.reference: "yr",
        symbols.reference_rate: "yr'",
        symbols.ubar: "ū",
        symbols.f1_bar: "f̄1",
        symbols.f2_bar: "f̄2",
        symbols.f_hat: "f̂",
        symbols.epsilon: "ε",
    }


def _equation_text(equation: NamedEquation, symbols: ErrorSymbols) -> str:
    printer = _UnicodePrinter(_unicode_names(symbols))
    return f"{printer.doprint(equation.left)}{_prime(equation)} = {printer.doprint(equation.right)}"


def _prime(equation: NamedEquation) -> str:
    return "'" if equation.rate else ""


def _strings(row: Sequence[Number]) -> list[str]:
    return [str(entry) for entry in row]


def _row(row: Sequence[Number]) -> str:
    return f"({', '.join(_strings(row))})"


def _matrix(rows: Sequence[Sequence[Number]]) -> str:
    return f"[{'; '.join(' '.join(_strings(row)) for row in rows)}]"
