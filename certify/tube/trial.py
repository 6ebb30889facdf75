"""One trial of given gains: loop, modes, kernels, peaking, tube; the saturation level follows
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
from certify.tube.peaking import InitialMagnitudes, ObserverNorm, Peaked, initial_magnitudes, observer_norms, peaking
from certify.tube.ranges import Range
from certify.tube.supersolution import Comparison, Feedback, Tube, TubeFailure, tube
from certify.tube.surroundings import Surroundings

NOMINAL_BITS = 8
DURATIONS = (0.0, 6.0, 9.0, 11.0, 13.0, 15.0, 17.0, 20.0, 26.0, 34.0, 44.0, 60.0)
DELTA_MARGIN = 1.05
DELTA_ROUNDS = 8
LARGEST_LEVEL = 50


@dataclass(frozen=True)
class Trial:
    """Everything a certificate needs about one agent, in floats except what the claim and the proof fix exactly."""

    gains: LoopGains
    delta: Fraction
    nominal: Nominal
    modes: Modes
    kernels: Kernels
    peaked: Peaked
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
        self.observer_norms: tuple[ObserverNorm, ...] = ()
        if model.order > 1:
            self.observer_norms = observer_norms(observer_matrix(model.observer))

    def attempt(self, gains: LoopGains, delta: Fraction | None = None) -> Trial | TrialFailure:
        """Try one set of gains; a ``delta`` that is left free is made as small as the tube allows."""
        loop = nominal_loop(self.model, gains, self.nominal)
        found = modes(loop)
        if found is None:
            return TrialFailure(gains, "the nominal loop is not stable")
        majorants = kernels(found, len(loop.columns))
        comparison = Comparison(majorants, self.increments, self._feedback(gains))
        if not np.all(np.isfinite(majorants.coefficients)):
            return TrialFailure(gains, "the kernels of the nominal loop could not be bounded")
        level = float(delta) if delta is not None else float(gains.K) * self._estimate(gains)
        for _ in range(DELTA_ROUNDS):
            peaked = self._peaked(comparison, gains, level)
            if isinstance(peaked, str):
                return TrialFailure(gains, peaked)
            result = tube(comparison, self.surroundings, peaked.state, peaked.duration)
            if isinstance(result, TubeFailure):
                return TrialFailure(gains, f"at t = {result.time:.4g}: {result.reason}")
            needed = float(gains.K) * float(result.peak[comparison.plant])
            if needed <= level:
                bound = delta if delta is not None else _short_up(level)
                return Trial(gains, bound, self.nominal, found, majorants, peaked, result)
            if delta is not None:
                return TrialFailure(gains, f"the saturation level {level:.4g} is reached: the tube needs {needed:.4g}")
            level = needed * DELTA_MARGIN
            if level > LARGEST_LEVEL * float(gains.K) * self._estimate(gains):
                break
        return TrialFailure(gains, "the saturation level and the peaking phase chase each other: h/K is too small")

    def _feedback(self, gains: LoopGains) -> Feedback:
        zeros = self.increments.zeros
        f0 = np.array([[float(x) for x in row] for row in self.nominal.f0]).reshape(zeros, zeros + 1)
        return Feedback(f0, np.array([float(x) for x in self.nominal.f1]), float(self.nominal.b), float(gains.K))

    def _peaked(self, comparison: Comparison, gains: LoopGains, level: float) -> Peaked | str:
        """The state after the peaking phase of the length that leaves the least ``|ϑ̃|``, for the saturation level
        ``level``."""
        if self.model.order == 1:
            return Peaked(0.0, np.concatenate([self.initial.z, self.initial.x, self.initial.eta]))
        if not self.observer_norms:
            return "no norm of the observer error was proved"
        assert gains.h is not None
        h, best = float(gains.h), None
        bound = float(_short_up(level))
        for scaled in DURATIONS:
            for found in peaking(
                self.increments, self.surroundings, self.initial, self.observer_norms, h, bound, _dyadic(scaled / h)
            ):
                left = float(comparison.start(found.state)[comparison.plant].sum())
                best = (left, found) if best is None or left < best[0] else best
        return "the state escapes during the peaking phase" if best is None else best[1]

    def _estimate(self, gains: LoopGains) -> float:
        n = self.model.order
        weights = [float(gains.g) ** (n - k) * float(self.model.gamma[k - 1]) for k in range(1, n)] + [1.0]
        return float(np.array(weights) @ self.initial.x)


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
