"""The theorems that the checker knows: for each what its claim and its witness hold and the rule that decides its
obligations.

To add one: a dataclass of its witness (certificate.py), a module with its rule (rules/) and a line here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from certify.checker.certificate import Certificate, Claim, DirectClaim, DirectWitness, Witness
from certify.checker.plant import Plant


@dataclass(frozen=True)
class Theorem:
    """``prove`` returns if every obligation holds for the plant, and raises ``Rejected`` otherwise. ``speaks_of`` are
    the tables of a plant file that its claim is about beside the plant itself."""

    witness: type[Any]
    prove: Callable[[Plant, Certificate], None]
    claim: type[Claim] = Claim
    speaks_of: frozenset[str] = frozenset()


def _recipe(plant: Plant, certificate: Certificate) -> None:
    from certify.checker.rules import recipe

    recipe.prove(plant, certificate)


def _direct(plant: Plant, certificate: Certificate) -> None:
    from certify.checker.rules import direct  # lazily: recipe/2 is checked without python-flint

    direct.prove(plant, certificate)


THEOREMS: dict[str, Theorem] = {
    "recipe/2": Theorem(Witness, _recipe),  # docs/certificate.md
    "direct/3": Theorem(DirectWitness, _direct, DirectClaim, frozenset({"requirements"})),  # docs/certificate-direct.md
}


def kinds() -> dict[str, tuple[type[Claim], type[Any]]]:
    """The dataclasses of the claim and of the witness by theorem, for the reader of certificates."""
    return {name: (theorem.claim, theorem.witness) for name, theorem in THEOREMS.items()}
