"""Defects, each of which makes the claim false or breaks an assumption that the theorem needs.

Every function turns a random network into one without a valid certificate, and says so in its first line.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from fractions import Fraction

from .network import AgentTable, Network, healthy, number, oscillator, ring, similar

TINY = Fraction(1, 10**18)


def unstable_vertex(rng: random.Random) -> Network:
    """The zero dynamics are unstable at one vertex of W only."""
    network = healthy(rng)
    agent = rng.choice(network.agents)
    margin = rng.choice([TINY, Fraction(1, 10**6), Fraction(1, 10), Fraction(1)])
    if rng.random() < 0.5:
        agent.zero_dynamics = {"z1": "a*z1 + x1"}
        agent.uncertain |= {"a": ("-3", str(margin))}
    else:
        agent.zero_dynamics = {"z1": "(a*c - 1)*z1 + z2", "z2": "-z2 + x1"}
        agent.uncertain |= {"a": ("0", str(1 + margin)), "c": ("0", "1")}
    return network


def unstable_inside(rng: random.Random) -> Network:
    """The zero dynamics are stable at every vertex of W and unstable inside."""
    network = healthy(rng)
    agent, margin = rng.choice(network.agents), rng.choice([TINY, Fraction(1, 1000), Fraction(1, 3)])
    agent.uncertain |= {"a": ("-1", "1")}
    agent.zero_dynamics = {"z1": f"({margin} - {number(rng)}*a^2)*z1 + x1"}
    if rng.random() < 0.5:  # two stable vertices, an unstable matrix between them
        agent.zero_dynamics = {
            "z1": f"-z1 + {3 + number(rng)}*(1 + a)*z2",
            "z2": f"{3 + number(rng)}*(1 - a)*z1 - z2 + x1",
        }
    return network


def hidden_jordan_block(rng: random.Random) -> Network:
    """``S`` has purely imaginary eigenvalues and a Jordan block, hidden by a similarity: v grows without bound."""
    network, omega = healthy(rng, most=2), number(rng)
    if rng.random() < 0.4:
        J = [[Fraction(0), Fraction(1)], [Fraction(0), Fraction(0)]]
    else:
        J = [[Fraction(0)] * 4 for _ in range(4)]
        for k in (0, 2):
            J[k][k + 1], J[k + 1][k] = omega, -omega
        J[0][2] = J[1][3] = rng.choice([Fraction(1), Fraction(1, 1000), TINY])
    return _with_exosystem(network, similar(rng, J))


def growing_exosystem(rng: random.Random) -> Network:
    """``S`` has an eigenvalue with a real part of 1e-18 or more."""
    network, omega = healthy(rng, most=2), number(rng)
    growth = rng.choice([TINY, Fraction(1, 10**9), Fraction(1, 7)])
    return _with_exosystem(network, similar(rng, [[growth, omega], [-omega, rng.choice([growth, Fraction(0)])]]))


def growing_zero_dynamics(rng: random.Random) -> Network:
    """Zero dynamics with growth 1e-18."""
    network = healthy(rng)
    rng.choice(network.agents).zero_dynamics = (
        {"z1": f"{TINY}*z1 + x1"} if rng.random() < 0.5 else {"z1": "z2", "z2": f"-{number(rng)}*z1 + {TINY}*z2 + x1"}
    )
    return network


def disconnected(rng: random.Random) -> Network:
    """Not strongly connected: somebody is not heard, and the costs differ."""
    network = healthy(rng, least=2, most=6)
    size = len(network.agents)
    cut = rng.randint(1, size - 1)
    inside = set(rng.sample(range(1, size + 1), cut))
    network.edges = [(i, j, weight) for i, j, weight in network.edges if not (i in inside and j not in inside)]
    if rng.random() < 0.3:
        network.edges = [(i, j, weight) for i, j, weight in network.edges if (i in inside) == (j in inside)]
    for k, agent in enumerate(network.agents):
        agent.cost = f"(s - {k})^2"
    return network


def gains_below_routh(rng: random.Random) -> Network:
    """Fixed ``K`` and ``h`` for which the linearised loop ``x'' = bu`` is not Hurwitz:
    ``bK(c1h + c2gγ)² ≥ c1²c2h³``."""
    g, gamma, c1, c2, b = Fraction(rng.randint(1, 4)), number(rng), number(rng), number(rng), number(rng)
    h = g * rng.randint(1, 1000)
    limit = c1 * c1 * c2 * h**3 / (b * (c1 * h + c2 * g * gamma) ** 2)  # observer polynomial s² + c2 s + c1
    K = limit * rng.choice([1, Fraction(1001, 1000), 2, 100])
    agents = [
        AgentTable(
            order=2, b=str(b), cost=f"(s - {k})^2", more=[f'gamma = ["{gamma}"]', f'observer = ["{c1}", "{c2}"]']
        )
        for k in range(rng.randint(1, 3))
    ]
    network = Network(agents, ring(rng, len(agents)))
    network.more = ["[gains]", f'g = "{g}"', f'K = "{K}"', f'h = "{h}"']
    return network


def gain_below_growth(rng: random.Random) -> Network:
    """A first-order agent ``x' = p x + u`` with a fixed ``K`` that the greatest ``p`` exceeds."""
    network, growth = healthy(rng, most=3), number(rng)
    for agent in network.agents:
        agent.order, agent.zero_dynamics, agent.f, agent.uncertain = 1, {}, "p*x1", {"p": ("-1", str(growth))}
        agent.cost = "s^2"
    network.more = ["[gains]", f'K = "{growth * rng.choice([Fraction(1, 2), Fraction(999, 1000), Fraction(1, 100)])}"']
    return network


def saturation_too_small(rng: random.Random) -> Network:
    """``x' = x + u`` with ``|u| ≤ δ`` and ``x(0)`` beyond ``δ``: it escapes whatever ``K`` is."""
    network = Network(
        [AgentTable(f="x1", cost=f"{number(rng)}*s^2") for _ in range(rng.randint(1, 3))], [], box=("-10", "10")
    )
    network.edges = ring(rng, len(network.agents))
    network.more = ["[gains]", f'delta = "{rng.choice([Fraction(1), Fraction(9), Fraction(999, 100)])}"']
    return network


def drive_of_references(rng: random.Random) -> Network:
    """The counterexample F1: the zero dynamics satisfy A6, and the references still drive them to infinity."""
    size = rng.choice(["10", "12", "25/2", "20"])
    agents = [
        AgentTable(
            order=2, cost=f"(s - {sign})^2/2", zero_dynamics={"z1": "-z1 + z1^3*z2", "z2": "-z2 - 4*z1^4*z2^3 + x1"}
        )
        for sign in ("1", "(-1)")
    ]
    return Network(agents, ring(rng, 2), box=(f"-{size}", size), reference=f'["-{size}", "{size}"]')


def level_too_large(rng: random.Random) -> Network:
    """Drake issue 12876, ``z' = (U − 1)∇U``: the initial box leaves the region of attraction ``U < 1``; ``U`` is
    offered as V0."""
    a, c = number(rng), number(rng)
    b = rng.choice([Fraction(0), a * c / (2 * (a + c))])  # keeps U positive definite
    U = f"({a}*z1^2 + {b}*z1*z2 + {c}*z2^2)"
    network = healthy(rng, most=2)
    agent = rng.choice(network.agents)
    agent.f = agent.f.replace(" + z1", "")
    agent.zero_dynamics = {"z1": f"({U} - 1)*({2 * a}*z1 + {b}*z2)", "z2": f"({U} - 1)*({b}*z1 + {2 * c}*z2)"}
    if rng.random() < 0.5:
        agent.more.append(f'zero_dynamics_lyapunov = "{U}"')
    for other in network.agents:
        if other is not agent:
            other.zero_dynamics, other.f = {}, other.f.replace(" + z1", "")
    size = str(2 + max(1 / a, 1 / c))
    network.z_box = (f"-{size}", size)
    return network


def finite_escape(rng: random.Random) -> Network:
    """Zero dynamics that are stable near the origin and escape from a part of the initial box."""
    network = healthy(rng, most=2)
    k, power = number(rng), rng.choice([2, 3, 5])
    for agent in network.agents:
        agent.zero_dynamics, agent.f = {}, agent.f.replace(" + z1", "")
    rng.choice(network.agents).zero_dynamics = {"z1": f"-{k}*z1 + z1^{power}"}
    edge = str(k + 1)
    network.z_box = (f"-{edge}", edge)
    return network


def not_strongly_convex(rng: random.Random) -> Network:
    """A cost without a positive lower or a finite upper bound of its second derivative, or no optimum at all."""
    network = healthy(rng)
    rng.choice(network.agents).cost = rng.choice(
        [
            "s^4",
            "s^4/12 + s",
            "log(1 + exp(s))",
            "exp(s)",
            "s",
            "-s^2/2",
            "sqrt(1 + s^2)",
            "s^2/2 - cos(s)",
            "s^2/2 + s^4",
            "cosh(s)",
            "s^2/2 + sin(s)",
            "s^2*exp(-s^2)",
            "s^6 + s^2",
            f"s^2/2 - {number(rng, 7)}*log(1 + exp(s))*4",
            "log(1 + s^2)",
            "s^3 + s^2",
            f"{TINY}*s^4",
            "exp(-s)",
            "atan(s)*s",
            "s^2/2 + s*sin(s)",
            "0",
        ]
    )
    if network.agents[0].cost == "0":
        network.agents[0].cost = "s"
    return network


def input_gain_touches_zero(rng: random.Random) -> Network:
    """``b(w) = 0`` somewhere on W, or ``b < 0``: the input does nothing or the wrong thing."""
    network = healthy(rng)
    agent = rng.choice(network.agents)
    agent.b, box = rng.choice(
        [
            ("q", ("0", "1")),
            ("q", ("-1", "1")),
            ("q^2", ("-1", "1")),
            ("cos(q)", ("0", "2")),
            ("q", ("-2", "-1")),
            ("1 - q*q", ("0", "1")),
            ("exp(q) - 1", ("0", "3")),
            (f"q - {TINY}", ("0", "1")),
            ("(q - 1/3)^2", ("0", "1")),
            ("q - 1/7", ("1/7", "2")),
            ("1 + cos(q)", ("0", "4")),
        ]
    )
    agent.uncertain |= {"q": box}
    agent.f = f"x1 + {agent.f}"
    return network


def origin_is_no_equilibrium(rng: random.Random) -> Network:
    """A0 fails: ``f(0) ≠ 0`` or ``f0(0) ≠ 0``."""
    network = healthy(rng)
    agent, offset = rng.choice(network.agents), rng.choice(["1", str(TINY), "p", "cos(p)", "exp(x1)"])
    if agent.zero_dynamics and rng.random() < 0.5:
        agent.zero_dynamics["z1"] += f" + {offset.replace('x1', 'z1')}"
    else:
        agent.f += f" + {offset}"
    return network


def unsolvable_regulator(rng: random.Random) -> Network:
    """No steady state: the zero dynamics resonate with the exosystem, or ignore what they would have to follow."""
    network, omega = healthy(rng, most=2), number(rng)
    oscillator(network, rng)
    network.S = [[Fraction(0), omega], [-omega, Fraction(0)]]
    agent = rng.choice(network.agents)
    agent.f = agent.f.replace(" + z1", "")
    agent.zero_dynamics = rng.choice(
        [
            {"z1": f"{omega}*z2", "z2": f"-{omega}*z1 + v1 + x1"},
            {"z1": "x1"},
            {"z1": "z2 + x1", "z2": "v1"},
            {"z1": f"{omega}*z2 + x1*v1", "z2": f"-{omega}*z1"},
        ]
    )
    return network


def wrong_steady_state(rng: random.Random) -> Network:
    """The user's z* does not solve the regulator equation."""
    network = healthy(rng)
    agent, k = rng.choice(network.agents), number(rng)
    agent.zero_dynamics = {"z1": f"-{k}*z1 + x1"}
    wrong = rng.choice(
        ["0", f"-s/({k})", f"s/({k}) + 1", f"s/({k + 1})", "s^2", f"s/({k})*(1 + {TINY})", f"s/({k}) + {TINY}*s^3"]
    )
    agent.more.append(f'steady_state = {{ z1 = "{wrong}" }}')
    return network


def wrong_lyapunov_function(rng: random.Random) -> Network:
    """Unstable zero dynamics with a function that is said to be a Lyapunov function."""
    network = healthy(rng)
    agent, k = rng.choice(network.agents), number(rng)
    agent.zero_dynamics = {"z1": f"{k}*z1 + x1"}
    agent.more.append(
        f'zero_dynamics_lyapunov = "{rng.choice(["-z1^2/2", "z1^2/2", "-z1^4", "0*z1", "z1^3", "exp(-z1^2)", "z1"])}"'
    )
    return network


def steady_input_is_not_polynomial(rng: random.Random) -> Network:
    """A5 fails: u* is no polynomial in v, and no finite internal model reproduces it."""
    network = healthy(rng, most=2)
    oscillator(network, rng)
    agent = rng.choice(network.agents)
    agent.f += " + " + rng.choice(
        ["exp(v1) - 1", "sin(v2)", "tanh(3*v1)", "v1/(3 + v2)", "sqrt(9 + v1) - 3", "log(1 + v2^2)"]
    )
    return network


def coordinator_gains(rng: random.Random) -> Network:
    """F13: on this graph and with these costs ``α1 = 1`` and a large ``α2`` make the coordinator unstable."""
    edges = [(3, 1), (1, 2), (2, 3), (3, 4), (4, 5), (2, 5), (5, 1)]
    network = Network([AgentTable(cost=f"(s - {k})^2/4") for k in range(5)], [(i, j, Fraction(1)) for i, j in edges])
    network.more = ["[coordinator]", "alpha1 = 1", f"alpha2 = {rng.choice([75, 80, 100, 400, 10_000, 10**9])}"]
    return network


def _with_exosystem(network: Network, S: list[list[Fraction]]) -> Network:
    network.S, network.v0 = S, ["[-1, 1]"] * len(S)
    for agent in network.agents:
        agent.f += " + " + " + ".join(f"{k + 1}*v{k + 1}" for k in range(len(S)))
    return network


DEFECTS: tuple[Callable[[random.Random], Network], ...] = (
    unstable_vertex,
    unstable_inside,
    hidden_jordan_block,
    growing_exosystem,
    growing_zero_dynamics,
    disconnected,
    gains_below_routh,
    gain_below_growth,
    drive_of_references,
    level_too_large,
    finite_escape,
    not_strongly_convex,
    input_gain_touches_zero,
    origin_is_no_equilibrium,
    unsolvable_regulator,
    wrong_steady_state,
    wrong_lyapunov_function,
    steady_input_is_not_polynomial,
)
COSTLY = (saturation_too_small, coordinator_gains)  # many levels are tried before the tool gives up


def defect_of(number: int) -> Callable[[random.Random], Network]:
    """The defects take turns; the costly ones come once in 40."""
    if number % 40 < len(COSTLY):
        return COSTLY[number % 40]
    return DEFECTS[number % len(DEFECTS)]
