"""Nominal slopes: near the middle of what the slopes can be at rest, with few bits (docs/certificate-direct.md
section 1). Any are right; the increments pay for what they are away from the true ones."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np

from certify.tube.increments import Increments
from certify.tube.loop import Nominal
from certify.tube.ranges import Range, magnitude
from certify.tube.surroundings import Surroundings


def middle_slopes(increments: Increments, surroundings: Surroundings, bits: int) -> Nominal:
    """Of the slopes at rest, over every phase of the exosystem and all parameters."""
    zeros, order = increments.zeros, increments.order
    rest = increments.slopes(np.zeros(zeros), np.zeros(order), surroundings.later())
    return Nominal(
        tuple(tuple(_middle(side, bits) for side in row) for row in rest.f0),
        tuple(_middle(side, bits) for side in rest.f1),
        _middle(increments.b, bits),
    )


def nudged(nominal: Nominal, nudge: Fraction) -> Nominal:
    """The slopes of the zero states in themselves, each changed by another relative amount, and that of ``f1`` in
    ``x_n``: two modes that agree move apart."""
    f0 = tuple(
        tuple(slope * (1 + (k + 1) * nudge) if j == k else slope for j, slope in enumerate(row))
        for k, row in enumerate(nominal.f0)
    )
    *rest, last = nominal.f1
    return replace(nominal, f0=f0, f1=(*rest, last * (1 - nudge / 2)))


def _middle(side: Range, bits: int) -> Fraction:
    """To ``bits`` significant bits of the larger end, so that a middle near zero is not spelled out."""
    middle, size = Fraction((side[0] + side[1]) / 2), magnitude(side)
    if size == 0:
        return Fraction(0)
    step = Fraction(2) ** (int(np.frexp(size)[1]) - bits)
    return round(middle / step) * step
