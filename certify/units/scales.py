"""Units as factors, and what each quantity of an agent is multiplied by (docs/units.md section 1)."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

Row = tuple[Fraction, ...]
ONE = Fraction(1)


@dataclass(frozen=True)
class Scales:
    """``t = T t̂``, ``y = Y ŷ`` (so ``x_k = Y T^(1−k) x̂_k``), ``z_j = Z_j ẑ_j``, ``u = U û``; ``v`` and ``w`` stay.

    Every property is the factor by which a quantity in these units (with a hat) is multiplied to be in the others.
    """

    time: Fraction
    output: Fraction
    zeros: Row
    input: Fraction
    order: int

    @property
    def inverse(self) -> Scales:
        """From the others to these."""
        return Scales(1 / self.time, 1 / self.output, tuple(1 / z for z in self.zeros), 1 / self.input, self.order)

    @property
    def rate(self) -> Fraction:
        """Of ``g``, ``h``, ``M``, ``N``, ``S`` and decay rates."""
        return 1 / self.time

    @cached_property
    def chain(self) -> Row:
        """Of ``x_1 … x_n``."""
        return tuple(self.output * self.time ** (1 - k) for k in range(1, self.order + 1))

    @property
    def last(self) -> Fraction:
        """Of ``x_n``, ``ϑ`` and all ``e_k = h^(n−k)(x_k − x̃_k)``."""
        return self.chain[-1]

    @property
    def force(self) -> Fraction:
        """Of ``f`` and ``bu``, what ``x_n'`` is."""
        return self.last / self.time

    @property
    def b(self) -> Fraction:
        return self.force / self.input

    @property
    def K(self) -> Fraction:
        return self.input / self.last

    @property
    def outputs(self) -> Row:
        """Of ``z̄, x̄, ϑ̃, υ`` (docs/certificate-direct.md section 1)."""
        return (*self.zeros, *self.chain, self.last, self.input)

    def states(self, internal: int) -> Row:
        """Of ``X = (z̄, x̄, η̄, e)``; the ``internal`` states of the internal model have the unit of ``u``."""
        observer = (self.last,) * self.order if self.order > 1 else ()
        return (*self.zeros, *self.chain, *(self.input,) * internal, *observer)

    def starts(self, internal: int) -> Row:
        """Of ``Y = (z̄, x̄_1 … x̄_(n−1), ϑ, ζ, e)``: as ``X``, since ``ϑ`` is measured like ``x_n`` and ``ζ`` like
        ``η``."""
        return self.states(internal)

    def columns(self, internal: int) -> Row:
        """Of what multiplies a column of ``J``: ``q_k`` times a time, ``q_f`` times a time, ``q_y`` times a time, then
        the ``Y_l``."""
        return (*self.zeros, self.last, self.output, *self.starts(internal))

    @property
    def phase1(self) -> Row:
        """Of ``ẑ, x̂, ϑ̂``; the ``ζ̂`` after them have the unit of the input."""
        return (*self.zeros, *self.chain, self.last)

    @property
    def is_trivial(self) -> bool:
        return self.time == self.output == self.input == ONE and all(z == ONE for z in self.zeros)


def unscaled(order: int, zeros: int) -> Scales:
    """The units that the plant file is written in."""
    return Scales(ONE, ONE, (ONE,) * zeros, ONE, order)
