"""Trajectories per second of the stiff closed-loop ensemble: ours beside what else is installed, in one run.

    python benchmarks/ensembles.py [COUNT]

One agent of order 2 with zero dynamics, high-gain observer and internal model, 7 states, 30 s, starts uniform in the
unit cube, 301 samples, rtol 1e-6, atol 1e-8; the deviation is the largest of (x1, x2, z) from DOP853 at rtol 1e-12 over
3 trajectories and all samples. numbalsoda (compiled LSODA) is timed if it can be imported; the last column is the rate
beside its rate, or beside SciPy's LSODA without it. Its wheels are for Python 3.10 and older but hold only a library
for ctypes: `pip download numbalsoda --only-binary :all: --no-deps --python-version 310`, and unpack it on the path.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from fractions import Fraction

import numpy as np
from scipy.integrate import solve_ivp

from certify.gains.requested import requested_controller
from sims.agent_loop import agent_loop, upper_layer
from sims.batch import BatchOptions, integrate_batch
from sims.search_space import SharedPoint
from symbolic.controller import Controller, CoordinatorGains
from symbolic.derivation import derive
from symbolic.plant import COST_VARIABLE, RequestedGains
from symbolic.plant_file import parse_plant

PLANT = b"""
schema = "consensus-plant/1"
name = "job"
[network]
agents = 2
edges = ["1 -> 2", "2 -> 1"]
[exosystem]
states = ["v1", "v2"]
S = [[0, "4/5"], ["-4/5", 0]]
initial = { v1 = 0, v2 = 1 }
[initial]
box = [-1, 1]
reference = 2
[[agent]]
ids = [1, 2]
zero_dynamics = { z1 = "-z1 + x1 + 10*v1" }
order = 2
f = "2*z1*x1*x2 + x2 + 10*v2"
b = 1
cost = "(s - 2)^2"
internal_model = { M = [[0, 1], [-2, -3]], N = [0, 1] }
"""
END, H, REFERENCES = 30.0, 500.0, 3
TIMES = np.linspace(0.0, END, 301)


def main(count: int) -> None:
    plant = parse_plant(PLANT, "benchmark")
    gains = RequestedGains(Fraction(2), Fraction(50), Fraction(10_000), Fraction(500))
    laws = tuple(law for agent in derive(plant, COST_VARIABLE).agents if (law := requested_controller(agent, gains)))
    loop = agent_loop(plant, Controller(CoordinatorGains(Fraction(3), Fraction(2)), laws), 1)
    layer = upper_layer(plant, loop.controller, SharedPoint((Fraction(0), Fraction(1)), (Fraction(2),) * 2), END)
    psi = [float(value) for value in loop.law.psi]
    starts = np.random.default_rng(1).uniform(-1, 1, (count, 7))  # x1 x2 z, observer, internal model

    def ours(compiled: bool) -> Callable[[np.ndarray], np.ndarray]:
        signals = loop.signals([layer])
        options = BatchOptions(compiled=compiled)

        def run(S: np.ndarray) -> np.ndarray:
            x1, x2, z, a, b, e1, e2 = S.T
            start = np.array([z, x1, x2, e1, e2, H * (x1 - a), x2 - b])
            members = np.zeros(len(S), dtype=np.intp)
            found = integrate_batch(
                loop.sources, 3, signals, members, start, np.zeros((0, len(S))), END, TIMES, options
            )
            return found.samples[:, [1, 2, 0]]

        return run

    def rhs(t: float, s: np.ndarray) -> list[float]:
        x1, x2, z, a, b, e1, e2 = s
        feedback = max(-1e4, min(1e4, 50.0 * (b + 2.0 * (a - 2.0))))
        u = -feedback + psi[0] * e1 + psi[1] * e2
        return [
            x2, 2 * z * x1 * x2 + x2 + 10 * math.cos(0.8 * t) + u, -z + x1 + 10 * math.sin(0.8 * t),
            b + 2 * H * (x1 - a), H * H * (x1 - a), e2, -2 * e1 - 3 * e2 + u,
        ]  # fmt: skip

    def scipy(method: str, rtol: float) -> Callable[[np.ndarray], np.ndarray]:
        def one(s: np.ndarray) -> np.ndarray:
            return solve_ivp(rhs, (0, END), s, method=method, rtol=rtol, atol=rtol / 100, t_eval=TIMES).y[:3]

        return lambda S: np.array([one(s) for s in S])

    reference = scipy("DOP853", 1e-12)(starts[:REFERENCES])
    jobs: list[tuple[str, Callable[[np.ndarray], np.ndarray], int]] = [
        ("Rodas5P, NumPy batch", ours(False), count),
        ("SciPy LSODA, Python right-hand side", scipy("LSODA", 1e-6), 3),
    ]
    try:
        import numba  # noqa: F401 - only whether it is there
    except ModuleNotFoundError:
        print("numba is not installed: the compiled integrator is left out")
    else:
        jobs.insert(0, ("Rodas5P, compiled", ours(True), count))
        lsoda = _numbalsoda(psi)
        if lsoda is not None:
            jobs.insert(1, ("LSODA, compiled (numbalsoda)", lsoda, count))
    rows: list[tuple[str, float, float, float]] = []
    for name, run, size in jobs:
        begun = time.perf_counter()
        run(starts[:1])
        first = time.perf_counter() - begun
        seconds = []
        for _ in range(5 if size == count else 1):
            begun = time.perf_counter()
            run(starts[:size])
            seconds.append(time.perf_counter() - begun)
        deviation = np.abs(run(starts[:REFERENCES]) - reference).max()
        rows.append((name, first, size / float(np.median(seconds)), float(deviation)))
    print(f"{'method':38} {'first s':>8} {'traj/s':>8} {'deviation':>10} {'ratio':>6}")
    base = next((rate for name, _, rate, _ in rows if "numbalsoda" in name), rows[-1][2])
    for name, first, rate, deviation in rows:
        print(f"{name:38} {first:8.2f} {rate:8.0f} {deviation:10.1e} {rate / base:6.2f}")


def _numbalsoda(psi: list[float]) -> Callable[[np.ndarray], np.ndarray] | None:
    try:
        from numbalsoda import lsoda, lsoda_sig
    except ModuleNotFoundError:
        print("numbalsoda is not installed: compiled LSODA is left out")
        return None
    import numba

    p0, p1 = psi

    @numba.cfunc(lsoda_sig)
    def rhs(t, s, d, p):  # type: ignore[no-untyped-def]  # numba infers the types
        feedback = max(-1e4, min(1e4, 50.0 * (s[4] + 2.0 * (s[3] - 2.0))))
        u = -feedback + p0 * s[5] + p1 * s[6]
        d[0] = s[1]
        d[1] = 2 * s[2] * s[0] * s[1] + s[1] + 10 * math.cos(0.8 * t) + u
        d[2] = -s[2] + s[0] + 10 * math.sin(0.8 * t)
        d[3] = s[4] + 2 * H * (s[0] - s[3])
        d[4] = H * H * (s[0] - s[3])
        d[5] = s[6]
        d[6] = -2 * s[5] - 3 * s[6] + u

    address = rhs.address

    @numba.njit(parallel=True)
    def run(S, grid):  # type: ignore[no-untyped-def]  # numba infers the types
        out = np.empty((S.shape[0], grid.shape[0], 7))
        for i in numba.prange(S.shape[0]):
            found, _ = lsoda(address, S[i], grid, rtol=1e-6, atol=1e-8, mxstep=1_000_000)
            out[i] = found
        return out

    return lambda S: np.moveaxis(run(S.copy(), TIMES)[:, :, :3], 1, 2)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 2000)
