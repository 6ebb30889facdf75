"""LaTeX of expressions, matrices and equations with the notation of the paper."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy

from symbolic.error_symbols import ErrorSymbols
from symbolic.exact_field import Number, as_expression
from symbolic.named_equations import NamedEquation

Names = Mapping[sympy.Symbol, str]


def latex_names(symbols: ErrorSymbols) -> dict[sympy.Symbol, str]:
    """The paper's notation for the symbols of an error system; all others are printed as SymPy does."""
    gains = symbols.gains
    families = (
        (symbols.zbar, r"\bar z"),
        (symbols.xhat, r"\hat x"),
        (symbols.etatilde, r"\tilde\eta"),
        (symbols.e, "e"),
        (symbols.eta, r"\eta"),
        (symbols.observer, r"\tilde x"),
        (symbols.xbar, r"\bar x"),
        (symbols.f0_bar, r"\bar f_0"),
        (symbols.f0_hat, r"\hat f_0"),
        (gains.gamma, r"\gamma"),
        (gains.c, "c"),
    )
    names = {symbol: _indexed(head, k) for family, head in families for k, symbol in enumerate(family, 1)}
    names |= {symbol: rf"z^\star_{{{k}}}" for k, symbol in enumerate(symbols.zstar, 1)}
    return names | {
        symbols.vartheta: r"\vartheta",
        symbols.reference: "y^r",
        symbols.reference_rate: r"\dot y^r",
        symbols.ubar: r"\bar u",
        symbols.f1_bar: r"\bar f_1",
        symbols.f2_bar: r"\bar f_2",
        symbols.f_hat: r"\hat f",
        symbols.epsilon: r"\varepsilon",
        gains.g: "g",
        gains.K: "K",
        gains.delta: r"\delta",
        gains.h: "h",
    }


def latex_expression(expr: sympy.Expr, names: Names | None = None) -> str:
    return str(sympy.latex(expr, symbol_names=dict(names or {})))


def latex_number(number: Number) -> str:
    return str(sympy.latex(as_expression(number)))


def latex_matrix(rows: Sequence[Sequence[Number]]) -> str:
    r"""A ``bmatrix``; a column is a sequence of one-element rows."""
    body = r" \\ ".join(" & ".join(latex_number(entry) for entry in row) for row in rows)
    return rf"\begin{{bmatrix}} {body} \end{{bmatrix}}"


def latex_equation(equation: NamedEquation, names: Names) -> str:
    """``left &= right`` for an ``align`` environment."""
    left = names.get(equation.left) or latex_expression(equation.left)
    if equation.rate:
        left = rf"\dot{{{left}}}"
    return f"{left} &= {latex_expression(equation.right, names)}"


def latex_align(lines: Sequence[str]) -> str:
    joined = " \\\\\n".join(f"  {line}" for line in lines)
    return f"\\begin{{align*}}\n{joined}\n\\end{{align*}}"


def _indexed(head: str, index: int) -> str:
    """``head_index``; a head that has an index already gets the second one beside it."""
    return f"{head[:-1]}{{{head[-1]},{index}}}" if "_" in head else f"{head}_{{{index}}}"
