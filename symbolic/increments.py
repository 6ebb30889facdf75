"""The increments f̄0, f̂0, f̄1, f̄2 around the reference and the steady state (theory.md section 3)."""

from __future__ import annotations

import sympy

from symbolic.error_symbols import ErrorSymbols
from symbolic.identity import degree_bound
from symbolic.plant import Agent

MAX_EXPANDED_DEGREE = 8

Exprs = tuple[sympy.Expr, ...]


def increments(agent: Agent, functions: Exprs, symbols: ErrorSymbols, s_star: sympy.Expr) -> tuple[Exprs, Exprs]:
    """For each f: ``f(z̄ + z*, x̄ + col(y^r, 0)) − f(z*, col(y^r, 0))`` and ``f(z*, col(y^r, 0)) − f(z*, col(s*, 0))``.

    In the symbols ``zbar, zstar, xbar, reference``; z* is a symbol so that what cancels does so on expansion.
    """
    z, x = agent.zero_states, agent.chain
    steady = dict.fromkeys(x, sympy.Integer(0)) | dict(zip(z, symbols.zstar, strict=True))
    moved = {name: bar + star for name, bar, star in zip(z, symbols.zbar, symbols.zstar, strict=True)}
    moved |= dict(zip(x, symbols.xbar, strict=True)) | {x[0]: symbols.xbar[0] + symbols.reference}
    bar, hat = [], []
    for f in functions:
        tracking, optimal = f.xreplace(steady | {x[0]: symbols.reference}), f.xreplace(steady | {x[0]: s_star})
        short = degree_bound(f, f.free_symbols) <= MAX_EXPANDED_DEGREE
        differences = (f.xreplace(moved) - tracking, tracking - optimal)
        tracked, remaining = (sympy.expand(d) if short else d for d in differences)
        bar.append(tracked)
        hat.append(remaining)
    return tuple(bar), tuple(hat)
