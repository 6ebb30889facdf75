"""The Lyapunov matrices of one agent: ``V0, P1, P2, P3``, each proved (theory.md section 4)."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from certify.agent_model import AgentModel, LyapunovMatrices, Row
from certify.assumptions.a6_zero_dynamics import prove_zero_dynamics
from certify.assumptions.given_lyapunov import Accepted
from certify.bounds.rationals import round_down
from certify.inequalities.lyapunov import LyapunovProof, solve_lyapunov
from certify.inequalities.matrices import Matrix
from symbolic.steady_state import SteadyState

FREE_DECAY = Fraction(4)
ENCLOSURE_MARGIN = 1 - Fraction(1, 1 << 24)  # A6 must hold for an outward-rounded enclosure of ∂f0/∂z, not only for it


@dataclass(frozen=True)
class MatricesInconclusive:
    """A block without a proved Lyapunov matrix."""

    reason: str


def lyapunov_matrices(model: AgentModel, steady_state: SteadyState) -> LyapunovMatrices | MatricesInconclusive:
    """``A_cᵀP1 + P1A_c ⪯ −I``, the same for ``M`` and ``E3``, and the quadratic ``V0`` of A6. Without zero dynamics
    ``a0`` is free."""
    V0: Matrix = ()
    a0 = FREE_DECAY
    if model.agent.zero_states:
        exact = model.optimum.lo if model.optimum.is_point else None
        found = prove_zero_dynamics(model.agent, model.exosystem, steady_state, exact)
        if not isinstance(found, Accepted):
            return MatricesInconclusive("no Lyapunov function of the zero dynamics was proved")
        if found.P is None:
            return MatricesInconclusive(
                f"V0 = {found.V0} is not quadratic: A6 alone does not bound the drive of the references (F1), "
                "and this route bounds it for quadratic V0 only"
            )
        V0, a0 = found.P, round_down(found.a0 * ENCLOSURE_MARGIN, 48)
    blocks = {
        "P1 (γ)": chain_matrix(model.gamma),
        "P2 (M)": model.internal_model.M,
        "P3 (observer)": observer_matrix(model.observer) if model.order > 1 else (),
    }
    proved: dict[str, Matrix] = {}
    for name, A in blocks.items():
        if not A:
            proved[name] = ()
            continue
        proof = solve_lyapunov([A])
        if not isinstance(proof, LyapunovProof):
            return MatricesInconclusive(f"{name}: {proof.reason}")
        proved[name] = proof.P
    return LyapunovMatrices(V0, a0, *proved.values())


def chain_matrix(gamma: Row) -> Matrix:
    """``A_c``: the companion matrix of ``λ^(n−1) + γ_(n−1) λ^(n−2) + … + γ_1``; empty for ``n = 1``."""
    size = len(gamma)
    rows = [tuple(Fraction(int(j == i + 1)) for j in range(size)) for i in range(size - 1)]
    return (*rows, tuple(-entry for entry in gamma)) if size else ()


def observer_matrix(observer: Row) -> Matrix:
    """``E3`` with ``c = (c_1 … c_n)``: first column ``−c_n … −c_1``, ones above the diagonal."""
    size = len(observer)
    return tuple(
        tuple(-observer[size - 1 - i] if j == 0 else Fraction(int(j == i + 1)) for j in range(size))
        for i in range(size)
    )
