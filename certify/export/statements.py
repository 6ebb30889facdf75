"""A step of the controller as text that C and Python read alike: sums and products, evaluated from left to right.

An expression holds names, ``+ - * /``, parentheses, calls of functions of one argument, and nothing else; no number
but the constants, which have names. Both printers keep the order of the operations, so that the same input gives the
same bits.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Let:
    """``name = expression``."""

    name: str
    expression: str
    meaning: str = ""


@dataclass(frozen=True)
class Clamp:
    """``name`` is ``source`` limited to ``±bound``."""

    name: str
    source: str
    bound: str
    meaning: str = ""


@dataclass(frozen=True)
class Quantise:
    """``name`` is the multiple of ``step`` nearest to ``source``, ties to even."""

    name: str
    source: str
    step: str
    meaning: str = ""


Statement = Let | Clamp | Quantise


def total(terms: Iterable[str]) -> str:
    """A sum from left to right."""
    return " + ".join(terms)
