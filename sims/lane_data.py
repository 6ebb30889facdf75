"""What ``sims.lanes`` works on: named tuples of arrays, which numba passes by value."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np


class Method(NamedTuple):
    """The coefficients of ``sims.rodas5p``, and ``lagrange``: from the signals at its ``lagrange_stages`` to powers."""

    A: Any
    C: Any
    D: Any
    H: Any
    nodes: Any
    gamma: float
    lagrange: Any
    lagrange_stages: Any


class Problem(NamedTuple):
    """One agent, its trajectories' starts ``(batch, states)`` and parameters, and the pool of signals."""

    weights: Any
    input_weights: Any
    delta: float
    entries: int
    plant_states: int
    starts: Any
    coefficients: Any
    first: Any
    ends: Any
    member: Any
    q0: Any
    parameters: Any
    horizon: float
    times: Any
    rtol: float
    atol: float
    radius: float
    max_steps: int


class Result(NamedTuple):
    """``samples (batch, states, times)``; ``counts``: status, steps; ``values``: end, peak, saturated and its last."""

    samples: Any
    counts: Any
    values: Any


class Lanes(NamedTuple):
    """What the lanes hold: state, step, the piece of the signals they are in."""

    q: Any
    p: Any
    t: Any
    h: Any
    end: Any
    mode: Any
    local: Any
    start: Any
    stop: Any
    run: Any
    piece: Any
    sample: Any
    tries: Any


class Work(NamedTuple):
    """Scratch of one step."""

    K: Any
    at: Any
    new: Any
    ft: Any
    lu: Any
    u: Any
    du: Any
    dense: Any
    r: Any
    seen: Any
    error: Any
    d: Any
    h: Any
    inverse: Any
    since: Any
    mean: Any


def empty_lanes(width: int, n: int, m: int, parameters: int, degrees: int) -> Lanes:
    """``width`` lanes that hold no trajectory, for ``n`` states and ``m`` signals of ``degrees`` coefficients."""
    return Lanes(
        q=np.zeros(n * width),
        p=np.zeros(parameters * width),
        t=np.zeros(width),
        h=np.ones(width),
        end=np.ones(width),
        mode=np.zeros(width),
        local=np.zeros((degrees, m * width)),
        start=np.zeros(width),
        stop=np.full(width, np.inf),
        run=np.full(width, -1, dtype=np.int64),
        piece=np.zeros(width, dtype=np.int64),
        sample=np.zeros(width, dtype=np.int64),
        tries=np.zeros(width, dtype=np.int64),
    )


def empty_work(width: int, n: int, m: int, entries: int) -> Work:
    """Scratch of ``width`` lanes for ``n`` states, ``m`` signals and factors of ``entries`` numbers."""
    return Work(
        K=np.zeros((8, n * width)),
        at=np.zeros(n * width),
        new=np.zeros(n * width),
        ft=np.zeros(n * width),
        lu=np.zeros(entries * width),
        u=np.zeros(m * width),
        du=np.zeros(m * width),
        dense=np.zeros((3, n * width)),
        r=np.zeros((5, width)),
        seen=np.zeros((6, width)),
        error=np.zeros(width),
        d=np.zeros(width),
        h=np.zeros(n * width),
        inverse=np.zeros(n * width),
        since=np.zeros(m * width),
        mean=np.full(n, 1.0 / n),
    )
