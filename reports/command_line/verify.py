"""``certify verify``: the independent checker."""

from __future__ import annotations

import re
import sys
from typing import TYPE_CHECKING

from reports.command_line.arguments import CertificateArgument, JsonOption, PlantArgument
from reports.command_line.inputs import Given, given_pair
from reports.command_line.outcome import Outcome, finish
from reports.command_line.steps import Steps
from symbolic.errors import InputError, one_line

if TYPE_CHECKING:
    from reports.study import Study
    from symbolic.controller import Controller


def command(plant: PlantArgument, certificate: CertificateArgument, as_json: JsonOption = False) -> None:
    """Check a certificate against the plant file alone.

    Prints VERIFIED and the digest of the claim, and nothing on stdout otherwise.
    """
    answer = verified(*given_pair(plant, certificate))
    digest = answer["claim_sha256"]
    if answer["reason"]:
        print(f"certify: rejected: {one_line(answer['reason'])}", file=sys.stderr)
    fields = {"claim_sha256": digest or None, "reason": answer["reason"]}
    finish(Outcome(answer["status"], fields, f"VERIFIED {digest}" if answer["status"] == "verified" else ""), as_json)


def controller_of(study: Study, certificate: Given, as_json: bool) -> Controller:
    """The controller whose certificate was checked. Ends the command where a rejected one holds none for this plant."""
    from certify.statement.controller import certified_controller

    answer = study.verification or {}
    try:
        return certified_controller(study.found_certificate or {}, study.plant, certificate.name)
    except InputError:
        if answer["status"] != "rejected":
            raise
        reason = f"the checker rejects the certificate: {answer['reason']}"
        finish(Outcome("rejected", {"reason": reason, "certificate": answer}, f"rejected: {reason}"), as_json)


def announced(plant: Given, certificate: Given, steps: Steps) -> dict[str, str]:
    """:func:`verified` as a step of a larger command."""
    with steps.step("verify") as report:
        answer = verified(plant, certificate)
        report(": ".join(part for part in (answer["status"], answer["reason"]) if part))
    return answer


def verified(plant: Given, certificate: Given) -> dict[str, str]:
    """The checker's answer: ``status`` (``verified`` or ``rejected``), ``claim_sha256`` and ``reason``.

    Raises ``InputError`` naming the file when one of them is not what it should be.
    """
    from certify.checker import check
    from certify.checker import plant as plants
    from certify.checker.verdict import Malformed

    verdict = check(plant.data, certificate.data)
    if verdict.status == "malformed":
        try:
            plants.read_plant(plant.data)
        except Malformed as fault:
            raise InputError(f"{plant.name}: {fault}") from fault
        other = _other_theorem(certificate.data)
        if other is None:
            raise InputError(f"{certificate.name}: {verdict.detail}")
        return {"status": "rejected", "claim_sha256": "", "reason": other}
    if verdict.status == "verified":
        return {"status": "verified", "claim_sha256": verdict.claim_sha256, "reason": ""}
    reason = ": ".join(part for part in (verdict.obligation, verdict.detail) if part)
    return {"status": "rejected", "claim_sha256": "", "reason": reason}


def _other_theorem(certificate: bytes) -> str | None:
    """Why a certificate in order, of a theorem that this checker does not know or no longer accepts, is rejected."""
    import json

    from certify.checker.theorems import THEOREMS

    try:
        named = json.loads(certificate)["theorem"]
    except (ValueError, KeyError, TypeError, RecursionError):
        return None
    if not isinstance(named, str) or not re.fullmatch(r"[a-z]{1,40}/[0-9]{1,4}", named) or named in THEOREMS:
        return None
    return f"theorem {named} is none that this checker knows ({', '.join(THEOREMS)}); make the certificate anew"
