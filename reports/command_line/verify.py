"""``certify verify``: the independent checker."""

from __future__ import annotations

import sys
from pathlib import Path

from reports.command_line.arguments import CertificateArgument, JsonOption, PlantArgument
from reports.command_line.outcome import Outcome, finish
from symbolic.errors import InputError, one_line


def command(plant: PlantArgument, certificate: CertificateArgument, as_json: JsonOption = False) -> None:
    """Check a certificate against the plant file alone.

    Prints VERIFIED and the digest of the claim, and nothing on stdout otherwise.
    """
    answer = verified(plant, certificate)
    digest = answer["claim_sha256"]
    if answer["reason"]:
        print(f"certify: rejected: {one_line(answer['reason'])}", file=sys.stderr)
    fields = {"claim_sha256": digest or None, "reason": answer["reason"]}
    finish(Outcome(answer["status"], fields, f"VERIFIED {digest}" if answer["status"] == "verified" else ""), as_json)


def verified(plant: Path, certificate: Path) -> dict[str, str]:
    """The checker's answer: ``status`` (``verified`` or ``rejected``), ``claim_sha256`` and ``reason``.

    Raises ``InputError`` naming the file when one of them is not what it should be.
    """
    from certify.checker import certificate as certificates
    from certify.checker import check
    from certify.checker import plant as plants
    from certify.checker.verdict import Malformed

    claim, proof = _bytes(plant, plants.MAX_BYTES), _bytes(certificate, certificates.MAX_BYTES)
    verdict = check(claim, proof)
    if verdict.status == "malformed":
        try:
            plants.read_plant(claim)
        except Malformed as fault:
            raise InputError(f"{plant}: {fault}") from fault
        raise InputError(f"{certificate}: {verdict.detail}")
    if verdict.status == "verified":
        return {"status": "verified", "claim_sha256": verdict.claim_sha256, "reason": ""}
    reason = ": ".join(part for part in (verdict.obligation, verdict.detail) if part)
    return {"status": "rejected", "claim_sha256": "", "reason": reason}


def _bytes(path: Path, most: int) -> bytes:
    """At most one byte more than allowed, which the reader then refuses."""
    try:
        with path.open("rb") as file:
            return file.read(most + 1)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
