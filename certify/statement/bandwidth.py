"""How fast the certified observers are, and the sampling rate this asks for. Floats: estimates, nothing is proved."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

SAMPLES_PER_PERIOD = (10, 20)
_SAME = 1e-3


@dataclass(frozen=True)
class Bandwidth:
    """``poles``: ``(pole, multiplicity)`` in rad/s, the fastest first; ``fastest`` is its modulus in rad/s."""

    poles: tuple[tuple[complex, int], ...]
    fastest: float

    @property
    def hertz(self) -> float:
        return self.fastest / (2 * math.pi)

    @property
    def sampling(self) -> tuple[float, float]:
        """Hz: 10 and 20 samples per period of the fastest pole, a rule of thumb."""
        least, most = SAMPLES_PER_PERIOD
        return least * self.hertz, most * self.hertz


def observer_bandwidth(observer: Sequence[Fraction], h: Fraction) -> Bandwidth:
    """The roots of ``s^n + c_n s^(n−1) + … + c_1``, ``observer = (c_1 … c_n)``, times ``h``.

    Roots closer than a thousandth of their size count as one: that is how far rounding parts a multiple root.
    """
    coefficients = [1.0, *(float(c) for c in reversed(observer))]
    groups: list[list[complex]] = []
    for root in sorted(np.roots(coefficients), key=lambda root: (-abs(root), root.real, root.imag)):
        near = next((group for group in groups if abs(group[0] - root) <= _SAME * abs(root)), None)
        if near is None:
            groups.append([complex(root)])
        else:
            near.append(complex(root))
    scale = float(h)
    poles = tuple((_clean(sum(group) / len(group)) * scale, len(group)) for group in groups)
    return Bandwidth(poles, max(abs(pole) for pole, _ in poles))


def _clean(root: complex) -> complex:
    return complex(root.real, 0.0) if abs(root.imag) <= _SAME * abs(root) else root
