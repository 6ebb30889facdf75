"""The integrator of ``sims.batch`` compiled for one trajectory at a time by numba (the optional extra ``fast``).

The same method, kink location and step control as ``sims.batch``; trajectories run on threads, and the bits of one
depend neither on the others nor on the number of threads. The loop is compiled once per process, an agent's right-hand
side once per agent; nothing is cached on disk.
"""

from __future__ import annotations

from functools import cache, lru_cache
from typing import Any

import numba
import numpy as np
from numba import types
from numpy.typing import NDArray

from sims import rodas5p
from sims.signal_pool import Indices, SignalPool
from sims.signals import Array
from sims.stage_code import StageSources, load

A, C, D, H, NODES, GAMMA = rodas5p.A, rodas5p.C, rodas5p.D, rodas5p.H, rodas5p.NODES, rodas5p.GAMMA
NODE_STAGES = np.array([0, 2, 1, 3, 5])
LAGRANGE = np.linalg.inv(np.vander(NODES[NODE_STAGES], increasing=True)).T.copy()

_ROW = types.float64[::1]
_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "boundscheck": False}
_SIGNATURES = {
    "rhs": types.void(_ROW, _ROW, _ROW, _ROW),
    "rate": types.void(_ROW, _ROW, _ROW, _ROW, _ROW),
    "factor": types.void(_ROW, _ROW, _ROW, types.float64, _ROW),
    "solve": types.void(_ROW, _ROW),
}
_MATH: dict[str, object] = {
    **{name: getattr(np, name) for name in "sin cos tan exp log tanh sinh cosh sqrt".split()},
    "atan": np.arctan,
    "pow": np.power,
}


@lru_cache(maxsize=64)
def compiled_functions(sources: StageSources) -> tuple[Any, ...]:
    """``rhs, rate, factor, solve`` of one agent as machine code."""
    return tuple(
        numba.njit(signature, **_OPTIONS)(load(getattr(sources, name), name, _MATH))
        for name, signature in _SIGNATURES.items()
    )


def integrate_compiled(
    sources: StageSources,
    weights: tuple[Array, Array],
    plant_states: int,
    signals: SignalPool,
    member: Indices,
    start: Array,
    parameters: Array,
    end: float,
    times: Array,
    options: tuple[float, float, float, int],
) -> tuple[Array, NDArray[np.int64], Array]:
    """``(samples, counts, results)``: samples as ``BatchSolution`` has them, ``counts`` the columns status and steps,
    ``results`` the columns end, peak, saturated, last saturated. ``weights`` give the saturation's argument.
    """
    size = start.shape[1]
    samples = np.full((size, sources.states, len(times)), np.nan)
    counts = np.zeros((size, 2), dtype=np.int64)
    results = np.zeros((size, 4))
    _loop()(
        *compiled_functions(sources),
        np.ascontiguousarray(weights[0]),
        np.ascontiguousarray(weights[1]),
        sources.delta,
        sources.entries,
        plant_states,
        signals.starts,
        signals.coefficients,
        signals.first.astype(np.int64),
        signals.ends,
        np.asarray(member, dtype=np.int64),
        np.ascontiguousarray(start.T, dtype=float),
        np.ascontiguousarray(parameters.T, dtype=float).reshape(size, sources.parameters - 2),
        float(end),
        np.ascontiguousarray(times, dtype=float),
        *map(float, options[:3]),
        int(options[3]),
        samples,
        counts,
        results,
    )
    return samples, counts, results


@cache
def _loop() -> Any:
    """Compile the loop over the trajectories; the right-hand sides are passed as pointers."""
    functions = [types.FunctionType(signature) for signature in _SIGNATURES.values()]
    matrix, cube, f8, i8 = types.float64[:, ::1], types.float64[:, :, ::1], types.float64, types.int64
    signature = types.void(
        *functions,
        *(_ROW, _ROW, f8, i8, i8, _ROW, cube, types.int64[::1], _ROW, types.int64[::1]),
        *(matrix, matrix, f8, _ROW, f8, f8, f8, i8, cube, types.int64[:, ::1], matrix),
    )
    return numba.njit(signature, parallel=True, **_OPTIONS)(_run_all)


@numba.njit(**_OPTIONS)
def _horner(c, s, out):  # type: ignore[no-untyped-def]  # numba infers the types
    for j in range(out.size):
        value = c[c.shape[0] - 1, j]
        for k in range(c.shape[0] - 2, -1, -1):
            value = value * s + c[k, j]
        out[j] = value


@numba.njit(**_OPTIONS)
def _horner_rate(c, s, out):  # type: ignore[no-untyped-def]  # numba infers the types
    for j in range(out.size):
        value = (c.shape[0] - 1) * c[c.shape[0] - 1, j]
        for k in range(c.shape[0] - 2, 0, -1):
            value = value * s + k * c[k, j]
        out[j] = value


@numba.njit(**_OPTIONS)
def _dot(a, b):  # type: ignore[no-untyped-def]  # numba infers the types
    total = 0.0
    for k in range(a.size):
        total += a[k] * b[k]
    return total


@numba.njit(**_OPTIONS)
def _held(theta, mode, delta, r):  # type: ignore[no-untyped-def]  # numba infers the types
    """Whether the frozen mode holds at ``θ``; ``r`` are the two ends, three inner terms and five of the reference."""
    rest = 1.0 - theta
    value = rest * r[0] + theta * (r[1] + rest * (r[2] + theta * (r[3] + theta * r[4])))
    value += r[5] + theta * (r[6] + theta * (r[7] + theta * (r[8] + theta * r[9])))
    return abs(value) <= delta if mode == 0.0 else mode * value >= delta


def _run_all(  # type: ignore[no-untyped-def]  # numba infers the types
    rhs, rate, factor, solve, weights, input_weights, delta, entries, plant_states, starts, coefficients, first, ends,
    member, q0, w, horizon, times, rtol, atol, radius, max_steps, samples, counts, results,
):  # fmt: skip
    n, m = q0.shape[1], coefficients.shape[2]
    for i in numba.prange(q0.shape[0]):
        q, new, at, ft = q0[i].copy(), np.empty(n), np.empty(n), np.empty(n)
        lu, K, u, du, r, seen = np.empty(entries), np.empty((8, n)), np.empty(m), np.empty(m), np.empty(10), np.empty(6)
        dense = np.empty((3, n))
        p = np.empty(w.shape[1] + 2)
        p[: w.shape[1]] = w[i]
        piece, last = first[member[i]], first[member[i] + 1] - 1
        end = min(horizon, ends[member[i]])
        t, sample, steps, tries, status = 0.0, 0, 0, 0, -1
        saturated, last_saturated, peak = 0.0, 0.0, 0.0
        for k in range(plant_states):
            peak = max(peak, abs(q[k]))
        _horner(coefficients[piece], 0.0, u)
        value = _dot(weights, q) + _dot(input_weights, u)
        mode = 1.0 if value >= delta else (-1.0 if value <= -delta else 0.0)
        p[-2], p[-1] = (1.0 if mode == 0.0 else 0.0), delta * mode
        rhs(q, u, p, at)
        speed, size = 0.0, 0.0
        for k in range(n):
            scale = atol + rtol * abs(q[k])
            speed += (at[k] / scale) ** 2
            size += (q[k] / scale) ** 2
        speed, size = np.sqrt(speed / n), np.sqrt(size / n)
        h = min(0.01 * (size + 1.0) / max(speed, 1e-300), 0.01 * end)
        if not np.isfinite(speed):
            status = 2
        while sample < times.size and times[sample] <= 0.0:
            samples[i, :, sample] = q
            sample += 1
        while status < 0:
            h = min(h, end - t)
            tries += 1
            _horner(coefficients[piece], t - starts[piece], u)
            _horner_rate(coefficients[piece], t - starts[piece], du)
            factor(q, u, p, 1.0 / (GAMMA * h), lu)
            rate(q, u, du, p, ft)
            inverse = 1.0 / h
            for s in range(8):
                if s == 0:
                    at[:] = q
                elif s < 6:
                    for k in range(n):
                        total = q[k]
                        for j in range(s):
                            total += A[s, j] * K[j, k]
                        at[k] = total
                else:
                    for k in range(n):
                        at[k] += K[s - 1, k]
                if 0 < s < 6:
                    time = t + NODES[s] * h
                    there = piece
                    while there < last and time >= starts[there + 1]:
                        there += 1
                    _horner(coefficients[there], time - starts[there], u)
                if s < 6:
                    seen[s] = _dot(input_weights, u)
                right = K[s]
                rhs(at, u, p, right)
                for k in range(n):
                    total = 0.0
                    for j in range(s):
                        total += C[s, j] * K[j, k]
                    right[k] += total * inverse + D[s] * h * ft[k]
                solve(lu, right)
            error = 0.0
            for k in range(n):
                new[k] = at[k] + K[7, k]
                scale = atol + rtol * max(abs(q[k]), abs(new[k]))
                error += (K[7, k] / scale) ** 2
            error = np.sqrt(error / n)
            error = max(error, 1e-10) if np.isfinite(error) else 1e9
            growth = min(max(0.9 * error**-0.2, 0.15), 5.0)
            if error > 1.0:
                h *= growth
            else:
                for a in range(3):
                    for k in range(n):
                        total = 0.0
                        for j in range(8):
                            total += H[a, j] * K[j, k]
                        dense[a, k] = total
                r[0], r[1] = _dot(weights, q), _dot(weights, new)
                for a in range(3):
                    r[2 + a] = _dot(weights, dense[a])
                for a in range(5):
                    total = 0.0
                    for j in range(5):
                        total += LAGRANGE[j, a] * seen[NODE_STAGES[j]]
                    r[5 + a] = total
                cut, low, crossing = 1.0, 0.0, False
                for probe in (0.25, 0.5, 0.75, 1.0):
                    if not _held(probe, mode, delta, r):
                        cut, crossing = probe, True
                        break
                    low = probe
                if crossing:
                    for _ in range(40):
                        middle = 0.5 * (low + cut)
                        if _held(middle, mode, delta, r):
                            low = middle
                        else:
                            cut = middle
                    cut = max(cut, 1e-3)
                reached = end if cut == 1.0 and h >= end - t else t + h * cut
                while sample < times.size and times[sample] <= reached:
                    theta = (times[sample] - t) / h
                    rest = 1.0 - theta
                    for k in range(n):
                        inner = dense[0, k] + theta * (dense[1, k] + theta * dense[2, k])
                        samples[i, k, sample] = rest * q[k] + theta * (new[k] + rest * inner)
                    sample += 1
                if mode != 0.0:
                    saturated += h * cut
                    last_saturated = reached
                if crossing:
                    rest = 1.0 - cut
                    for k in range(n):
                        inner = dense[0, k] + cut * (dense[1, k] + cut * dense[2, k])
                        new[k] = rest * q[k] + cut * (new[k] + rest * inner)
                    h *= max(cut, 0.2)
                else:
                    h *= growth
                q[:] = new
                t = reached
                steps += 1
                while piece < last and t >= starts[piece + 1]:
                    piece += 1
                if crossing:
                    _horner(coefficients[piece], t - starts[piece], u)
                    value = _dot(weights, q) + _dot(input_weights, u)
                    mode = 1.0 if value >= delta else (-1.0 if value <= -delta else 0.0)
                    p[-2], p[-1] = (1.0 if mode == 0.0 else 0.0), delta * mode
            size = 0.0
            for k in range(plant_states):
                size = max(size, abs(q[k]))
            peak = max(peak, size)
            if size > radius:
                status = 1
            elif t >= end:
                status = 0
            elif h <= 4e-16 * max(t, 1e-9) or tries >= max_steps:
                status = 1 if size > np.sqrt(radius) else 2
        counts[i, 0], counts[i, 1] = status, steps
        results[i, 0], results[i, 1], results[i, 2], results[i, 3] = t, peak, saturated, last_saturated
