"""The named equations of an error system as Typst mathematics, in the notation of the paper."""

from __future__ import annotations

from collections.abc import Sequence

import sympy

from reports.typst_math import typst
from symbolic.error_symbols import ErrorSymbols
from symbolic.named_equations import NamedEquation

Names = dict[sympy.Symbol, str]

MAX_OPERATIONS = 400


def typst_names(symbols: ErrorSymbols) -> Names:
    """The paper's notation for the symbols of an error system; a component's index stands as a subscript."""
    gains = symbols.gains
    families = (
        (symbols.zbar, "overline(z)"), (symbols.xhat, "hat(x)"), (symbols.xbar, "overline(x)"), (symbols.e, "e"),
        (symbols.eta, "eta"), (symbols.etatilde, "tilde(eta)"), (symbols.observer, "tilde(x)"),
        (gains.gamma, "gamma"), (gains.c, "c"),
    )  # fmt: skip
    names = {name: f"{head}_({k})" for family, head in families for k, name in enumerate(family, 1)}
    names |= {name: f"z^(star.op)_({k})" for k, name in enumerate(symbols.zstar, 1)}
    for family, head in ((symbols.f0_bar, "overline(f)"), (symbols.f0_hat, "hat(f)")):
        names |= {name: f"{head}_(0 {k if len(family) > 1 else ''})" for k, name in enumerate(family, 1)}
    return names | {
        symbols.vartheta: "theta.alt", symbols.ubar: "overline(u)", symbols.epsilon: "epsilon",
        symbols.reference: "y^r", symbols.reference_rate: "dot(y)^r",
        symbols.f1_bar: "overline(f)_1", symbols.f2_bar: "overline(f)_2", symbols.f_hat: "hat(f)",
        gains.g: "g", gains.K: "K", gains.delta: "delta", gains.h: "h",
    }  # fmt: skip


def equation(entry: NamedEquation, names: Names) -> str:
    """``left = right``, with a dot over the left side's letter for a rate."""
    left = names.get(entry.left) or typst(entry.left)
    if entry.rate:
        head, mark, index = left.partition("_(")
        left = f"dot({head}){mark}{index}"
    return f"{left} = {formula(entry.right, names)}"


def equations(entries: Sequence[NamedEquation], names: Names) -> list[str]:
    return [equation(entry, names) for entry in entries]


def formula(expr: sympy.Expr, names: Names | None = None) -> str:
    """The expression, or the number of its operations if it is too long to be read."""
    operations = int(sympy.count_ops(expr))
    return typst(expr, names) if operations <= MAX_OPERATIONS else f'"an expression of {operations} operations"'
