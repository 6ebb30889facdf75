"""A3 for a component of ``z*`` without closed form: the only zero of its ``f0``, known by an interval.

Section 1 of docs/certificate.md. The zero depends on ``s`` and ``w`` alone, hence not on time: in the identities of A5
it is one more unknown constant.
"""

from __future__ import annotations

from collections.abc import Mapping

from certify.checker import functions
from certify.checker.certificate import Root
from certify.checker.derivatives import gradient
from certify.checker.expressions import Node, evaluate, names_in
from certify.checker.intervals import Interval, between, enclose, hull
from certify.checker.subdivision import supremum, value_range
from certify.checker.verdict import Malformed, obligation, require

CUTS = 200


def bracket(root: Root) -> Interval:
    """The interval of the witness; nothing is proved about it yet."""
    if len(root.root) != 2 or root.root[0] > root.root[1]:
        raise Malformed("a root is known by an interval")
    return between(*root.root)


def prove_root(name: str, z: str, f0: Node, root: Root, optimum: Interval, w: Mapping[str, Interval]) -> None:
    """``f0(lo, s, w) ≥ 0 ≥ f0(hi, s, w)`` and ``∂f0/∂z < 0`` from 0 to there. Raises ``Rejected``.

    Then ``f0(·, s, w)`` has exactly one zero in ``[lo, hi]`` for every ``s`` in the enclosure of ``s*`` and every
    ``w``, which is smooth in ``s`` and ``w``; at ``s = 0`` the only zero between 0 and there is 0, by A0.
    """
    foreign = names_in(f0) - {z, "x1", *w}
    require(not foreign, f"{name}: A3: the zero of f0 depends on s and w only", found=sorted(foreign))
    whole, zero = bracket(root), Interval(0, 0)

    def slope(box: Mapping[str, Interval]) -> Interval:
        return gradient(f0, box, [z])[z]

    def value(box: Mapping[str, Interval]) -> Interval:
        found: Interval = evaluate(f0, box, enclose, functions.call)
        return found

    at = {"x1": optimum, **w}
    with obligation(f"{name}: A3: f0(lo, s, w) ≥ 0 ≥ f0(hi, s, w), ∂f0/∂z < 0"):
        steepest = supremum(slope, {**w, z: hull(zero, whole), "x1": hull(zero, optimum)}, names_in(f0), CUTS)
        at_low = value_range(value, {**at, z: enclose(root.root[0])}, names_in(f0), CUTS)
        at_high = value_range(value, {**at, z: enclose(root.root[1])}, names_in(f0), CUTS)
    require(steepest < 0, f"{name}: A3: ∂f0/∂z < 0 between 0 and z*", slope=steepest)
    require(at_low >= 0 and at_high <= 0, f"{name}: A3: f0(lo, s, w) ≥ 0 ≥ f0(hi, s, w)", at_lo=at_low, at_hi=at_high)
