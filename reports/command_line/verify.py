"""``certify verify``: the independent checker."""

from __future__ import annotations

import sys
from dataclasses import asdict
from typing import TYPE_CHECKING

from reports.command_line.arguments import CertificateArgument, JsonOption, PlantArgument
from reports.command_line.inputs import Given, given_pair
from reports.command_line.outcome import Outcome, finish
from reports.command_line.steps import Steps
from symbolic.errors import one_line

if TYPE_CHECKING:
    pass


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
    from certify.verification import verification

    return asdict(verification(plant.data, certificate.data, plant_name=plant.name, certificate_name=certificate.name))
