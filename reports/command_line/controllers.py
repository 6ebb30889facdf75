"""The controllers that are simulated: that of a certificate, or one of moderate gains that certifies nothing."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

from symbolic.controller import Controller
from symbolic.plant import Plant

# moderate gains that settle the example (theory.md section 7, scale of the recipe), where the plant file fixes none
ALPHA, G, K, DELTA, H = Fraction(5), Fraction(5), Fraction(100), Fraction(1000), Fraction(500)


def certified_controller(certificate: Mapping[str, object], plant: Plant) -> Controller:
    raise NotImplementedError


def demonstration_controller(plant: Plant) -> Controller:
    raise NotImplementedError
