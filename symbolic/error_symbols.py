"""Names for the states, inputs and gains of the error system that do not collide with the names of a plant."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import sympy

from symbolic.plant import symbol

Symbols = tuple[sympy.Symbol, ...]


@dataclass(frozen=True)
class DesignSymbols:
    """``g, K, δ, h > 0``, ``gamma = (γ_1 … γ_(n−1))``, ``c = (c_1 … c_n)``."""

    g: sympy.Symbol
    K: sympy.Symbol
    delta: sympy.Symbol
    h: sympy.Symbol
    gamma: Symbols
    c: Symbols


@dataclass(frozen=True)
class ErrorSymbols:
    """New coordinates ``z̄, x̂, η̃, ϑ, e``, the controller's states ``η, x̃``, the reference and the free input ``ū``.

    ``xbar`` and ``zstar`` stand for x̄ and z*(s*, v, w), ``f0_bar … epsilon`` for the functions of the error system,
    where a formula is shorter in them.
    """

    zbar: Symbols
    xhat: Symbols
    etatilde: Symbols
    vartheta: sympy.Symbol
    e: Symbols
    eta: Symbols
    observer: Symbols
    reference: sympy.Symbol
    reference_rate: sympy.Symbol
    ubar: sympy.Symbol
    xbar: Symbols
    zstar: Symbols
    f0_bar: Symbols
    f0_hat: Symbols
    f1_bar: sympy.Symbol
    f2_bar: sympy.Symbol
    f_hat: sympy.Symbol
    epsilon: sympy.Symbol
    gains: DesignSymbols


def unused(name: str, taken: set[str]) -> str:
    """The name with as many underscores as it takes to be a new one, which from now on is taken."""
    while name in taken:
        name += "_"
    taken.add(name)
    return name


def error_symbols(zero_states: int, order: int, internal_order: int, taken: Iterable[sympy.Symbol]) -> ErrorSymbols:
    """One symbol for each, with underscores appended to a name the plant already uses."""
    names = {str(name) for name in taken}

    def fresh(name: str) -> sympy.Symbol:
        return symbol(unused(name, names))

    def several(name: str, count: int) -> Symbols:
        return tuple(fresh(f"{name}{k}") for k in range(1, count + 1))

    return ErrorSymbols(
        zbar=several("zbar", zero_states),
        xhat=several("xhat", order - 1),
        etatilde=several("etatilde", internal_order),
        vartheta=fresh("vartheta"),
        e=several("e", order),
        eta=several("eta", internal_order),
        observer=several("xtilde", order),
        reference=fresh("yr"),
        reference_rate=fresh("yr_dot"),
        ubar=fresh("ubar"),
        xbar=several("xbar", order),
        zstar=several("zstar", zero_states),
        f0_bar=several("f0_bar", zero_states),
        f0_hat=several("f0_hat", zero_states),
        f1_bar=fresh("f1_bar"),
        f2_bar=fresh("f2_bar"),
        f_hat=fresh("f_hat"),
        epsilon=fresh("epsilon"),
        gains=DesignSymbols(
            fresh("g"), fresh("K"), fresh("delta"), fresh("h"), several("gamma", order - 1), several("c", order)
        ),
    )
