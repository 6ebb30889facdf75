"""What the independent checker answers on a plant file and a certificate, as a value."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from typing import Literal

from symbolic.answers import Answer
from symbolic.errors import InputError


@dataclass(frozen=True, repr=False)
class Verification(Answer):
    """``verified`` with the sha256 of the claim, or ``rejected`` with the obligation that does not hold."""

    status: Literal["verified", "rejected"]
    claim_sha256: str = ""
    reason: str = ""

    def said(self) -> list[str]:
        if self.status == "verified":
            return [f"VERIFIED {self.claim_sha256}"]
        return [f"rejected: {self.reason}"]


def verification(
    plant: bytes, certificate: bytes, *, plant_name: str = "the plant file", certificate_name: str = "the certificate"
) -> Verification:
    """The checker's answer on the bytes of both. Raises ``InputError`` that names the one that cannot be read."""
    from certify.checker import check
    from certify.checker import plant as plants
    from certify.checker.verdict import Malformed

    verdict = check(plant, certificate)
    if verdict.status == "malformed":
        try:
            plants.read_plant(plant)
        except Malformed as fault:
            from symbolic.plant_file import parse_plant

            parse_plant(plant, plant_name)  # which says more: every fault, with its place and what to change
            raise InputError(f"{plant_name}: {fault}") from fault
        other = _other_theorem(certificate)
        if other is None:
            raise InputError(f"{certificate_name}: {verdict.detail}")
        return Verification("rejected", "", other)
    if verdict.status == "verified":
        return Verification("verified", verdict.claim_sha256)
    return Verification("rejected", "", ": ".join(part for part in (verdict.obligation, verdict.detail) if part))


def _other_theorem(certificate: bytes) -> str | None:
    """Why a certificate in order, of a theorem that this checker does not know or no longer accepts, is rejected."""
    from certify.checker.theorems import THEOREMS

    try:
        named = json.loads(certificate)["theorem"]
    except (ValueError, KeyError, TypeError, RecursionError):
        return None
    if not isinstance(named, str) or not re.fullmatch(r"[a-z]{1,40}/[0-9]{1,4}", named) or named in THEOREMS:
        return None
    return f"theorem {named} is none that this checker knows ({', '.join(THEOREMS)}); make the certificate anew"
