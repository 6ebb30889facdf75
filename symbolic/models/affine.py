"""Models that are affine in one input: ``ξ' = f(ξ, v, w) + g(ξ, w) u``, ``y = h(ξ)``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import sympy

from symbolic.errors import InputError
from symbolic.expression_text import float_value, without_time
from symbolic.guards import Guard
from symbolic.interval import Interval
from symbolic.plant import symbol
from symbolic.toml_value import exact_number

INPUT = symbol("u")


@dataclass(frozen=True)
class AffineModel:
    """One agent's model. Symbols are the real ones of :func:`symbolic.plant.symbol`.

    ``rates`` are ``ξ'`` in ``states``, ``u``, ``disturbances`` and ``parameters``; ``output`` is ``y`` in the states.
    ``disturbances`` are exosystem states ``v`` with ``v' = S v`` from the box ``disturbance_box``. ``initial`` holds a
    box for the states, or is empty. ``guards`` are conditions of the model's text that SymPy has cancelled.
    """

    states: tuple[sympy.Symbol, ...]
    rates: tuple[sympy.Expr, ...]
    output: sympy.Expr
    parameters: tuple[sympy.Symbol, ...] = ()
    parameter_box: tuple[Interval, ...] = ()
    disturbances: tuple[sympy.Symbol, ...] = ()
    S: sympy.ImmutableMatrix = field(default_factory=lambda: sympy.ImmutableMatrix(0, 0, []))
    disturbance_box: tuple[Interval, ...] = ()
    initial: tuple[Interval, ...] = ()
    guards: tuple[Guard, ...] = ()

    @property
    def box(self) -> dict[sympy.Symbol, Interval]:
        """``W`` by name."""
        return dict(zip(self.parameters, self.parameter_box, strict=True))

    def agent(self, cost: Any, **answers: Any) -> Mapping[str, Any]:
        """The description of the agent in normal form, for :class:`Network`. Raises ``InputError`` where there is none.

        ``answers`` are the optional keys of the plant file (``gamma``, ``observer``, ``internal_model``).
        """
        from symbolic.models.normal_form import normal_form

        return normal_form(self).description(cost, **answers)


def affine_model(
    rates: Mapping[Any, Any],
    output: Any,
    *,
    uncertain: Mapping[Any, Any] | None = None,
    initial: Mapping[Any, Any] | None = None,
    exosystem: Mapping[str, Any] | None = None,
) -> AffineModel:
    """A model ``ξ' = f + g u``, ``y = h`` from SymPy expressions in plain symbols.

    ``rates`` maps every state to its derivative, in which the input is the symbol ``u``; ``output`` is an expression in
    the states. ``uncertain`` and ``initial`` map parameters and states to a number or a pair, ``exosystem`` is the one
    of the network (``states``, ``S``, ``initial``) if a rate has its states. Raises ``InputError``.

    >>> q, v, u = sympy.symbols("q v u")
    >>> affine_model({q: v, v: -sympy.sin(q) + u}, q).agent(sympy.Symbol("s") ** 2)["f"]
    '-sin(x1)'
    """
    names = [str(state) for state in rates]
    known = _Names(names, list(uncertain or {}), list((exosystem or {}).get("states", ())))
    parameters = {str(name): value for name, value in (uncertain or {}).items()}
    start = {str(name): value for name, value in (initial or {}).items()}
    if start and set(start) != set(names):
        raise InputError(f"initial: a box for each of {', '.join(names)} is needed")
    outside = exosystem or {}
    box = {str(name): value for name, value in outside.get("initial", {}).items()}
    disturbances = [str(name) for name in outside.get("states", ())]
    return AffineModel(
        states=tuple(map(symbol, names)),
        rates=tuple(known.real(rate, f"rate of {state}", with_input=True) for state, rate in rates.items()),
        output=known.real(output, "output"),
        parameters=tuple(map(symbol, parameters)),
        parameter_box=tuple(box_of(value, name) for name, value in parameters.items()),
        disturbances=tuple(map(symbol, disturbances)),
        S=sympy.ImmutableMatrix(sympy.Matrix(outside.get("S", sympy.zeros(0, 0))).applyfunc(_exact)),
        disturbance_box=tuple(box_of(box[name], name) for name in disturbances),
        initial=tuple(box_of(start[name], name) for name in names) if start else (),
    )


def box_of(value: Any, where: str) -> Interval:
    """A number or a pair of numbers as an interval. Raises ``InputError``."""
    ends = value if isinstance(value, Sequence) and not isinstance(value, str) else (value, value)
    exact = [exact_number(end, where) for end in ends]
    if len(exact) != 2 or exact[0] is None or exact[1] is None or exact[0] > exact[1]:
        raise InputError(f"{where}: a number or a pair (lo, hi) of numbers is needed, found {value!r:.60}")
    return Interval(exact[0], exact[1])


def _exact(entry: sympy.Expr) -> sympy.Expr:
    """The entry with floats as the decimals they stand for."""
    return entry.xreplace({number: float_value(number) for number in entry.atoms(sympy.Float)})


@dataclass(frozen=True)
class _Names:
    """What the expressions of a model may contain."""

    states: Sequence[str]
    parameters: Sequence[Any]
    disturbances: Sequence[Any]

    def real(self, expr: Any, where: str, *, with_input: bool = False) -> sympy.Expr:
        """The expression in real symbols, floats as the decimals they stand for. Raises ``InputError``."""
        given = sympy.sympify(expr) if not isinstance(expr, str) else None
        if not isinstance(given, sympy.Expr):
            raise InputError(f"{where}: a SymPy expression is needed, found {type(expr).__name__}")
        given = without_time(given)
        known = {*self.states, *map(str, self.parameters), *map(str, self.disturbances), *(["u"] if with_input else [])}
        unknown = sorted(str(name) for name in given.free_symbols if str(name) not in known)
        if unknown:
            raise InputError(f"{where}: unknown name {unknown[0]!r}; known: {', '.join(sorted(known))}")
        return _exact(given).xreplace({name: symbol(str(name)) for name in given.free_symbols})
