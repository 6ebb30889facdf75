"""The sections on gains: their table, the necessary condition, matrices, constants and thresholds, and the claim."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from certify.statement.claim import CertifiedGains
from certify.statement.numbers import fraction
from certify.statement.tube import Tube
from reports import cells, tables
from reports.coordinator_section import SYMBOLS
from reports.designs import chosen_designs
from reports.study import Study
from reports.typst_math import number
from symbolic.controller import COORDINATOR_KEYS
from symbolic.plant import RequestedGains

if TYPE_CHECKING:
    from certify.pipeline import AgentResult, GainsResult

MATRIX_UP_TO = 9


def gains_section(study: Study, certified: CertifiedGains | None, stands: bool) -> dict[str, Any] | None:
    """The table of gains: those of the summary or those of the certificate as read; level and rate where it stands."""
    summary = None if study.gains is None else (study.gains.summary or {}).get("gains")
    if summary:
        entries: list[Mapping[str, Any]] = list(summary.get("agents") or ())
        constants = [tables.exact(summary.get(name)) for name in COORDINATOR_KEYS]
    elif certified is not None:
        entries = [
            {"id": a.id, "g": a.g, "K": a.K, "delta": a.delta, "h": a.h, "level": a.level, "rate": a.rate}
            for a in certified.agents
        ]
        constants = list(certified.coordinator.named.values())
    else:
        return None
    if not entries:
        return None
    if not stands:
        entries = [{key: entry[key] for key in entry if key not in ("level", "rate")} for entry in entries]
    return {
        "bounded": stands,
        "shared": [
            f"{symbol} = {number(value)}" for symbol, value in zip(SYMBOLS, constants, strict=True) if value is not None
        ],
        "requested": any(gains != RequestedGains() for gains in study.plant.gains),
        "table": tables.gains_table(entries),
        "designs": [cells.text(line, 2000) for line in _designs(study)],
    }


def _designs(study: Study) -> list[str]:
    certificate = study.verified_certificate
    return [] if certificate is None else chosen_designs(study.plant, certificate["claim"])


def stability_rows(gains: GainsResult) -> list[list[cells.Cell]]:
    """The necessary condition on given gains (theory.md F20), one row per agent that has one."""
    rows = []
    for agent in gains.agents:
        linear = agent.linear
        if linear is None:
            continue
        rows.append(
            [
                cells.text(agent.id),
                {"badge": linear.status},
                cells.text(linear.reason),
                _determinant(linear.determinant_index, linear.determinant),
                cells.number(linear.smallest_h, "up"),
            ]
        )
    return rows


def _determinant(index: int | None, value: Fraction | None) -> cells.Cell:
    """``Δ_3 = −1.2e34``: the first Hurwitz determinant that is not positive."""
    return cells.text("–") if value is None else cells.math(f"Delta_({index or ''}) = {number(value)}")


def numbers_section(gains: GainsResult | None, certified: CertifiedGains | None) -> dict[str, Any]:
    """Matrices, coordinator, constants and thresholds."""
    agents = () if gains is None else gains.agents
    matrices: list[tuple[int, Mapping[str, Any]]] = [(agent.id, agent.matrices) for agent in agents if agent.matrices]
    if not matrices and certified is not None:
        matrices = [(agent.id, agent.matrices) for agent in certified.agents if agent.matrices]
    return {
        "matrices": tables.matrix_groups(matrices),
        "coordinator": _coordinator(gains, certified),
        "constants": tables.quantity_blocks([(a.id, a.constants) for a in agents if a.constants], tables.CONSTANTS),
        **_thresholds(agents, certified),
    }


def _thresholds(agents: Sequence[AgentResult], certified: CertifiedGains | None) -> dict[str, Any]:
    """The recipe's thresholds, or the proof data of the tube: never both."""
    tubes = [] if certified is None else [(a.id, _tube(a.tube)) for a in certified.agents if a.tube is not None]
    if tubes:
        return {"thresholds": [], "tube": tables.quantity_blocks(tubes, tables.TUBE)}
    found = [(agent.id, agent.thresholds) for agent in agents if agent.thresholds]
    return {"thresholds": tables.quantity_blocks(found, tables.THRESHOLDS), "tube": []}


def _tube(tube: Tube) -> dict[str, Fraction | None]:
    return {
        "T1": tube.reaching.grid[-1],
        "phase1_steps": Fraction(len(tube.reaching.boxes)),
        "mu1": tube.rates[0],
        "mum": tube.rates[-1],
        "kernel_rates": Fraction(len(tube.rates)),
        "steps": Fraction(len(tube.boxes)),
        "end": tube.grid[-1],
        "rho": tube.tail_rate,
    }


def _coordinator(gains: GainsResult | None, certified: CertifiedGains | None) -> dict[str, Any] | None:
    envelope = None if gains is None else gains.envelope
    if envelope is None and certified is None:
        return None
    facts: list[list[Any]] = []
    P, structured = None, certified is not None and not certified.P
    if certified is not None:
        facts = [
            ["Norm", cells.text(_norm_in_words(certified))],
            ["Decay rate $lambda_0$", cells.number(certified.norm["rate"], "down")],
            ["Mixing rate $hat(lambda)$", cells.number(certified.norm["mixing_rate"], "down")],
            ["Grid", cells.text(_grid(certified.norm))],
        ]
        P = cells.matrix(certified.P) if 0 < len(certified.P) <= MATRIX_UP_TO else None
    peaks = (
        []
        if envelope is None
        else [
            [cells.text(k), *(cells.number(value, "up") for value in (a.peak, a.rate_peak, a.energy, a.rate_energy))]
            for k, a in enumerate(envelope.agents, start=1)
        ]
    )
    return {"facts": facts, "P": P, "structured": structured, "peaks": peaks}


def _norm_in_words(certified: CertifiedGains) -> str:
    if certified.P:
        return f"a matrix of {len(certified.P)} × {len(certified.P)}"
    return f"structured, for {len(certified.left_null_vector)} agents (docs/coordinator.md, section 2)"


def _grid(norm: Mapping[str, Fraction]) -> str:
    return f"{norm['steps']} steps up to {fraction(norm['end'])} s"


def claim_section(study: Study, certified: CertifiedGains | None) -> dict[str, Any]:
    """Digest of the claim and the answer of the checker."""
    answer = study.verification
    sha256 = certified.sha256 if certified else (answer or {}).get("claim_sha256")
    checker = None
    if answer is not None:
        said = (
            "every obligation below was rebuilt and holds"
            if answer["status"] == "verified"
            else answer.get("reason") or "no reason given"
        )
        checker = {"status": answer["status"], "reason": cells.text(said, 800)}
    return {"sha256": sha256, "checker": checker}
