"""What the checker did with a mutant, and whether that was right: by rule, never by eye.

``malformed``, ``rejected``
    not accepted.
``equivalent``
    accepted, and the claim is byte for byte the original one about the original plant: witnesses or the producer's
    note differ, and the checker proved the same claim with them.
``other claim, proved again``
    accepted, the claim is another one, the printed digest is that of this other claim, and the producer's code proves
    it too (``recompute``): the obligations of ``recipe`` one by one, ``direct`` with witnesses of its own.
``accepted wrongly``
    accepted and none of these.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections import Counter
from dataclasses import dataclass, field

from certify.certificate import canonical
from certify.checker import check

from .bases import Base
from .mutations import Mutant
from .recompute import why_not_proved

ACCEPTED = ("equivalent", "other claim, proved again", "accepted wrongly")
SECONDS = 30  # of processor time; a check that takes longer is a fault
CLASSES = ("malformed", "rejected", *ACCEPTED)


@dataclass
class Tally:
    """Counts by class and by part of the file; the obligations that failed first; what needs to be looked at."""

    classes: Counter[str] = field(default_factory=Counter)
    parts: Counter[tuple[str, str]] = field(default_factory=Counter)
    obligations: Counter[str] = field(default_factory=Counter)
    wrong: list[tuple[str, Mutant]] = field(default_factory=list)
    faults: list[tuple[str, Mutant]] = field(default_factory=list)
    slowest: float = 0.0

    @property
    def total(self) -> int:
        return sum(self.classes.values())

    def add(self, other: Tally) -> None:
        self.classes += other.classes
        self.parts += other.parts
        self.obligations += other.obligations
        self.wrong += other.wrong
        self.faults += other.faults
        self.slowest = max(self.slowest, other.slowest)


def judge(base: Base, mutant: Mutant, tally: Tally) -> str:
    """The class of one mutant, counted in the tally."""
    plant = base.plant if mutant.plant is None else mutant.plant
    start = time.process_time()
    verdict = check(plant, mutant.certificate)
    seconds = time.process_time() - start
    tally.slowest = max(tally.slowest, seconds)
    if seconds > SECONDS:
        tally.faults.append((f"{seconds:.0f} s", mutant))
    if verdict.status == "verified":
        found, reason = _accepted(base, mutant, plant, verdict.claim_sha256)
        if found == "accepted wrongly":
            tally.wrong.append((reason, mutant))
    else:
        found = verdict.status
        tally.obligations[verdict.obligation.partition(":")[2].strip() or verdict.obligation or "malformed"] += 1
        if verdict.obligation == "unexpected":
            tally.faults.append((verdict.detail, mutant))
    tally.classes[found] += 1
    tally.parts[mutant.path.split(".")[0].split("[")[0], found] += 1
    return found


def _accepted(base: Base, mutant: Mutant, plant: bytes, printed: str) -> tuple[str, str]:
    certificate = json.loads(mutant.certificate)
    claim = canonical(certificate["claim"])
    if hashlib.sha256(claim).hexdigest() != printed:
        return "accepted wrongly", "the printed digest is not that of the claim"
    if hashlib.sha256(plant).hexdigest() != certificate["claim"]["plant_sha256"]:
        return "accepted wrongly", "the claim is about another plant"
    if plant == base.plant and claim == canonical(base.certificate["claim"]):
        return "equivalent", ""
    reason = why_not_proved(plant, certificate)
    return ("other claim, proved again", "") if reason is None else ("accepted wrongly", reason)
