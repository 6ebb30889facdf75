"""Ranges of the zero states themselves (docs/certificate-direct.md section 3): both ends outrun the flow (Müller)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction

from certify.checker import functions
from certify.checker.expressions import evaluate
from certify.checker.intervals import Interval, between, enclose
from certify.checker.linear import Matrix
from certify.checker.plant import Agent
from certify.checker.verdict import require


class ZeroRanges:
    """``R`` is piecewise linear in time: the initial box, then one entry per step, as far as they go."""

    def __init__(self, name: str, agent: Agent, ranges: Sequence[Matrix]) -> None:
        self.name, self.agent = name, agent
        self.ends = [agent.z_box, *ranges]

    def during(self, step: int) -> list[Interval] | None:
        """``[R]`` on the step, None if it is the whole line."""
        if step + 1 >= len(self.ends):
            return None
        return [between(min(a[0], b[0]), max(a[1], b[1])) for a, b in zip(*self.ends[step : step + 2], strict=True)]

    def prove(self, step: int, length: Fraction, box: Mapping[str, Interval]) -> None:
        """``box`` holds ``z, x1, v, w`` on the step. Raises ``Rejected``."""
        if step + 1 >= len(self.ends):
            return
        rows = zip(self.agent.zero_states, self.agent.zero_dynamics, *self.ends[step : step + 2], strict=True)
        for k, (name, f0, before, after) in enumerate(rows, 1):
            for end, side, sign in (("lo", 0, -1), ("hi", 1, 1)):
                a, b = before[side], after[side]
                face = {**box, name: between(min(a, b), max(a, b))}
                speed, needed = sign * (b - a) / length, sign * evaluate(f0, face, enclose, functions.call)
                require(
                    bool(needed <= speed),
                    f"{self.name}: ranges: step {step + 1}: R_{k}^{end} outruns z_{k}",
                    speed=speed,
                    needed=needed.upper,
                )
