"""Everything a report is made from, as one frozen value; what was not done is ``None``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, date, datetime
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

from certify.certificate import claim_digest
from certify.statement.claim import CertifiedGains, certified_gains
from symbolic.controller import Controller
from symbolic.errors import InputError
from symbolic.plant import Interval, Plant

if TYPE_CHECKING:
    from certify.assumptions.findings import CheckReport
    from certify.pipeline import GainsResult
    from certify.statement.bounds import ProvedBounds
    from sims.attraction import RegionSlice
    from sims.closed_loop import Trajectory
    from sims.cross_check import CrossCheck
    from symbolic.derivation import Derivation

Status = Literal["certified", "refuted", "rejected", "inconclusive"]


@dataclass(frozen=True)
class Study:
    """One plant and what was found about it.

    ``optimum`` is ``s*`` where it is rational, ``optimum_enclosure`` encloses it. ``certificate`` is the certificate as
    read (docs/certificate.md); left out, it is that of ``gains``. ``verification`` is the answer of the independent
    checker: ``{"status": "verified" | "rejected", "claim_sha256": …, "reason": …}``. ``simulated`` is the controller of
    ``trajectory``, which need not be the certified one; ``runs`` are further ones from random starts. ``bounds`` are
    the ones that a verified certificate of the direct route proves, ``slices`` the simulated region of attraction,
    ``search`` what a search for a counterexample
    found. ``versions`` maps names of tools and libraries to versions.
    """

    plant: Plant
    check: CheckReport | None = None
    optimum: Fraction | None = None
    optimum_enclosure: Interval | None = None
    derivation: Derivation | None = None
    gains: GainsResult | None = None
    certificate: Mapping[str, Any] | None = None
    verification: Mapping[str, str] | None = None
    trajectory: Trajectory | None = None
    simulated: Controller | None = None
    runs: tuple[Trajectory, ...] = ()
    bounds: ProvedBounds | None = None
    slices: tuple[RegionSlice, ...] = ()
    search: CrossCheck | None = None
    versions: Mapping[str, str] = field(default_factory=dict)
    seed: int | None = None
    commands: tuple[str, ...] = ()
    date: date | None = None

    @property
    def found_certificate(self) -> Mapping[str, Any] | None:
        """The certificate that was read, else the one that was found."""
        if self.certificate is not None:
            return self.certificate
        return None if self.gains is None else self.gains.certificate

    @cached_property
    def certified(self) -> CertifiedGains | None:
        """What that certificate says, read once; ``None`` where there is none or it cannot be read."""
        return certified_gains(self.found_certificate)

    @property
    def verified_certificate(self) -> Mapping[str, Any] | None:
        """The certificate whose very claim the independent checker has confirmed."""
        certificate, answer = self.found_certificate, self.verification
        if certificate is None or answer is None or answer["status"] != "verified":
            return None
        return certificate if answer["claim_sha256"] == claim_digest(dict(certificate)) else None


@dataclass(frozen=True)
class Conclusion:
    """What stands on the first page: the status, why, and whether the independent checker has confirmed it."""

    status: Status
    reason: str
    verified: bool


def conclusion(study: Study) -> Conclusion:
    """The strongest statement the study supports; anything short of a certificate has its reason in front.

    ``refuted``: an assumption or the given gains fail, or a trajectory was found that does not do what is claimed.
    ``rejected``: the checker does not accept the certificate, which does not make its claim false. A certificate that
    was found but not checked is certified and not verified, and so is one of another claim than the checker's.
    """
    failed = _first_finding(study, "fails")
    if failed:
        return Conclusion("refuted", failed, False)
    if study.search is not None and study.search.broken is not None:
        return Conclusion("refuted", f"A SIMULATED TRAJECTORY BREAKS THE CLAIM: {study.search.reason}", False)
    answer = study.verification
    if answer is not None and answer["status"] == "rejected":
        return Conclusion(
            "rejected", f"the checker rejects the certificate: {answer.get('reason') or 'no reason given'}", False
        )
    if study.gains is not None and study.gains.status != "certified":
        return Conclusion(study.gains.status, study.gains.reason, False)
    if study.found_certificate is not None:
        return Conclusion("certified", "", study.verified_certificate is not None)
    undecided = _first_finding(study, "unknown")
    return Conclusion("inconclusive", undecided or "no certificate was sought", False)


def source_date(environment: Mapping[str, str]) -> date:
    """The date of a report: that of ``SOURCE_DATE_EPOCH`` (seconds, UTC) where it is set, else today's in UTC.

    Raises ``InputError`` for a value that is not a whole number of seconds between the years 1970 and 9999.
    """
    given = environment.get("SOURCE_DATE_EPOCH")
    if given is None:
        return datetime.now(UTC).date()
    if not (given.isascii() and given.isdigit() and len(given) <= 12):
        raise InputError(f"SOURCE_DATE_EPOCH: a whole number of seconds is needed, not {given!r:.40}")
    try:
        return datetime.fromtimestamp(int(given), UTC).date()
    except (OverflowError, ValueError):
        raise InputError(f"SOURCE_DATE_EPOCH: {given} is beyond the year 9999") from None


def _first_finding(study: Study, verdict: str) -> str:
    """``A2: reason`` of the first finding with that verdict; empty if there is none."""
    for finding in study.check.findings if study.check else ():
        if finding.verdict == verdict:
            where = "" if finding.agent is None else f", agent {finding.agent}"
            return f"{finding.id}{where}: {finding.reason}"
    return ""
