"""What the paper prints and what holds (theory.md section 7): the findings that concern a plant, as Typst markup.

The markup is the project's own text; nothing of a plant file is put into it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from symbolic.plant import Plant


@dataclass(frozen=True)
class Note:
    """One finding: the printed statement, the truth and what this tool does about it, also where a route differs."""

    id: str
    printed: str
    truth: str
    consequence: str
    concerns: Callable[[Plant], bool]
    by_route: Mapping[str, str] = field(default_factory=dict)

    def here(self, route: str) -> str:
        """The consequence for the route of this name."""
        return self.by_route.get(route, self.consequence)


def notes_for(plant: Plant) -> tuple[Note, ...]:
    """The findings that concern this plant, in the order of theory.md."""
    return tuple(note for note in NOTES if note.concerns(plant))


def parameters_exclude_origin(plant: Plant) -> bool:
    """Whether some agent's box ``W`` does not contain 0."""
    return any(not side.lo <= 0 <= side.hi for agent in plant.agents for side in agent.parameter_box)


def is_the_papers_example(plant: Plant) -> bool:
    """Five agents on the paper's digraph, two of order 2 with zero dynamics and three of order 3."""
    edges = {(edge.source, edge.target) for edge in plant.digraph.edges}
    return (
        edges == {(3, 1), (1, 2), (2, 3), (3, 4), (4, 5), (2, 5), (5, 1)}
        and [agent.order for agent in plant.agents] == [2, 2, 3, 3, 3]
        and [len(agent.zero_states) for agent in plant.agents] == [1, 1, 0, 0, 0]
    )


def _any(_: Plant) -> bool:
    return True


def _has_zero_dynamics(plant: Plant) -> bool:
    return any(agent.zero_states for agent in plant.agents)


def _has_observer(plant: Plant) -> bool:
    return any(agent.order > 1 for agent in plant.agents)


NOTES = (
    Note(
        "F1",
        "Theorems 2 and 3 hold under Assumptions A1–A6.",
        "False for $n_z >= 2$: $hat(f)_0 (y^r)$ disturbs $overline(z)$, no gain reduces it, and A6 does not give "
        "input-to-state stability. A counterexample escapes at $t approx 0.3$ for every gain tried.",
        "The level set is closed by a verified fixed point, not by A6 alone.",
        _has_zero_dynamics,
        {"direct": "$overline(z)$ has a verified box on every step of the tube; A6 is not used for it."},
    ),
    Note(
        "F2",
        "$c = (4 + mu) sum_i overline(c)_i$ with $mu > (sigma.alt_10 + mu_1) \\/ sigma.alt_0$.",
        "Circular: $sigma.alt_1, sigma.alt_2, sigma.alt_10$ are taken on $Omega_(c + epsilon)$, which depends on $mu$; "
        "for some plants no $mu$ exists.",
        "The level is found as a fixed point, agent by agent; if there is none the verdict is inconclusive.",
        _any,
        {"direct": "No level set is used: the bounds are those of the tube, step by step."},
    ),
    Note(
        "F4",
        "$(overline(y)^r, overline(zeta))$ is an equilibrium of the coordinator.",
        "Not while $xi eq.not r$: the coordinator leaves it and returns. All $xi_i^i$ can dip below $r_i$.",
        "The forcing $p(t)$ is part of the error system and $xi_i^i$ is enclosed from below.",
        _any,
    ),
    Note(
        "F5",
        "$zeta(0)$ may lie anywhere in the box.",
        "$r^T zeta$ is conserved, so another start ends elsewhere than at $s^star.op$.",
        "$zeta(0) = 0$ and $xi_i (0) = e_i$ are part of the controller.",
        _any,
    ),
    Note(
        "F7",
        "$W_e$ decays at the rate $h \\/ (2 min{lambda_min (P_3), 1})$.",
        "At $h \\/ (2 lambda_max (P_3))$; for $(s + 1)^3$ at $h t = 1.97$ the truth is 0.534 "
        "where the paper claims 0.0067.",
        "$h_1, h_2$ are computed with $lambda_max (P_3)$.",
        _has_observer,
        {"direct": "No $W_e$ is used: $abs(upright(e)^(E_3 tau))$ is bounded entry by entry on a grid of times."},
    ),
    Note(
        "F8",
        "$norm(e) <= epsilon \\/ 2$ follows from $W_e <= epsilon \\/ 2$.",
        "$norm(e) <= sqrt(epsilon \\/ (2 lambda_min (P_3)))$.",
        "$delta >= K (max |theta.alt| + sqrt(1/2 epsilon E_2 P_3^(-1) E_2^T))$.",
        _has_observer,
        {"direct": "No $W_e$ is used: each $abs(e_i)$ has a bound of its own."},
    ),
    Note(
        "F13",
        "$alpha_1, alpha_2$ sufficiently large.",
        "For each $alpha_2$ there is an $alpha_1^star.op (alpha_2)$: the example's digraph with "
        "$alpha_1 = 1$ is unstable for $alpha_2 > 73$.",
        "A certificate is about one pair $(alpha_1, alpha_2)$, and a matrix inequality proves it stable.",
        _any,
    ),
    Note(
        "F18",
        "$WW$ contains the origin.",
        "It does not here, nor in the paper's own example, and nothing in the proof needs it.",
        "A remark, not a failure.",
        parameters_exclude_origin,
    ),
    Note(
        "F19",
        "The example's $z^star.op$ contains $+ p_(i 1) a_(i 2) s \\/ theta$.",
        "The term is $- s \\/ p_(i 1)$.",
        "$z^star.op$ is derived and verified as an identity (A3).",
        is_the_papers_example,
    ),
    Note(
        "F20",
        "The example is simulated with $K = 4 dot 10^4$, $h = 100$.",
        "With these gains the linearised loop is unstable: for $n = 2$ it is Hurwitz iff "
        "$b K (c_1 h + c_2 g gamma_1)^2 < c_1^2 c_2 h^3$. "
        "With a small $delta$ they end in a limit cycle that looks like convergence on a plot.",
        "The exact Routh–Hurwitz condition at every vertex of $WW$ is checked first.",
        is_the_papers_example,
    ),
)
