"""What a route returns: a certificate, or the reason why there is none."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from certify.certificate import Json, write_certificate
from certify.statement.gains_table import gains_rows, gains_table
from symbolic.answers import Answer, Rows
from symbolic.controller import AgentController
from symbolic.errors import InputError

if TYPE_CHECKING:  # the solvers behind them need not be loaded to hold a result
    from certify.coordinator.design import CoordinatorDesign
    from certify.coordinator.envelope import Envelope
    from certify.gains.linear_stability import LinearVerdict

Status = Literal["certified", "refuted", "inconclusive"]


@dataclass(frozen=True)
class Alternative:
    """Another controller that was found for the same agent, with the reason for which it is named."""

    label: str
    reason: str
    controller: AgentController


@dataclass(frozen=True)
class AgentResult:
    """What was found for one agent; the dictionaries are empty when it has no certificate.

    ``constants`` ``ς1 … ς11`` and the Jacobian bounds, ``thresholds``
    ``g, K, mu, a, delta, T, h1, h2, h3, h, level, rate``,
    ``matrices`` ``V0, P1, P2, P3``, ``bounds`` of the error coordinates along the way, by name; which of them there are
    depends on the route: in direct those of the plant states hold for all time, ``vartheta`` and ``input`` from the end
    of phase 1 on. ``linear`` is the verdict of the necessary condition on requested gains.
    """

    id: int
    status: Status
    reason: str
    constants: dict[str, Fraction] = field(default_factory=dict)
    thresholds: dict[str, Fraction] = field(default_factory=dict)
    matrices: dict[str, tuple[tuple[Fraction, ...], ...]] = field(default_factory=dict)
    linear: LinearVerdict | None = None
    bounds: dict[str, Fraction] = field(default_factory=dict)
    alternatives: tuple[Alternative, ...] = ()


@dataclass(frozen=True, repr=False)
class GainsResult(Answer):
    """The outcome of a route: ``certificate`` is there iff ``status == "certified"``; ``summary`` has the JSON shape
    of spec.md."""

    status: Status
    reason: str
    route: str
    certificate: Json | None
    summary: dict[str, Any]
    agents: tuple[AgentResult, ...] = ()
    envelope: Envelope | None = None
    coordinator: CoordinatorDesign | None = None

    def said(self) -> list[str]:
        return [f"{self.status}: {self.reason}", *gains_table(self.summary["gains"])]

    def rows(self) -> Rows:
        return gains_rows(self.summary["gains"])

    def save(self, path: str | Path) -> None:
        """Write the certificate. Raises ``InputError`` where there is none, or it cannot be written."""
        if self.certificate is None:
            raise InputError(f"{path}: there is no certificate to write: {self.status}: {self.reason}")
        write_certificate(self.certificate, Path(path))
