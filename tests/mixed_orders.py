"""A certified plant of two agents of different orders, with zero dynamics and an exosystem: found once per process."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cache

import sympy

from certify.certificate import Json, claim_digest
from certify.pipeline import design_gains
from certify.results import GainsResult
from certify.statement.bounds import ProvedBounds, proved_bounds
from certify.statement.claim import CertifiedGains, certified_gains
from certify.statement.controller import certified_controller
from reports.study import Study
from symbolic.controller import Controller
from symbolic.derivation import Derivation, derive
from symbolic.plant import Plant
from symbolic.plant_file import parse_plant

MIXED = """
schema = "consensus-plant/1"
name = "mixed orders"
network = { agents = 2, edges = ["1 -> 2", "2 -> 1"] }
initial = { box = ["-1/2", "1/2"], reference = 0, observer = 0, eta = 0 }
[exosystem]
states = ["v1", "v2"]
S = [[0, 1], [-1, 0]]
initial = { v1 = 0, v2 = 1 }
[[agent]]
ids = [1]
order = 1
f = "p*x1 + v1"
b = 1
cost = "(s - 1)^2"
uncertain = { p = [-1, 1] }
[[agent]]
ids = [2]
zero_dynamics = { z1 = "-2*z1 + x1" }
order = 2
f = "p*z1*x2 + x2"
b = 1
cost = "(s - 2)^2"
uncertain = { p = [-1, 1] }
[gains]
g = 2
K = 60
h = 6000
"""
OPTIMUM = Fraction(3, 2)


@dataclass(frozen=True)
class Certified:
    plant: Plant
    derivation: Derivation
    gains: GainsResult
    certificate: Json
    view: CertifiedGains
    bounds: ProvedBounds

    @property
    def study(self) -> Study:
        answer = {"status": "verified", "claim_sha256": claim_digest(self.certificate), "reason": ""}
        return Study(
            self.plant, optimum=OPTIMUM, derivation=self.derivation, gains=self.gains, certificate=self.certificate,
            verification=answer, bounds=self.bounds,
        )  # fmt: skip

    @property
    def controller(self) -> Controller:
        return certified_controller(self.certificate, self.plant, "the certificate")


@cache
def certified_mixed_orders() -> Certified:
    plant = parse_plant(MIXED.encode(), "mixed.toml")
    gains = design_gains(plant, route="direct")
    assert gains.certificate is not None, gains.reason
    view = certified_gains(gains.certificate)
    assert view is not None
    assert gains.envelope is not None
    derivation = derive(plant, sympy.Rational(OPTIMUM.numerator, OPTIMUM.denominator))
    found = proved_bounds(plant, derivation, view, gains.envelope)
    assert isinstance(found, ProvedBounds)
    return Certified(plant, derivation, gains, gains.certificate, view, found)
