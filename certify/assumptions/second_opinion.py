"""What the tool proves the independent checker must see too: a finding that it does not share becomes ``unknown``.

The tool knows laws that the checker does not (``sin² + cos² = 1``, irrational oscillators), and a certificate rests on
the checker alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction

from certify.assumptions.findings import Finding
from certify.bounds.roots import root_brackets
from certify.certificate import expression
from certify.checker.certificate import Root
from certify.checker.intervals import Interval
from certify.checker.rules.assumptions import AgentProof, prove_exosystem, prove_network
from certify.checker.subdivision import CUTS
from certify.checker.verdict import Malformed, Rejected, Undecided, start_meter
from certify.foreseen import irrational_exosystem, plant_as_read, proved_cost
from certify.optimum import Optimum
from symbolic.internal_model import InternalModel
from symbolic.network import left_null_vector
from symbolic.plant import Plant
from symbolic.steady_state import SteadyState


class SecondOpinion:
    """The checker's rules about one plant file; ``optimum`` is as the checker can see it, None where A1 is open."""

    def __init__(self, plant: Plant, optimum: Optimum | None) -> None:
        self.plant, self.optimum = plant, optimum

    def on_network(self, finding: Finding) -> Finding:
        return self._on(
            finding, lambda: prove_network(plant_as_read(self.plant.source), left_null_vector(self.plant.digraph))
        )

    def on_exosystem(self, finding: Finding) -> Finding:
        return self._on(finding, self._exosystem)

    def on_cost(self, finding: Finding, number: int) -> Finding:
        advice = "another way to write the cost may do"
        return self._on(finding, lambda: proved_cost(self.plant.source, number), advice)

    def on_origin(self, finding: Finding, number: int) -> Finding:
        return self._on(finding, lambda: self._agent(number, (), ()).origin_and_input_gain())

    def on_steady_state(self, finding: Finding, number: int, found: SteadyState) -> Finding:
        def ask() -> None:
            proof = self._agent(number, self._steady_state(number, found), ())
            proof.regulator()
            proof.steady_state(proof.v, CUTS)

        return self._on(finding, ask)

    def on_steady_input(self, finding: Finding, number: int, found: SteadyState, model: InternalModel) -> Finding:
        def ask() -> None:
            ell = [entry for entry in model.ell if isinstance(entry, Fraction)]
            if len(ell) < model.order:
                raise Undecided("the generator of u* has irrational coefficients")
            self._agent(number, self._steady_state(number, found), ell).immersion()

        return self._on(finding, ask)

    def _on(self, finding: Finding, ask: Callable[[], object], advice: str = "") -> Finding:
        if finding.verdict != "holds" or not self.plant.source:  # nothing can be certified without a file
            return finding
        start_meter()
        try:
            ask()
        except Rejected as failure:
            doubt = f"{failure.obligation}: {failure.detail}"
        except (Malformed, Undecided) as reason:
            doubt = str(reason)
        else:
            return finding
        return replace(
            finding,
            verdict="unknown",
            reason=f"proved here, but the independent checker refuses it: {doubt}" + (f"; {advice}" if advice else ""),
        )

    def _exosystem(self) -> dict[str, Interval]:
        read = plant_as_read(self.plant.source)
        if not read.exosystem:
            return {}
        from certify.bounds.exosystem import ExosystemBounds, exosystem_bounds  # cvxpy takes a second to import

        irrational = irrational_exosystem(self.plant.exosystem)
        if irrational:
            raise Undecided(irrational)
        bounds = exosystem_bounds(self.plant.exosystem)
        if not isinstance(bounds, ExosystemBounds):
            raise Undecided(bounds.reason)
        if bounds.Q is None:
            raise Undecided("S keeps no quadratic form with rational entries")
        return prove_exosystem(read, [list(row) for row in bounds.Q])

    def _steady_state(self, number: int, found: SteadyState) -> list[str | Root]:
        agent = self.plant.agents[number - 1]
        sides = root_brackets(agent, found, self.optimum.enclosure) if self.optimum is not None else {}
        if isinstance(sides, str):
            raise Undecided(sides)
        return [
            Root((sides[z].lo, sides[z].hi)) if z in sides else expression(component)
            for z, component in zip(agent.zero_states, found.z_star, strict=True)
        ]

    def _agent(
        self, number: int, steady_state: Sequence[str | Root], ell: tuple[Fraction, ...] | list[Fraction]
    ) -> AgentProof:
        read = plant_as_read(self.plant.source)
        if read.S is None:  # A0 does not depend on it
            if steady_state or ell:
                raise Undecided("S is not rational")
            read = replace(read, S=[[Fraction(0)] * len(read.exosystem) for _ in read.exosystem])
        try:
            v = self._exosystem()
        except (Rejected, Undecided):  # which is A4's affair
            v = dict.fromkeys(read.exosystem, Interval(0, 0))
        around = self.optimum.enclosure if self.optimum is not None else None
        optimum = (Fraction(0), Fraction(0)) if around is None else (around.lo, around.hi)
        return AgentProof(read, read.agents[number - 1], steady_state, ell, optimum, v)
