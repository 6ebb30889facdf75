"""What a check says: a verdict, a reason, and evidence that can be written as JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Literal

import sympy

from symbolic.answers import Answer, Rows, agents_named
from symbolic.plant import Interval

Verdict = Literal["holds", "fails", "unknown"]
Json = None | bool | int | str | Sequence["Json"] | Mapping[str, "Json"]


@dataclass(frozen=True)
class Finding:
    """The verdict on one assumption, for one agent or (``agent is None``) for the network.

    ``evidence`` holds exact numbers as strings: what a proof rests on, the witness of a failure, or what was tried.
    """

    id: str
    agent: int | None
    verdict: Verdict
    reason: str
    evidence: Mapping[str, Json] = field(default_factory=dict, hash=False)

    def as_json(self) -> dict[str, Json]:
        """One entry of ``assumptions`` in ``check --json`` (spec.md, command line)."""
        return {
            "id": self.id,
            "agent": self.agent,
            "verdict": self.verdict,
            "reason": self.reason,
            "evidence": dict(self.evidence),
        }


def unless_holds(verdict: str) -> Verdict:
    """The verdict of something that was not proved: ``fails`` if that was proved, else ``unknown``."""
    return "fails" if verdict == "fails" else "unknown"


@dataclass(frozen=True, repr=False)
class CheckReport(Answer):
    """All findings of a plant, in the order A0 … A6 and, within each, of the agents."""

    findings: tuple[Finding, ...]

    @property
    def status(self) -> Verdict:
        """``fails`` if any finding fails, else ``unknown`` if any is, else ``holds``."""
        verdicts = {finding.verdict for finding in self.findings}
        if "fails" in verdicts:
            return "fails"
        return "unknown" if "unknown" in verdicts else "holds"

    def rows(self) -> Rows:
        """One row per reason, with the agents it is true of."""
        same: dict[tuple[str, Verdict, str], list[int]] = {}
        for finding in self.findings:
            ids = same.setdefault((finding.id, finding.verdict, finding.reason), [])
            ids += [] if finding.agent is None else [finding.agent]
        head = ("assumption", "of", "verdict", "reason")
        return [head, *((name, agents_named(ids), verdict, why) for (name, verdict, why), ids in same.items())]

    def said(self) -> list[str]:
        rows = self.rows()[1:]
        width = max((len(row[1]) for row in rows), default=0)
        lines = [f"{name}  {where:<{width}}  {verdict:<7}  {reason}" for name, where, verdict, reason in rows]
        return [*lines, f"assumptions: {self.status}"]

    def of(self, assumption: str, agent: int | None = None) -> Finding:
        """The finding on one assumption. Raises KeyError when there is none."""
        for finding in self.findings:
            if finding.id == assumption and finding.agent == agent:
                return finding
        raise KeyError((assumption, agent))

    def as_json(self) -> dict[str, Json]:
        """The object ``check --json`` prints."""
        return {"status": self.status, "assumptions": [finding.as_json() for finding in self.findings]}


def exact(value: Fraction | int | sympy.Expr) -> str:
    """An exact number (or expression) as a string: ``p/q``, or SymPy's own notation."""
    return str(value)


def interval_text(interval: Interval) -> list[str]:
    """``[lo, hi]`` as strings."""
    return [str(interval.lo), str(interval.hi)]


def point_text(point: Mapping[sympy.Symbol, object]) -> dict[str, str]:
    """A witness point, by the names of its coordinates."""
    return {symbol.name: str(value) for symbol, value in point.items()}
