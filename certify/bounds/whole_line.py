"""Rigorous bounds of a function over all of R: a compact middle by branch and bound, two tails by expansion."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fractions import Fraction
from math import gcd, lcm

import sympy
from flint import arb, ctx

from certify.bounds.balls import PRECISION, NonFiniteError, to_arb, upper
from certify.bounds.expansion import TailUnknown
from certify.bounds.suprema import Bound, lower_bound, upper_bound
from certify.bounds.tails import START, Tail, tail
from symbolic.constants import as_fraction, as_rational
from symbolic.plant import Interval

LATEST_CUT = Fraction(1 << 12)
DEFAULT_TOLERANCE = Fraction(1, 200)


@dataclass(frozen=True)
class LineBounds:
    """``lower <= f(s) <= upper`` for every real ``s``; None where no bound was proved, ``obstacle`` says why.

    ``reached_low`` (``reached_high``) is a value that is at least the infimum (at most the supremum): ``f`` takes a
    value at least as low (high), or tends to one; ``lowest_at`` is where it was lowest in the middle. ``limits``
    enclose the limit points of the tails that settle, ``diverges`` has the signs of the infinities the others tend to.
    """

    lower: Fraction | None
    upper: Fraction | None
    reached_low: Fraction | None
    reached_high: Fraction | None
    lowest_at: Fraction | None = None
    limits: tuple[Interval, ...] = ()
    diverges: tuple[int, ...] = ()
    obstacle: str = ""
    method: str = ""


def line_bounds(f: sympy.Expr, variable: sympy.Symbol, rtol: Fraction = DEFAULT_TOLERANCE) -> LineBounds:
    """Bounds of ``f`` over R, within about ``rtol`` of the infimum and supremum where the tails allow.

    ``f`` must be defined on all of R, else the middle reports an obstacle.
    """
    period = _period(f, variable)
    if period is not None:
        box = Interval(Fraction(0), period)
        return _combined(_middle(f, variable, box, rtol), (), f"one period, [0, {_short(period)}]")
    tails, obstacles = [], []
    for direction in (1, -1):
        try:
            tails.append(_settled_tail(f, variable, direction, rtol))
        except TailUnknown as obstacle:
            obstacles.append(f"as s → {'+' if direction > 0 else '−'}∞: {obstacle}")
    cuts = [found.start for found in tails] + [START]
    cut = max(cuts)
    found = _combined(_middle(f, variable, Interval(-cut, cut), rtol), tails, f"[−{cut}, {cut}] and two tails")
    if obstacles:
        return LineBounds(
            None,
            None,
            found.reached_low,
            found.reached_high,
            found.lowest_at,
            found.limits,
            found.diverges,
            "; ".join(obstacles),
            found.method,
        )
    return found


def _settled_tail(f: sympy.Expr, variable: sympy.Symbol, direction: int, rtol: Fraction) -> Tail:
    """The tail from far enough out that its bounds are close to its limits."""
    found = tail(f, variable, direction)
    while found.start < LATEST_CUT and not _is_settled(found, rtol):
        found = tail(f, variable, direction, 2 * found.start)
    return found


def _is_settled(found: Tail, rtol: Fraction) -> bool:
    if found.limit is None or found.lower is None or found.upper is None:
        return True
    slack = rtol / 2 * max(abs(found.limit.lo), abs(found.limit.hi), Fraction(1, 1000))
    return found.lower >= found.limit.lo - slack and found.upper <= found.limit.hi + slack


@dataclass(frozen=True)
class _Middle:
    low: Bound | None
    high: Bound | None
    obstacle: str


def _middle(f: sympy.Expr, variable: sympy.Symbol, box: Interval, rtol: Fraction) -> _Middle:
    try:
        domain = {variable: box}
        return _Middle(lower_bound(f, domain, rtol=rtol / 2), upper_bound(f, domain, rtol=rtol / 2), "")
    except (NonFiniteError, ValueError) as obstacle:
        return _Middle(None, None, f"on [{_short(box.lo)}, {_short(box.hi)}]: {obstacle}")


def _combined(middle: _Middle, tails: Iterable[Tail], method: str) -> LineBounds:
    lowers = [middle.low.value if middle.low else None]
    uppers = [middle.high.value if middle.high else None]
    reached_low = [middle.low.attained] if middle.low else []
    reached_high = [middle.high.attained] if middle.high else []
    limits: list[Interval] = []
    diverges: list[int] = []
    obstacles = [middle.obstacle] if middle.obstacle else []
    for found in tails:
        lowers.append(found.lower)
        uppers.append(found.upper)
        if found.limit is not None:
            limits.append(found.limit)
            reached_low.append(found.limit.hi)
            reached_high.append(found.limit.lo)
        if found.diverges:
            diverges.append(found.diverges)
        elif found.lower is None and found.upper is None:
            obstacles.append("the leading term of a tail has no definite sign")
    return LineBounds(
        _extreme(lowers, min),
        _extreme(uppers, max),
        min(reached_low, default=None),
        max(reached_high, default=None),
        next((value for _, value in middle.low.point), Fraction(0)) if middle.low else None,
        tuple(limits),
        tuple(diverges),
        "; ".join(obstacles),
        method,
    )


def _extreme(values: list[Fraction | None], choose: Callable[[list[Fraction]], Fraction]) -> Fraction | None:
    known = [value for value in values if value is not None]
    return choose(known) if len(known) == len(values) else None


def _period(f: sympy.Expr, variable: sympy.Symbol) -> Fraction | None:
    """An upper bound of a period where ``variable`` occurs only as ``k s + c``, ``k`` rational, in sin, cos and tan."""
    waves = [node for node in f.atoms(sympy.sin, sympy.cos, sympy.tan) if variable in node.free_symbols]
    if not waves or variable in f.xreplace({wave: sympy.Dummy() for wave in waves}).free_symbols:
        return None
    rates = []
    for wave in waves:
        rate = sympy.diff(wave.args[0], variable)
        if not isinstance(rate, sympy.Rational):
            return None
        rates.append(abs(as_fraction(rate)))
    rates = [rate for rate in rates if rate]
    if not rates:
        return None
    common = Fraction(gcd(*(rate.numerator for rate in rates)), lcm(*(rate.denominator for rate in rates)))
    with ctx.workprec(PRECISION):
        return upper(2 * arb.pi() / to_arb(common))


def _short(value: Fraction) -> str:
    return str(value) if value.denominator == 1 else str(sympy.Float(as_rational(value), 6))
