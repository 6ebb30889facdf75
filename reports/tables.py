"""The report's tables as rows of cells: gains, assumptions, constants, thresholds, matrices."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any, TypeVar

from reports import cells, typst_math
from reports.cells import Cell
from symbolic.plant import Plant

if TYPE_CHECKING:
    from certify.assumptions.findings import CheckReport, Finding

AGENTS_PER_BLOCK = 5

Table = dict[str, Any]
Entry = TypeVar("Entry")

STATEMENTS = {
    "A0": "$f_0 (0, 0, 0, w) = 0$, $f_1 (0, 0, 0, w) = 0$, $b(w) >= b_min > 0$ on $WW$",
    "A1": "$0 < pi.alt_i <= c_i'' (s) <= l_i$ for all real $s$",
    "A2": "the digraph is strongly connected",
    "A3": "the regulator equation has a solution $z^star.op (s, v, w)$",
    "A4": "the eigenvalues of $S$ are semisimple with zero real part",
    "A5": "$u^star.op$ is a polynomial in $v$ with a finite generator",
    "A6": "the zero dynamics have a Lyapunov function $V_0$ with decay $a_0$",
}

CONSTANTS = {
    "varsigma1": ("sigma.alt_1", "$2 norm(V_0)$"),
    "varsigma2": ("sigma.alt_2", "$norm(partial f_0 \\/ partial x_1)$ on the level set"),
    "varsigma3": ("sigma.alt_3", "the same at $z = z^star.op$"),
    "varsigma4": ("sigma.alt_4", "$12 norm(P_2 N)^2 \\/ b_min^2$"),
    "varsigma5": ("sigma.alt_5", "$2$"),
    "varsigma6": ("sigma.alt_6", "$2 b_max^2 norm(Psi)^2$"),
    "varsigma7": ("sigma.alt_7", "growth of $hat(f)$ in $overline(z)$ and $hat(x)$ over $a_0$"),
    "varsigma8": ("sigma.alt_8", "$max{sigma.alt_4, sigma.alt_5, (1 + sum g^(n-k) gamma_k)^2}$"),
    "varsigma9": ("sigma.alt_9", "what $K$ must outweigh"),
    "varsigma10": ("sigma.alt_10", "factor of $tilde(y)^2$ in $dot(W)$"),
    "varsigma11": ("sigma.alt_11", "factor of $(dot(y)^r)^2$ in $dot(W)$"),
    "F_z": ("F_z", "$norm(partial f_1 \\/ partial z)$"),
    "F_x": ("F_x", "increments of $hat(f)$ in $hat(x)$"),
    "F_vartheta": ("F_theta.alt", "increments of $hat(f)$ in $theta.alt$"),
    "F_reference": ("sigma.alt_f", "$abs(partial f_1 \\/ partial x_1)$ at rest"),
    "weight_eta": ("omega_eta", "weight $sigma.alt_7 sigma.alt_8$"),
    "weight_vartheta": ("omega_theta.alt", "weight $4 sigma.alt_6 sigma.alt_7 sigma.alt_8$"),
}

TUBE = {
    "T1": ("T_1", "length of phase 1, where the feedback may saturate (s)"),
    "phase1_steps": ("j", "steps of phase 1"),
    "mu1": ("mu_1", "slowest rate of the kernels' majorants (1/s)"),
    "mum": ("mu_m", "fastest rate of the kernels' majorants (1/s)"),
    "kernel_rates": ("m", "number of rates"),
    "steps": ("k", "steps of the tube"),
    "end": ("t_k", "end of the grid (s)"),
    "rho": ("rho", "decay rate of the tail (1/s)"),
}

THRESHOLDS = {
    "g": ("g", "high gain of the stabiliser"),
    "K": ("K", "feedback gain"),
    "mu": ("mu", "weight of the coordinator's $V$"),
    "a": ("a", "dissipation on the level set"),
    "delta": ("delta", "saturation level"),
    "T": ("T", "length of phase 1 (s)"),
    "h1": ("h_1", "observer error small"),
    "h2": ("h_2", "observer error in time"),
    "h3": ("h_3", "decay of $W + W_e$"),
    "h": ("h", "observer gain"),
    "level": ("c", "level of $W$"),
    "rate": ("lambda", "decay rate (1/s)"),
}

GAINS = (("g", "g"), ("K", "K"), ("delta", "delta"), ("h", "h"), ("level", "c"), ("rate", "lambda"))


def gains_table(entries: Sequence[Mapping[str, Any]]) -> Table:
    """One row per agent of ``summary["gains"]["agents"]`` (exact numbers as strings or ``None``; spec.md)."""
    columns = [(key, sign) for key, sign in GAINS if any(entry.get(key) is not None for entry in entries)]
    return {
        "head": [cells.text("agent"), *(cells.math(sign) for _, sign in columns)],
        "rows": [
            [cells.text(entry["id"]), *(cells.number(exact(entry.get(key))) for key, _ in columns)] for entry in entries
        ],
    }


def exact(value: object) -> Fraction | None:
    """A number of a certificate or summary: a string ``p/q``, a ``Fraction`` or ``None``."""
    return (
        None if value is None else Fraction(value) if isinstance(value, int | str | Fraction) else Fraction(str(value))
    )


def assumptions_table(report: CheckReport) -> list[dict[str, Any]]:
    """The findings in order, those of several agents that say the same together."""
    groups: dict[tuple[str, str, str], list[Finding]] = {}
    for finding in report.findings:
        groups.setdefault((finding.id, finding.verdict, finding.reason), []).append(finding)
    return [
        {
            "id": id_,
            "statement": STATEMENTS.get(id_, ""),
            "verdict": verdict,
            "who": _who(found),
            "reason": cells.text(reason),
            "evidence": cells.text(_shared_evidence(found), 260),
        }
        for (id_, verdict, reason), found in groups.items()
    ]


def _who(found: Sequence[Finding]) -> str:
    ids = [finding.agent for finding in found if finding.agent is not None]
    return cells.agents(ids) if ids else "all"


def _shared_evidence(found: Sequence[Finding]) -> str:
    """The evidence, named as the first agent's where that of the others differs."""
    first = _evidence(found[0].evidence)
    alike = all(_evidence(finding.evidence) == first for finding in found[1:])
    return first if alike or not first else f"agent {found[0].agent}: {first}"


def _evidence(value: object) -> str:
    """A short one-line rendering of evidence: exact numbers, names and lists of them."""
    match value:
        case Mapping():
            return "; ".join(f"{str(key).replace('_', ' ')}: {_evidence(entry)}" for key, entry in value.items())
        case str():
            return value.replace("**", "^").replace("*", "·")
        case bool():
            return "yes" if value else "no"
        case Sequence():
            entries = (f"{{{_evidence(v)}}}" if isinstance(v, Mapping) else _evidence(v) for v in value)
            return f"[{', '.join(entries)}]"
        case _:
            return str(value)


def quantity_blocks(
    agents: Sequence[tuple[int, Mapping[str, Fraction | None]]], names: Mapping[str, tuple[str, str]]
) -> list[Table]:
    """Quantities down, agents across, five agents to a block; agents whose values all agree share a column."""
    groups = grouped(agents, lambda entry: tuple(sorted(entry[1].items(), key=lambda item: item[0])))
    present = {key for _, values in agents for key, value in values.items() if value is not None}
    unknown = {key: (typst_math.symbol_text(key), "") for key in sorted(present - set(names))}
    rows = {key: label for key, label in {**names, **unknown}.items() if key in present}
    blocks = []
    for start in range(0, len(groups), AGENTS_PER_BLOCK):
        block = groups[start : start + AGENTS_PER_BLOCK]
        blocks.append(
            {
                "agents": [cells.agents_named(id_ for id_, _ in group).replace("Agent", "agent") for group in block],
                "rows": [
                    {"sign": sign, "meaning": meaning, "cells": [cells.number(group[0][1].get(key)) for group in block]}
                    for key, (sign, meaning) in rows.items()
                ],
            }
        )
    return blocks


def matrix_groups(agents: Sequence[tuple[int, Mapping[str, Any]]]) -> list[dict[str, Any]]:
    """``V0, P1, P2, P3`` (those that exist) of each group of agents with the same matrices."""
    kept = [(id_, {name: rows for name, rows in matrices.items() if rows}) for id_, matrices in agents]
    groups = grouped(kept, lambda entry: tuple(sorted((name, _frozen(rows)) for name, rows in entry[1].items())))
    return [
        {
            "who": cells.agents_named(id_ for id_, _ in group),
            "matrices": [
                {"name": f"{name[0]}_{name[1:]}", "value": cells.matrix(rows)} for name, rows in group[0][1].items()
            ],
        }
        for group in groups
        if group[0][1]
    ]


def plant_rows(plant: Plant) -> list[list[Cell]]:
    """Per agent: order, number of zero states, cost, parameter box."""
    return [
        [
            cells.text(agent.id),
            cells.text(agent.order),
            cells.text(len(agent.zero_states)),
            cells.math(typst_math.typst(agent.cost)),
            cells.math(_box(agent.parameters, agent.parameter_box)) if agent.parameters else cells.text("–"),
        ]
        for agent in plant.agents
    ]


def _box(names: Iterable[Any], box: Iterable[Any]) -> str:
    parts = []
    for name, side in zip(names, box, strict=True):
        relation = "=" if side.is_point else "in"
        parts.append(f"{typst_math.typst(name)} {relation} {cells.interval(side)}")
    return ", quad ".join(parts)


def grouped(entries: Iterable[Entry], key: Callable[[Entry], object]) -> list[list[Entry]]:
    """Entries with equal keys together, in the order in which they first appear."""
    groups: dict[object, list[Entry]] = {}
    for entry in entries:
        groups.setdefault(key(entry), []).append(entry)
    return list(groups.values())


def _frozen(rows: Sequence[Sequence[Fraction]]) -> tuple[tuple[Fraction, ...], ...]:
    return tuple(tuple(row) for row in rows)
