"""The gains of a network as a table for people: four digits, log10 beside large numbers."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import Any

from certify.statement.numbers import with_log10
from symbolic.controller import COORDINATOR_KEYS

COLUMNS = ("g", "K", "delta", "h")


def gains_rows(gains: Mapping[str, Any] | None) -> list[list[str]]:
    """A head and one row per agent of the summary's ``gains``; empty where there are none."""
    if gains is None:
        return []
    head = ["agent", *COLUMNS]
    return [head, *([str(agent["id"]), *(_shown(agent[key]) for key in COLUMNS)] for agent in gains["agents"])]


def gains_table(gains: Mapping[str, Any] | None) -> list[str]:
    """One line per agent and one for the coordinator; the exact numbers are in the JSON."""
    rows = gains_rows(gains)
    if gains is None or not rows:
        return []
    widths = [max(len(row[place]) for row in rows) for place in range(len(rows[0]))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    return [*lines, ", ".join(f"{key} = {_shown(gains[key])}" for key in COORDINATOR_KEYS)]


def _shown(value: str | None) -> str:
    return "-" if value is None else with_log10(Fraction(value))
