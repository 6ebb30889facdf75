"""``pi`` and rational exponents from the plant file to a certificate that the checker accepts."""

from __future__ import annotations

from pathlib import Path

from certify.certificate import canonical
from certify.checker import check
from certify.pipeline import design_gains
from symbolic.plant_file import parse_plant

PLANT = (Path(__file__).parent / "tamper" / "plants" / "small_first_order.toml").read_text()


def test_a_plant_with_roots_and_pi_is_certified() -> None:
    text = PLANT.replace('"p*x1"', '"p*x1 + (2 + p)^(1/3)*x1/4 + 0.1*sin(pi*x1) + (5 + p)^(-3/4)*x1"')
    assert text != PLANT
    plant = parse_plant(text.encode(), "roots.toml")
    found = design_gains(plant, "direct")
    assert found.status == "certified", found.reason
    assert found.certificate is not None
    assert check(text.encode(), canonical(found.certificate) + b"\n").status == "verified"
