"""The whole check, from the bytes of two files to a verdict."""

from __future__ import annotations

from dataclasses import asdict
from fractions import Fraction

from certify.checker.certificate import AgentClaim, Certificate, Claim, DirectAgentClaim, read_certificate
from certify.checker.plant import Agent, Plant, read_plant
from certify.checker.theorems import THEOREMS, Theorem, kinds
from certify.checker.unproved import unproved_feature
from certify.checker.verdict import STEPS, Malformed, Rejected, Undecided, Verdict, allow_for, require, start_meter


def check(plant: bytes, certificate: bytes, steps: int = STEPS) -> Verdict:
    """``verified`` only if every obligation of the certificate's theorem is proved for the plant.

    Whatever goes wrong in any other way, a fault of the checker, too little memory or more than ``steps`` elementary
    steps (as many again for every ten further agents) included, is ``rejected``.
    """
    start_meter(steps)
    try:
        model = read_plant(plant)
        allow_for(len(model.agents))
        proof = read_certificate(certificate, kinds())
        _prove(model, proof)
    except Malformed as fault:
        return Verdict("malformed", "", str(fault))
    except Rejected as failure:
        return Verdict("rejected", failure.obligation, failure.detail)
    except Undecided as reason:
        return Verdict("rejected", "undecided", str(reason))
    except RecursionError:
        return Verdict("malformed", "", "an expression is nested too deeply")
    except Exception as fault:  # noqa: BLE001 - whatever it is, nothing was proved
        return Verdict("rejected", "unexpected", f"{type(fault).__name__}: {fault}")
    return Verdict("verified", claim_sha256=proof.claim_sha256)


def _prove(plant: Plant, certificate: Certificate) -> None:
    theorem = THEOREMS[certificate.theorem]
    _bind(plant, certificate.claim, [agent.id for agent in certificate.witness.agents], theorem)
    theorem.prove(plant, certificate)


def _bind(plant: Plant, claim: Claim, witnessed: list[int], theorem: Theorem) -> None:
    """The claim is about this plant file, about all its agents in their order, and keeps what the file fixes."""
    require(claim.plant_sha256 == plant.sha256, "plant_sha256: the certificate is for another plant file")
    ids = [agent.id for agent in plant.agents]
    if not ids == [agent.id for agent in claim.agents] == witnessed:
        raise Malformed("the claim and the witness list the agents 1, 2, … of the plant file in this order")
    for key in ("alpha1", "alpha2", "gradient_gain", "mixing_gain", "mixing_time", "softening"):
        _bind_number(getattr(plant.coordinator, key), getattr(claim, key), key)
    for agent, mine in zip(plant.agents, claim.agents, strict=True):
        for key, value in asdict(plant.gains_of(agent.id)).items():
            _bind_number(value, getattr(mine, key), f"agent {agent.id}: {key}")
        _bind_design(agent, mine)
        if isinstance(mine, DirectAgentClaim):
            _bind_requirements(plant, mine)
    feature = unproved_feature(plant, theorem.speaks_of)
    require(not feature, "theorem", reason=f"it says nothing about {feature}")


def _bind_number(fixed: Fraction | None, claimed: Fraction | None, name: str) -> None:
    """What an agent does not have (``h`` at order 1) is None in the claim."""
    require(fixed is None or claimed in (fixed, None), f"{name} is fixed by the plant file", fixed=fixed)


def _bind_requirements(plant: Plant, claim: DirectAgentClaim) -> None:
    """The claim repeats what the plant file asks for, no more and no less."""
    asked = plant.requirements_of(claim.id)
    for key, value in vars(claim.requirements).items():
        require(getattr(asked, key) == value, f"agent {claim.id}: requirements.{key} is that of the plant file")


def _bind_design(agent: Agent, claim: AgentClaim) -> None:
    name = f"agent {agent.id}"
    require(agent.gamma in (None, claim.gamma), f"{name}: gamma is fixed by the plant file")
    require(agent.observer in (None, claim.observer), f"{name}: observer is fixed by the plant file")
    require(agent.internal_model in (None, (claim.M, claim.N)), f"{name}: M and N are fixed by the plant file")
