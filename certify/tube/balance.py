"""The default where nothing is required: of the gains whose input peaks at no more than twice the least gains' peak,
and whose feedback and observer are at most three times as fast, those that settle soonest, without ringing where that
can be had, until the loop waits for its reference alone."""

from __future__ import annotations

from collections.abc import Callable
from math import hypot, inf, log

from certify.tube.performance import Performance, Performances
from certify.tube.requirements import Descent, reference_settled
from certify.tube.trial import AgentTrials, Trial
from symbolic.plant import RequestedGains

MOST_TRIALS = 24  # about as many as the search has made before
INPUT = 2.0  # times the peak of the least gains: what a soon settled output may cost
SPEED = 3.0  # times K and the observer's poles of the least gains: what a sensor's noise and a sampler have to bear
BAND = 0.01  # of the error at the start: the usual band of settling times
COMPARABLE = 1.25  # times the reference's settling time: nothing is gained by a faster loop
DAMPING = 0.5  # of the dominant modes: the overshoot of a second order is 16 % then
DOMINANT = 3.0  # modes that decay at most so many times as fast as the slowest
RINGING = 0.5  # what a damping of 0 costs, in the logarithm of the settling time


def balanced(
    trials: AgentTrials,
    least: Trial,
    requested: RequestedGains,
    report: Callable[[str], None] = lambda message: None,
) -> tuple[Trial, str]:
    """From the least gains; at worst they are what comes out. The reason is given in words."""
    performances = Performances(trials.model, trials.surroundings)
    descent = Descent(trials, performances, requested, report, most=MOST_TRIALS)
    start = descent.measured(least)
    band, limit = BAND * start.first_error, INPUT * start.peak
    soonest = max(reference_settled(performances, band), 0.0)

    def score(trial: Trial, found: Performance) -> float:
        if found.peak > limit or trial.gains.K > SPEED * least.gains.K or found.pole > SPEED * start.pole:
            return inf
        time = found.settled(band)
        late = log(max(time / (COMPARABLE * soonest), 1.0)) if soonest > 0 else log(time) if time > 0 else -inf
        return late + RINGING * max(DAMPING - damping(trial), 0.0) / DAMPING

    best, found = descent.down(least, score, 0.0)
    if best is least:
        return least, "the least gains: none settle sooner at twice their peak of the input and three times their speed"
    ratio = start.settled(band) / max(found.settled(band), 1e-300)
    return (
        best,
        f"settles {ratio:.2g} times as soon as the least gains, at {found.peak / start.peak:.2g} times their input",
    )


def damping(trial: Trial) -> float:
    """The least damping ratio of the nominal loop's dominant modes."""
    decay, frequency = trial.modes.decay, trial.modes.frequency
    slowest = float(decay.min())
    pairs = zip(decay.tolist(), frequency.tolist(), strict=True)
    return min(sigma / hypot(sigma, omega) for sigma, omega in pairs if sigma <= DOMINANT * slowest)
