"""Gains in words, in the units of the plant file."""

from __future__ import annotations

from fractions import Fraction

from certify.tube.loop import LoopGains
from certify.units.scales import Scales

LONGEST = 9  # characters of a fraction that is said exactly


def in_words(gains: LoopGains, scales: Scales) -> str:
    g = "" if gains.h is None else f"g = {short(gains.g * scales.rate)}, "
    h = "" if gains.h is None else f", h = {short(gains.h * scales.rate)}"
    return f"{g}K = {short(gains.K * scales.K)}{h}"


def short(value: Fraction) -> str:
    """Exact where that is short."""
    exact = str(value)
    return exact if len(exact) <= LONGEST else f"{float(value):.5g}"
