"""The checker's coordinator bounds lie above simulated coordinators, and not far above."""

from __future__ import annotations

import math
from itertools import product
from pathlib import Path

import pytest

from certify.checker.certificate import Certificate, read_certificate
from certify.checker.plant import Plant, read_plant
from certify.checker.rules import assumptions, coordinator
from certify.checker.rules.mixing import UNIT, Mixing
from certify.checker.theorems import kinds
from certify.checker.verdict import Rejected, start_meter

CORPUS = Path(__file__).parent / "checker_corpus"
GRADIENTS = {
    "mixed": [lambda s: s - 1, lambda s: (s + 1) / 2],
    "first_order": [lambda s, i=i: s - i + 0.25 / (1 + math.exp(-s)) for i in (1, 2, 3)],
    "polynomial": [lambda s: s - 1, lambda s: s - 2],
}


def read(name: str, box: str | None = None) -> tuple[Plant, Certificate]:
    start_meter()
    text = (CORPUS / f"{name}.toml").read_text()
    if box is not None:
        text = text.replace("reference = 0", f"reference = {box}")
    return read_plant(text.encode()), read_certificate((CORPUS / f"{name}.json").read_bytes(), kinds())


def simulate(name: str, y: list[float], end: float) -> tuple[list[float], list[float], list[float]]:
    """Largest ``|y_i − s*|`` and the integrals of its square and of ``ẏ_i²``, by the classical Runge–Kutta method."""
    plant, certificate = read(name)
    L = [[float(entry) for entry in row] for row in plant.laplacian]
    n, a1, a2, gradients = len(L), float(certificate.claim.alpha1), float(certificate.claim.alpha2), GRADIENTS[name]
    optimum = float(sum(certificate.witness.optimum) / 2)

    def field(state: list[float]) -> list[float]:
        y, zeta, xi = state[:n], state[n : 2 * n], [state[2 * n + n * i : 3 * n + n * i] for i in range(n)]
        Ly = [sum(a * b for a, b in zip(row, y, strict=True)) for row in L]
        dy = [-gradients[i](y[i]) / xi[i][i] - a1 * Ly[i] - a2 * zeta[i] for i in range(n)]
        dxi = [-sum(L[i][k] * xi[k][j] for k in range(n)) for i in range(n) for j in range(n)]
        return dy + [a1 * value for value in Ly] + dxi

    state = y + [0.0] * n + [float(i == j) for i in range(n) for j in range(n)]
    peak, energy, speed, dt = [abs(v - optimum) for v in y], [0.0] * n, [0.0] * n, 0.002
    for _ in range(int(end / dt)):
        k1 = field(state)
        k2 = field([x + dt / 2 * k for x, k in zip(state, k1, strict=True)])
        k3 = field([x + dt / 2 * k for x, k in zip(state, k2, strict=True)])
        k4 = field([x + dt * k for x, k in zip(state, k3, strict=True)])
        state = [x + dt / 6 * (a + 2 * b + 2 * c + d) for x, a, b, c, d in zip(state, k1, k2, k3, k4, strict=True)]
        for i in range(n):
            peak[i] = max(peak[i], abs(state[i] - optimum))
            energy[i] += dt * (state[i] - optimum) ** 2
            speed[i] += dt / 6 * (k1[i] ** 2 + 2 * k2[i] ** 2 + 2 * k3[i] ** 2 + k4[i] ** 2)
    return peak, energy, speed


@pytest.mark.parametrize("name", sorted(GRADIENTS))
def test_the_bounds_are_above_the_simulation_and_close_to_it(name: str) -> None:
    plant, certificate = read(name)
    bounds = coordinator.prove(plant, certificate, assumptions.prove(plant, certificate))
    for bound, peak, energy, speed in zip(bounds, *simulate(name, [0.0] * len(bounds), 12.0), strict=True):
        assert peak <= bound.peak.hi * 1.000001 <= 1.1 * peak + 0.01
        assert energy <= bound.energy.hi * 1.01 <= 1.2 * energy + 0.01
        assert speed <= bound.speed_energy.hi * 1.01 <= 1.3 * speed + 0.01


def test_the_bounds_hold_on_the_whole_initial_box() -> None:
    plant, certificate = read("mixed", box="[-1, 1]")
    bounds = coordinator.prove(plant, certificate, assumptions.prove(plant, certificate))
    for y in product((-1.0, 0.3, 1.0), repeat=2):
        for bound, peak, energy, speed in zip(bounds, *simulate("mixed", list(y), 8.0), strict=True):
            assert peak <= bound.peak.hi and energy <= bound.energy.hi and speed <= bound.speed_energy.hi * 1.01


def test_mixing_matrices_are_stochastic_and_enclosed() -> None:
    plant, certificate = read("first_order")
    mixing = Mixing(plant.laplacian, certificate.witness.coordinator.step)
    L = [[float(entry) for entry in row] for row in plant.laplacian]
    step, n = float(certificate.witness.coordinator.step), len(L)
    for k in range(40):
        least = [mixing.low_now(i) for i in range(n)]
        assert all(abs(sum(row) - UNIT) <= n * mixing.error for row in mixing.X)
        for part in (0.0, 0.3, 1.0):
            t = (k + part) * step
            power = X = [[float(i == j) for j in range(n)] for i in range(n)]
            for j in range(1, 60):
                power = [[-t / j * sum(L[i][m] * power[m][c] for m in range(n)) for c in range(n)] for i in range(n)]
                X = [[a + b for a, b in zip(p, q, strict=True)] for p, q in zip(X, power, strict=True)]
            for i in range(n):
                assert least[i] / UNIT - 1e-9 <= X[i][i] <= 1 + 1e-9
                value = sum(c * part**j for j, c in enumerate(mixing.taylor(i))) / UNIT
                assert abs(value - X[i][i]) <= mixing.taylor_error() / UNIT + 1e-9
        mixing.advance()


def test_the_unstable_pair_of_gains_is_rejected() -> None:
    """For every ``α1`` a large enough ``α2`` is unstable; no comparison norm can hide that."""
    plant, certificate = read("mixed")
    object.__setattr__(certificate.claim, "alpha2", certificate.claim.alpha2 * 1000)
    with pytest.raises(Rejected, match="Lyapunov inequality"):
        coordinator.prove(plant, certificate, assumptions.prove(plant, certificate))
