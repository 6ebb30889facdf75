"""Why a search found nothing: the trial that came furthest, and what was tried."""

from __future__ import annotations

from collections.abc import Sequence

from certify.gains.hurwitz_boundary import hurwitz_determinants
from certify.tube.loop import nominal_loop
from certify.tube.trial import AgentTrials, Stage, TrialFailure
from certify.tube.words import in_words, short


def explained(trials: AgentTrials, failed: Sequence[TrialFailure]) -> str:
    """The reason of the trial that came furthest, with its gains and the gains that were tried."""
    furthest = max(failed, key=lambda failure: failure.progress)
    if len(failed) == 1:
        return furthest.reason
    if furthest.progress[0] == Stage.LOOP and all(_unstable(trials, failure) for failure in failed):
        return f"the nominal loop is not stable with any of the gains that were tried ({_tried(trials, failed)})"
    return f"{furthest.reason} (with {in_words(furthest.gains, trials.model.units)}; {_tried(trials, failed)})"


def _tried(trials: AgentTrials, failed: Sequence[TrialFailure]) -> str:
    """How many, and the ranges of ``b``, ``K`` and ``h/K``."""
    scales, b = trials.model.units, trials.model.input_gain
    sides = [f"b in [{short(b.lo * scales.b)}, {short(b.hi * scales.b)}]"]
    K = [failure.gains.K * scales.K for failure in failed]
    sides.append(f"K from {short(min(K))} to {short(max(K))}")
    ratios = [failure.gains.h / failure.gains.K * scales.rate / scales.K for failure in failed if failure.gains.h]
    if ratios:
        sides.append(f"h/K from {short(min(ratios))} to {short(max(ratios))}")
    return f"the furthest of {len(failed)} trials, {', '.join(sides)}"


def _unstable(trials: AgentTrials, failure: TrialFailure) -> bool:
    """Exactly: a Hurwitz determinant of the nominal loop that is not positive."""
    if failure.progress[0] != Stage.LOOP:
        return False
    determinants = hurwitz_determinants(nominal_loop(trials.model, failure.gains, trials.nominal).A)
    return not all(minor > 0 for minor in determinants)
