"""One trial of given gains: loop, modes, kernels, reaching phase, tube; the saturation level follows
(docs/certificate-direct.md)."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from certify.agent_model import AgentModel
from certify.coordinator.envelope import Envelope
from certify.recipe.matrices import observer_matrix
from certify.tube.increments import Increments, Slopes
from certify.tube.kernels import Kernels, kernels
from certify.tube.loop import LoopGains, Nominal, nominal_loop
from certify.tube.modes import Modes, modes
from certify.tube.observer_error import ObserverDecay, ObserverError, observer_decay
from certify.tube.ranges import Range
from certify.tube.reaching import InitialMagnitudes, Reached, Reaching, Stuck, initial_magnitudes
from certify.tube.supersolution import Comparison, Feedback, Tube, TubeFailure, tube
from certify.tube.surroundings import Surroundings

NOMINAL_BITS = 8
DELTA_MARGIN = 1.12
DELTA_GROWTH = 1.4
NEARLY = 0.6
FAR = 3.0
LARGEST_GAIN = Fraction(10) ** 15
DELTA_ROUNDS = 16
FIRST_LEVEL = 1 / 16
LARGEST_LEVEL = 20


@dataclass(frozen=True)
class Trial:
    """Everything a certificate needs about one agent, in floats except what the claim and the proof fix exactly."""

    gains: LoopGains
    delta: Fraction
    nominal: Nominal
    modes: Modes
    kernels: Kernels
    reached: Reached
    tube: Tube


@dataclass(frozen=True)
class TrialFailure:
    """The block that fails for these gains."""

    gains: LoopGains
    reason: str


class AgentTrials:
    """What does not depend on the gains is prepared once."""

    def __init__(self, model: AgentModel, envelope: Envelope, index: int) -> None:
        self.model = model
        self.surroundings = Surroundings(model, envelope, index)
        self.increments = Increments(model)
        self.initial: InitialMagnitudes = initial_magnitudes(model, self.surroundings)
        self.nominal = _nominal(self.increments, self.surroundings)
        self.levels: dict[Fraction, float] = {}
        self.observer: ObserverDecay | None = None
        if model.order > 1:
            self.observer = observer_decay(observer_matrix(model.observer))

    def attempt(self, gains: LoopGains, delta: Fraction | None = None) -> Trial | TrialFailure:
        """Try one set of gains; a ``delta`` that is left free is made as small as the tube allows."""
        given = [gains.g, gains.K, *(extra for extra in (gains.h, delta) if extra is not None)]
        if max(given) > LARGEST_GAIN:
            return TrialFailure(gains, f"gains above {float(LARGEST_GAIN):.0e} are beyond the search's floats")
        loop = nominal_loop(self.model, gains, self.nominal)
        found = modes(loop)
        if found is None:
            return TrialFailure(gains, "the nominal loop is not stable")
        majorants = kernels(found, len(loop.columns))
        comparison = Comparison(majorants, self.increments, self._feedback(gains))
        if not np.all(np.isfinite(majorants.coefficients)):
            return TrialFailure(gains, "the kernels of the nominal loop could not be bounded")
        K = float(gains.K)
        furthest = K * (float(self._theta(gains) @ self.initial.x) or 1.0)  # agents may start just where they are asked
        level = self._first_level(gains, furthest) if delta is None else float(delta)
        reason, latest = "", -1.0
        for _ in range(DELTA_ROUNDS):
            bound = _short_up(level) if delta is None else delta
            reached = self._reach(comparison, gains, float(bound))
            if isinstance(reached, Stuck):
                reason, needed = reached.reason, max(level * DELTA_GROWTH, NEARLY * K * reached.vartheta)
            else:
                highest = FAR * float(bound) / K
                result = tube(comparison, self.surroundings, reached.start, reached.known, reached.duration, highest)
                if isinstance(result, TubeFailure):
                    reason, needed = f"at t = {result.time:.4g}: {result.reason}", level * DELTA_GROWTH
                    if result.time <= latest:
                        break
                    latest = result.time
                else:
                    needed = K * float(result.peak[comparison.plant]) * (1 + 1e-9)
                    if needed <= float(bound):
                        self.levels[gains.g] = float(bound) / furthest
                        return Trial(gains, bound, self.nominal, found, majorants, reached, result)
                    reason = f"the saturation level {level:.4g} is reached: the tube needs {needed:.4g}"
                    needed *= DELTA_MARGIN
            level = needed
            if delta is not None or level > LARGEST_LEVEL * furthest:
                break
        return TrialFailure(gains, reason)

    def _first_level(self, gains: LoopGains, furthest: float) -> float:
        """Half of what passed with the same ``g`` before, in units of ``furthest``."""
        return furthest * max(FIRST_LEVEL, self.levels.get(gains.g, 0.0) / 2)

    def _feedback(self, gains: LoopGains) -> Feedback:
        zeros = self.increments.zeros
        f0 = np.array([[float(x) for x in row] for row in self.nominal.f0]).reshape(zeros, zeros + 1)
        return Feedback(f0, np.array([float(x) for x in self.nominal.f1]), float(self.nominal.b), float(gains.K))

    def _reach(self, comparison: Comparison, gains: LoopGains, delta: float) -> Reached | Stuck:
        """The phase in which the saturation may act, up to where the tube begins."""
        theta, error, time_constant = self._theta(gains), None, 1 / (float(gains.K) * float(self.nominal.b))
        if gains.h is not None:
            if self.observer is None:
                return Stuck("the observer is too slow or too fast to be followed", 0.0)
            scales = float(gains.h) ** np.arange(self.model.order - 1, -1, -1)
            error = ObserverError(self.observer, theta / scales, self.initial.estimate * scales, float(gains.h))
            time_constant = 1 / float(gains.h)
        phase = Reaching(
            self.increments,
            self.surroundings,
            self.initial,
            theta,
            float(gains.K),
            delta,
            float(self.nominal.b),
            error,
        )
        return phase.run(comparison.highest, time_constant)

    def _theta(self, gains: LoopGains) -> np.ndarray:
        """``ϑ = θ x̄``."""
        n = self.model.order
        return np.array([float(gains.g) ** (n - k) * float(self.model.gamma[k - 1]) for k in range(1, n)] + [1.0])


def _nominal(increments: Increments, surroundings: Surroundings) -> Nominal:
    """Middle slopes at rest, over every phase of the exosystem and all parameters."""
    zeros, order = increments.zeros, increments.order
    rest: Slopes = increments.slopes(np.zeros(zeros), np.zeros(order), surroundings.later())
    low, high = increments.b
    return Nominal(
        tuple(tuple(_middle(side) for side in row) for row in rest.f0),
        tuple(_middle(side) for side in rest.f1),
        _middle((low, high)),
    )


def _middle(side: Range) -> Fraction:
    return Fraction(round((side[0] + side[1]) / 2 * 2**NOMINAL_BITS), 2**NOMINAL_BITS)


def _short_up(value: float) -> Fraction:
    """A rational with 8 significant bits, not below ``value``."""
    mantissa, exponent = np.frexp(value)
    return Fraction(int(np.ceil(mantissa * 256))) * Fraction(2) ** (int(exponent) - 8)


def _dyadic(value: float) -> float:
    """A float with 12 significant bits."""
    mantissa, exponent = np.frexp(value)
    return float(np.ldexp(np.round(mantissa * 4096) / 4096, exponent))
