"""How the search for gains moves: every number of it, with the reason."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from certify.tube.ladder import Ladder


def _fractions(text: str) -> tuple[Fraction, ...]:
    return tuple(Fraction(entry) for entry in text.split())


TENTHS = Ladder(_fractions("1 9/8 5/4 45/32 3/2 55/32 15/8"))


@dataclass(frozen=True)
class SearchRule:
    """In the natural units of the agent, where what is followed has rates about 1 and the input gain is about 1
    (docs/units.md section 4): ``K`` is a rate there, and ``h/K`` a ratio of rates."""

    first_g: tuple[Fraction, ...] = _fractions("3 2 1")
    """A surface that is faster than the references leaves ``K`` small; below 1 it lags behind them."""
    larger_g: tuple[Fraction, ...] = _fractions("4 6 8")
    """Once something passes, a faster surface often takes a smaller ``K``; beyond 8 the observer's peak costs more."""
    ladder: Ladder = TENTHS
    """Rungs a tenth apart, which is about what a margin of the proof is worth; two short ones in each octave."""
    first_K: tuple[Fraction, ...] = _fractions("320 1280 80 4096 20 16384 5 131072 1")
    """Moderate gains first, then far ones on both sides in turn: small gains are reached as soon as large ones."""
    first_K_below_a_limit: tuple[Fraction, ...] = _fractions("5 10 20 40 80 160 320 640 1280 4096 16384 131072")
    """Upwards where the input's limit is given: small gains keep it more easily."""
    far: Fraction = Fraction(16384)
    """Far larger than what is tried first: if the tube escapes at the same time, the gains are not what makes it."""
    first_ratios: tuple[Fraction, ...] = _fractions("25 100 400")
    """``h/K``: an observer that is fast beside the loop passes most easily, and peaks most."""
    ratios: tuple[Fraction, ...] = _fractions("1 2 3 4 5 6 7 8 10 12 14 17 20 25 30 35 40 50 60 100 200 400 1000")
    """Finest where plants from papers end up, at 5 to 40."""
    least_K: Fraction = Fraction(1, 2)
    """A loop that is slower lags behind what it follows."""
    slower: Fraction = Fraction(1, 5)
    """Share of the certified rate that may be given up for a smaller ``K``: two steps of the shares that tails try."""
    first_stride: int = 4
    """Rungs of the first step down from gains that pass; the steps double until one fails."""
    rungs_above: int = 1
    """``h`` is also looked for with this many larger ``K``: the least product is often there."""
    most_trials: int = 66
    """Of first gains: some ten seconds."""
    agreeing: int = 3
    """Failures in a row before far larger gains are tried at once."""
    about: float = 1.1
    """Ratio of times of escape that count as the same."""
    a_little: Fraction = Fraction(5, 4)
    """How much more ``h`` is given for a smaller saturation level."""
    clearly_less: float = 0.95
    """Ratio of the levels that two designs need, below which the change is worth it."""
