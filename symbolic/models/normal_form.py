"""The normal form of an affine model by Lie derivatives (docs/models.md): relative degree, coordinates, inverse, box.

    x_k = L_F^(k−1) h,   x_n' = L_F^n h + (L_g L_F^(n−1) h) u,   z' = f0(z, x1, v, w)

with ``F = f + S v ∂/∂v``. It is refused with the reason where the change of coordinates is not shown to be global.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, islice
from typing import Any

import sympy

from symbolic.errors import InputError
from symbolic.expression_text import expression_text
from symbolic.guards import Guard, guards
from symbolic.identity import zero_test
from symbolic.interval import Interval
from symbolic.models.affine import INPUT, AffineModel
from symbolic.models.boxes import hull
from symbolic.models.inverse import global_inverse, tidy
from symbolic.network_description import OWN_EXOSYSTEM
from symbolic.plant import Exosystem, symbol
from symbolic.ranges import nonvanishing

NO_EXOSYSTEM = Exosystem((), sympy.ImmutableMatrix(0, 0, []), ())
MOST_CHOICES = 60  # of coordinates for the zero dynamics that are tried: all of them up to six states and three of z


@dataclass(frozen=True)
class NormalForm:
    """``order`` and the expressions of an agent of the plant file, in ``z1 … zm``, ``x1 … xn``, ``v`` and ``w``.

    ``coordinates`` are the new ones in the model's states, ``inverse`` the other way round; ``box`` encloses where the
    new ones start (empty if the model says nothing). ``guards`` are conditions that the expressions have lost.
    """

    order: int
    zero_dynamics: Mapping[sympy.Symbol, sympy.Expr]
    f: sympy.Expr
    b: sympy.Expr
    coordinates: Mapping[sympy.Symbol, sympy.Expr]
    inverse: Mapping[sympy.Symbol, sympy.Expr]
    box: Mapping[sympy.Symbol, Interval]
    parameters: Mapping[sympy.Symbol, Interval]
    guards: tuple[Guard, ...] = ()
    exosystem: Exosystem = NO_EXOSYSTEM

    def description(self, cost: Any, **answers: Any) -> dict[str, Any]:
        """The keys of an ``[[agent]]`` table, and ``initial`` with the boxes by name."""
        described: dict[str, Any] = {"order": self.order, "f": self._f_text(), "b": self.b, "cost": cost, **answers}
        if self.zero_dynamics:
            described["zero_dynamics"] = {str(name): rate for name, rate in self.zero_dynamics.items()}
        if self.parameters:
            described["uncertain"] = {str(name): (side.lo, side.hi) for name, side in self.parameters.items()}
        if self.exosystem.states:
            described[OWN_EXOSYSTEM] = self.exosystem
        if self.box:
            described["initial"] = {str(name): side for name, side in self.box.items()}
        return described

    def _f_text(self) -> str:
        """``f`` with a vanishing term for every condition it has lost."""
        has = {(guard.expression, guard.need) for guard in guards(self.f)}
        lost = [guard for guard in self.guards if (guard.expression, guard.need) not in has]
        terms = [
            f" + 0/({expression_text(guard.expression)})"
            if guard.need == "nonzero"
            else f" + 0*log({expression_text(guard.expression)})"
            for guard in lost
        ]
        return expression_text(self.f) + "".join(dict.fromkeys(terms))


def normal_form(model: AffineModel) -> NormalForm:
    """The normal form of a model. Raises ``InputError`` with the reason where none was found."""
    field = _Field(model)
    chain = field.chain()
    gain = chain.gain
    free = gain.free_symbols - set(model.parameters)
    if free:
        names = ", ".join(sorted(map(str, free)))
        raise InputError(
            f"the input acts through {gain}, which depends on {names}, and in the normal form b depends on parameters "
            "only: take the product as the input, and divide by the factor in the implementation if it is known there"
        )
    if nonvanishing(gain, model.box).verdict != "holds":
        raise InputError(f"the input acts through {gain}, which may vanish for parameters in their box")
    tried = 0
    reason = ""
    for candidates in islice(field.zero_coordinates(chain), MOST_CHOICES):
        tried += 1
        found = _form(field, chain, candidates)
        if isinstance(found, NormalForm):
            return found
        reason = reason or found
    if not tried:
        reason = "no functions were found that the input does not act on and that complete the coordinates"
    raise InputError(f"no normal form was found: {reason}")


@dataclass(frozen=True)
class _Chain:
    """``h, L_F h, …, L_F^(n−1) h``, then ``L_F^n h`` and ``L_g L_F^(n−1) h``."""

    outputs: tuple[sympy.Expr, ...]
    last: sympy.Expr
    gain: sympy.Expr


class _Field:
    """The vector fields of a model whose states have names that clash with nothing."""

    def __init__(self, model: AffineModel) -> None:
        self.model = model
        self.old = tuple(sympy.Dummy(state.name, real=True) for state in model.states)
        names = dict(zip(model.states, self.old, strict=True))
        rates = [rate.xreplace(names) for rate in model.rates]
        self.g = [tidy(sympy.diff(rate, INPUT)) for rate in rates]
        if any(INPUT in entry.free_symbols for entry in self.g):
            raise InputError("the model is not affine in u")
        self.f = [tidy(rate.xreplace({INPUT: sympy.Integer(0)})) for rate in rates]
        self.h = model.output.xreplace(names)
        self.guards = [guard for rate in rates for guard in guards(rate)] + [
            Guard(guard.expression.xreplace(names), guard.need, guard.owner) for guard in model.guards
        ]
        disturbance = sympy.Matrix(list(model.disturbances))
        self.outside = list(model.S * disturbance) if model.disturbances else []

    def along_f(self, expr: sympy.Expr) -> sympy.Expr:
        """``L_F``: along ``f``, and along ``S v`` in the disturbance."""
        own = [sympy.diff(expr, state) * rate for state, rate in zip(self.old, self.f, strict=True)]
        outside = zip(self.model.disturbances, self.outside, strict=True)
        return tidy(sympy.Add(*own, *(sympy.diff(expr, v) * rate for v, rate in outside)))

    def along_g(self, expr: sympy.Expr) -> sympy.Expr:
        """``L_g``; 0 where that is proved."""
        found = tidy(sympy.Add(*(sympy.diff(expr, state) * g for state, g in zip(self.old, self.g, strict=True))))
        verdict = zero_test(found).verdict
        if verdict == "unknown":
            raise InputError(f"whether the input acts on an output derivative is not decided: is {found} zero?")
        return sympy.Integer(0) if verdict == "holds" else found

    def chain(self) -> _Chain:
        outputs = [self.h]
        while True:
            gain = self.along_g(outputs[-1])
            after = self.along_f(outputs[-1])
            if gain != 0:
                names = dict(zip(self.old, self.model.states, strict=True))
                return _Chain(tuple(outputs), after, gain.xreplace(names))
            if len(outputs) == len(self.old):
                raise InputError("the input does not act on the output: none of its derivatives has u")
            outputs.append(after)

    def zero_coordinates(self, chain: _Chain) -> Iterator[tuple[sympy.Expr, ...]]:
        """Sets of functions that ``u`` does not act on and that make coordinates together with the chain's."""
        count = len(self.old) - len(chain.outputs)
        if count == 0:
            yield ()
            return
        box = self.model.box
        plain = [state for state, g in zip(self.old, self.g, strict=True) if g == 0]
        pivots = [
            (state, g)
            for state, g in zip(self.old, self.g, strict=True)
            if g != 0 and not g.free_symbols & set(self.old) and nonvanishing(g, box).verdict == "holds"
        ]
        mixed = []
        for pivot, g in pivots[:1]:
            for state, other in zip(self.old, self.g, strict=True):
                ratio = tidy(other / g)
                if state != pivot and other != 0:
                    reach = ratio.free_symbols & set(self.old)
                    if not reach:
                        mixed.append(state - ratio * pivot)
                    elif reach <= set(plain):
                        mixed.append(state - ratio * pivot if pivot not in reach else state)
        for chosen in combinations([*plain, *mixed], count):
            if all(self.along_g(expr) == 0 for expr in chosen) and self._independent((*chain.outputs, *chosen)):
                yield chosen

    def _independent(self, functions: Sequence[sympy.Expr]) -> bool:
        """Whether the Jacobian is regular at some point, a necessary condition that costs little."""
        jacobian = sympy.Matrix(functions).jacobian(self.old)
        names = sorted(jacobian.free_symbols, key=str)
        point = {name: sympy.Rational(2 * k + 3, 7 + k) for k, name in enumerate(names)}
        box = self.model.box
        for name in names:
            if name in box:
                middle = (box[name].lo + box[name].hi) / 2
                point[name] = sympy.Rational(middle.numerator, middle.denominator)
        return bool(abs(complex(sympy.N(jacobian.xreplace(point).det()))) > 1e-12)


def _form(field: _Field, chain: _Chain, zero: Sequence[sympy.Expr]) -> NormalForm | str:
    """The normal form with these functions as ``z``, or why it is none."""
    model = field.model
    n = len(chain.outputs)
    xs = [symbol(f"x{k}") for k in range(1, n + 1)]
    zs = _zero_names(model, len(zero))
    change = dict(zip([*xs, *zs], [*chain.outputs, *zero], strict=True))
    inverse = global_inverse(change, field.old, model.box)
    if inverse is None:
        shown = "; ".join(f"{new} = {_named(expr, field)}" for new, expr in change.items())
        return f"the change of coordinates {shown} is not shown to be global with an inverse in closed form"
    rates = [tidy(field.along_f(expr).xreplace(inverse)) for expr in zero]
    shifted = _shifted(rates, zs, xs)
    if isinstance(shifted, str):
        return shifted
    rates, shift = shifted
    moved = {z: z + part for z, part in zip(zs, shift, strict=True)}
    inverse = {old: tidy(expr.xreplace(moved)) for old, expr in inverse.items()}
    outputs = dict(zip(xs, chain.outputs, strict=True))
    zero = [expr - part.xreplace(outputs) for expr, part in zip(zero, shift, strict=True)]
    names = dict(zip(field.old, model.states, strict=True))
    coordinates = {new: expr.xreplace(names) for new, expr in zip([*xs, *zs], [*chain.outputs, *zero], strict=True)}
    start = dict(zip(model.states, model.initial, strict=True)) if model.initial else {}
    sides = {**start, **model.box, **dict(zip(model.disturbances, model.disturbance_box, strict=True))}
    kept = [Guard(tidy(g.expression.xreplace(inverse)), g.need, g.owner) for g in field.guards]
    return NormalForm(
        order=n,
        zero_dynamics=dict(zip(zs, rates, strict=True)),
        f=tidy(chain.last.xreplace(inverse)),
        b=chain.gain,
        coordinates=coordinates,
        inverse={names[old]: expr for old, expr in inverse.items()},
        box={new: hull(expr, sides) for new, expr in coordinates.items()} if start else {},
        parameters=model.box,
        guards=tuple(guard for guard in kept if guard.expression.free_symbols),
        exosystem=Exosystem(model.disturbances, model.S, model.disturbance_box),
    )


def _shifted(
    rates: Sequence[sympy.Expr], zs: Sequence[sympy.Symbol], xs: Sequence[sympy.Symbol]
) -> tuple[list[sympy.Expr], list[sympy.Expr]] | str:
    """The rates of ``z − P(x)`` that depend on ``z`` and ``x1`` only, and ``P``.

    A rate ``q + C(x_(k−1)) x_k`` loses its last term with ``P' = C``, since ``x_(k−1)' = x_k``.
    """
    shift = [sympy.Integer(0)] * len(zs)
    current = list(rates)
    for k in range(len(xs) - 1, 0, -1):
        slopes = [tidy(sympy.diff(rate, xs[k])) for rate in current]
        strangers = {*zs, *xs} - {xs[k - 1]}
        for z, rate, slope in zip(zs, current, slopes, strict=True):
            if slope.free_symbols & strangers:
                return (
                    f"{z}' = {rate} depends on {xs[k]}, and in the normal form the zero dynamics see the output alone; "
                    "a shift of z by a function of the output's derivatives does not remove it"
                )
        parts = [_integral(slope, xs[k - 1]) for slope in slopes]
        if any(part is None for part in parts):
            return f"the shift of z that removes {xs[k]} from its rate was not found in closed form"
        known = [part for part in parts if part is not None]
        moved = {z: z + part for z, part in zip(zs, known, strict=True)}
        current = [tidy(rate.xreplace(moved) - slope * xs[k]) for rate, slope in zip(current, slopes, strict=True)]
        shift = [before.xreplace(moved) + part for before, part in zip(shift, known, strict=True)]
        if any(zero_test(sympy.diff(rate, xs[k])).verdict != "holds" for rate in current):
            return f"whether the zero dynamics depend on {xs[k]} was not decided"
        current = [rate.xreplace({xs[k]: sympy.Integer(0)}) for rate in current]
    return current, shift


def _integral(slope: sympy.Expr, name: sympy.Symbol) -> sympy.Expr | None:
    """An antiderivative from 0, checked by its derivative."""
    if slope == 0:
        return sympy.Integer(0)
    found = sympy.integrate(slope, name)
    if found.has(sympy.Integral) or zero_test(sympy.diff(found, name) - slope).verdict != "holds":
        return None
    return tidy(found - found.xreplace({name: sympy.Integer(0)}))


def _zero_names(model: AffineModel, count: int) -> list[sympy.Symbol]:
    taken = {name.name for name in (*model.parameters, *model.disturbances)}
    free = (f"z{k}" for k in range(1, len(taken) + count + 1) if f"z{k}" not in taken)
    return [symbol(name) for name in islice(free, count)]


def _named(expr: sympy.Expr, field: _Field) -> str:
    return str(expr.xreplace(dict(zip(field.old, field.model.states, strict=True))))
