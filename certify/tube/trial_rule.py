"""How a trial chooses its saturation level and its steps: every number of it, with the reason."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction


@dataclass(frozen=True)
class TrialRule:
    """Shares and ratios, so none has a unit."""

    nominal_bits: int = 10
    """Significant bits of nominal slopes: what is rounded off is far below what parameters leave open."""
    nudges: tuple[Fraction, ...] = (Fraction(1, 24), Fraction(-1, 24), Fraction(1, 10))
    """Relative changes of nominal slopes that keep modes apart; the increments pay for them like for parameters."""
    delta_margin: float = 1.12
    """Over what a tube needed: with a higher level it needs a little more."""
    delta_growth: float = 1.4
    """From a level that does not do to the next one: two in an octave."""
    nearly: float = 0.6
    """Of the level that a first phase left: the next one saturates less, so less will do."""
    far: float = 3.0
    """Times the level: a tube that passes it will not come back below."""
    largest_gain: Fraction = Fraction(10) ** 15
    """In natural units; a float's last digit is then above one tenth."""
    delta_rounds: int = 16
    """Levels that are tried upwards: eight octaves."""
    tightenings: int = 3
    """Halvings of the logarithm of a factor of two: to within 9 %."""
    way_share: float = 1 / 8
    """Of the reference's way, which is a unit of ``ϑ`` where agents start at rest."""
    worth_it: float = 1.02
    """Ratio of times of escape below which a higher saturation level is no help."""
    first_level: float = 1 / 16
    """Of ``K |ϑ(0)|``, the unit of levels: rarely does a smaller one do."""
    largest_level: float = 20
    """Of the same: beyond it the saturation is not active at all."""
    coarse: tuple[float, ...] = (1 / 12, 1 / 16, 1 / 24, 1 / 32)
    """Steps of a tube that is checked sooner, as shares of the time so far."""
    blurred: float = 1 + 1 / 64
    """Ratio of peaks that count as the same; less than the rounding of what is shown."""
    later: float = 1.1
    """Ratio of settling times that count as the same."""
    larger_tail: float = 2.0
    """Ratio of tails that count as the same: they decay."""
    settled: tuple[float, ...] = (1 / 10, 1 / 100)
    """Shares of the peak at which settling is compared."""
