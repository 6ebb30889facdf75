"""The assumptions A0 … A6 (theory.md section 2), each a decision with evidence."""

from certify.assumptions.check import check_assumptions
from certify.assumptions.findings import CheckReport, Finding

__all__ = ["CheckReport", "Finding", "check_assumptions"]
