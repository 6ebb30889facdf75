"""The steps of ``sims.batch`` for sixteen trajectories abreast, in the subset of Python that numba compiles.

Every array is flat: row ``k`` of lane ``lane`` stands at ``k * WIDTH + lane``, so the innermost loops run over lanes
and become vector instructions. LLVM vectorises a loop only when its length is unknown or at least 16 and no index can
be negative, hence the loops over whole rows and the row views. numba counts references to arrays in every loop unless
its runtime is left out, hence no array is made here. A lane whose trajectory has ended takes the next one. Lanes never
mix and no operation is reordered, so the bits of a trajectory depend on itself alone.

Nothing here is annotated: numba infers the types; ``sims.lane_data`` has them. All that is compiled stands in this one
file, because numba looks at no other when it asks whether the machine code it kept is still that of the source.
"""
# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

from typing import Any

import numba
import numpy as np

WIDTH = 16
RUNNING, COMPLETED, ESCAPED, FAILED = -1, 0, 1, 2
_BISECTIONS = 50
OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "boundscheck": False, "_nrt": False}
_inlined = numba.njit(**OPTIONS)
_pasted = numba.njit(inline="always", **OPTIONS)  # a call would push every array of every tuple


@_inlined
def integrate_block(rhs, rate, factor, solve, method, problem, result, lanes, work, low, high):
    """Trajectories ``low … high − 1`` of the problem."""
    upcoming, running = low, 0
    while True:
        for lane in range(WIDTH):
            while lanes.run[lane] < 0 and upcoming < high:
                running += _load(rhs, problem, result, lanes, work, lane, upcoming)
                upcoming += 1
        if running == 0:
            return
        _stages(rhs, rate, factor, solve, method, problem, lanes, work)
        _finish(method, problem, lanes, work)
        for lane in range(WIDTH):
            if lanes.run[lane] >= 0:
                running -= _settle(problem, result, lanes, work, lane)


@_pasted
def _load(rhs, problem, result, lanes, work, lane, run):
    """Put a trajectory into a lane; 0 if it is over at once. Overwrites the scratch of all lanes."""
    n, w = problem.q0.shape[1], problem.parameters.shape[1]
    member = problem.member[run]
    lanes.run[lane], lanes.t[lane], lanes.sample[lane], lanes.tries[lane] = run, 0.0, 0, 0
    lanes.end[lane] = min(problem.horizon, problem.ends[member])
    peak = 0.0
    for k in range(n):
        lanes.q[k * WIDTH + lane] = problem.q0[run, k]
        if k < problem.plant_states:
            peak = max(peak, abs(problem.q0[run, k]))
    for k in range(w):
        lanes.p[k * WIDTH + lane] = problem.parameters[run, k]
    _enter_piece(problem, lanes, lane, problem.first[member])
    _signals(problem, lanes, work, 0.0)
    _weigh(work.r[0], problem.weights, lanes.q)
    _weigh(work.r[1], problem.input_weights, work.u)
    value = work.r[0, lane] + work.r[1, lane]
    _set_mode(problem, lanes, lane, 1.0 if value >= problem.delta else (-1.0 if value <= -problem.delta else 0.0))
    rhs(lanes.q, work.u, lanes.p, work.at)
    speed, size = 0.0, 0.0
    for k in range(n):
        q = lanes.q[k * WIDTH + lane]
        scale = problem.atol + problem.rtol * abs(q)
        speed += (work.at[k * WIDTH + lane] / scale) ** 2
        size += (q / scale) ** 2
    speed, size = np.sqrt(speed / n), np.sqrt(size / n)
    lanes.h[lane] = min(0.01 * (size + 1.0) / max(speed, 1e-300), 0.01 * lanes.end[lane])
    while lanes.sample[lane] < problem.times.size and problem.times[lanes.sample[lane]] <= 0.0:
        for k in range(n):
            result.samples[run, k, lanes.sample[lane]] = lanes.q[k * WIDTH + lane]
        lanes.sample[lane] += 1
    result.values[run, 1] = peak
    if np.isfinite(speed):
        return 1
    result.counts[run, 0], lanes.run[lane] = FAILED, -1
    return 0


@_inlined
def _stages(rhs, rate, factor, solve, method, problem, lanes, work):
    """``K``, the step's end ``new`` and ``seen``: the reference's part of the saturation's argument at the nodes."""
    at, new, ft, size = work.at, work.new, work.ft, lanes.q.size
    for lane in range(WIDTH):
        lanes.h[lane] = min(lanes.h[lane], lanes.end[lane] - lanes.t[lane])
        work.d[lane] = 1.0 / lanes.h[lane]
    _tile(work.h, lanes.h)
    _tile(work.inverse, work.d)
    for lane in range(WIDTH):
        work.d[lane] /= method.gamma
    _signals(problem, lanes, work, 0.0)
    _signal_rates(lanes, work)
    factor(lanes.q, work.u, lanes.p, work.d, work.lu)
    rate(lanes.q, work.u, work.du, lanes.p, ft)
    for s in range(8):
        if s == 0:
            for i in range(size):
                at[i] = lanes.q[i]
        elif s < 6:
            _sum(at, method.A[s], work.K, s)
            _add(at, lanes.q)
        else:
            _add(at, work.K[s - 1])
        if 0 < s < 6:
            _signals(problem, lanes, work, method.nodes[s])
        if s < 6:
            _weigh(work.seen[s], problem.input_weights, work.u)
        right = work.K[s]
        rhs(at, work.u, lanes.p, right)
        if s:
            _sum(new, method.C[s], work.K, s)
            _add_product(right, 1.0, new, work.inverse)
        if method.D[s] != 0.0:
            _add_product(right, method.D[s], ft, work.h)
        solve(work.lu, right)
    for i in range(size):
        new[i] = at[i] + work.K[7, i]


@_inlined
def _finish(method, problem, lanes, work):
    """The error of the step, its dense output, and the saturation's argument as a polynomial in ``θ`` along it."""
    q, new, at, dense, size = lanes.q, work.new, work.at, work.dense, lanes.q.size
    for i in range(size):
        at[i] = (work.K[7, i] / (problem.atol + problem.rtol * max(abs(q[i]), abs(new[i])))) ** 2
    _weigh(work.error, work.mean, at)
    for a in range(3):
        _sum(dense[a], method.H[a], work.K, 8)
    for a in range(5):
        if a == 0:
            for i in range(size):
                at[i] = q[i]
        elif a == 1:
            for i in range(size):
                at[i] = new[i] - q[i] + dense[0, i]
        elif a < 4:
            for i in range(size):
                at[i] = dense[a - 1, i] - dense[a - 2, i]
        else:
            for i in range(size):
                at[i] = -dense[2, i]
        _weigh(work.r[a], problem.weights, at)
        for j in range(5):
            known, weight = work.seen[method.lagrange_stages[j]], method.lagrange[j, a]
            for lane in range(known.size):
                work.r[a, lane] += weight * known[lane]


@_pasted
def _settle(problem, result, lanes, work, lane):
    """Accept or refuse the step of one lane; 1 if its trajectory is over."""
    run, n = lanes.run[lane], problem.q0.shape[1]
    error = np.sqrt(work.error[lane])
    error = max(error, 1e-10) if np.isfinite(error) else 1e9
    growth = min(max(0.9 * error**-0.2, 0.15), 5.0)
    lanes.tries[lane] += 1
    if error > 1.0:
        lanes.h[lane] *= growth
    else:
        _accept(problem, result, lanes, work, lane, growth)
    size = 0.0
    for k in range(problem.plant_states):
        size = max(size, abs(lanes.q[k * WIDTH + lane]))
    result.values[run, 1] = max(result.values[run, 1], size)
    status = RUNNING
    if size > problem.radius:
        status = ESCAPED
    elif lanes.t[lane] >= lanes.end[lane]:
        status = COMPLETED
    elif lanes.h[lane] <= 4e-16 * max(lanes.t[lane], 1e-9) or lanes.tries[lane] >= problem.max_steps:
        status = ESCAPED if size > np.sqrt(problem.radius) else FAILED
    if status == RUNNING:
        return 0
    result.counts[run, 0], result.values[run, 0] = status, lanes.t[lane]
    lanes.run[lane], lanes.t[lane], lanes.h[lane], lanes.end[lane] = -1, 0.0, 1.0, 1.0
    for k in range(n):
        lanes.q[k * WIDTH + lane] = 0.0
    return 1


@_pasted
def _accept(problem, result, lanes, work, lane, growth):
    """Move on by the step, or to where the saturation's argument crosses a bound; sample on the way."""
    run, n, t, h, mode = lanes.run[lane], problem.q0.shape[1], lanes.t[lane], lanes.h[lane], lanes.mode[lane]
    cut = _crossing(work.r[:, lane], mode, problem.delta)
    crossing = cut >= 0.0
    if not crossing:
        cut = 1.0
    reached = lanes.end[lane] if not crossing and h >= lanes.end[lane] - t else t + h * cut
    while lanes.sample[lane] < problem.times.size and problem.times[lanes.sample[lane]] <= reached:
        theta = (problem.times[lanes.sample[lane]] - t) / h
        for k in range(n):
            result.samples[run, k, lanes.sample[lane]] = _dense(lanes, work, k * WIDTH + lane, theta)
        lanes.sample[lane] += 1
    if mode != 0.0:
        result.values[run, 2] += h * cut
        result.values[run, 3] = reached
    for i in range(lane, n * WIDTH, WIDTH):
        lanes.q[i] = _dense(lanes, work, i, cut) if crossing else work.new[i]
    if crossing:
        lanes.h[lane] *= max(cut, 0.2)
        value = _power(work.r[:, lane], cut)
        _set_mode(problem, lanes, lane, np.sign(value) if mode == 0.0 else 0.0)
    else:
        lanes.h[lane] *= growth
    lanes.t[lane] = reached
    result.counts[run, 1] += 1
    if reached >= lanes.stop[lane]:
        piece = lanes.piece[lane]
        while piece < problem.first[problem.member[run] + 1] - 1 and reached >= problem.starts[piece + 1]:
            piece += 1
        _enter_piece(problem, lanes, lane, piece)


@_inlined
def _crossing(r, mode, delta):
    """Where in ``(0, 1]`` the frozen mode ends, negative if nowhere."""
    low = 0.0
    for k in range(1, 5):
        probe = 0.25 * k
        if not _held(_power(r, probe), mode, delta):
            for _ in range(_BISECTIONS):
                middle = 0.5 * (low + probe)
                if _held(_power(r, middle), mode, delta):
                    low = middle
                else:
                    probe = middle
            return probe
        low = probe
    return -1.0


@_inlined
def _held(value, mode, delta):
    return abs(value) <= delta if mode == 0.0 else mode * value >= delta


@_inlined
def _power(r, theta):
    return r[0] + theta * (r[1] + theta * (r[2] + theta * (r[3] + theta * r[4])))


@_pasted
def _dense(lanes, work, i, theta):
    inner = work.dense[0, i] + theta * (work.dense[1, i] + theta * work.dense[2, i])
    return (1.0 - theta) * lanes.q[i] + theta * (work.new[i] + (1.0 - theta) * inner)


@_inlined
def _sum(out, weights, rows, count):
    """``out = Σ_j weights_j rows_j`` over the first ``count`` rows."""
    for i in range(out.size):
        out[i] = weights[0] * rows[0, i]
    for j in range(1, count):
        weight = weights[j]
        for i in range(out.size):
            out[i] += weight * rows[j, i]


@_inlined
def _add(out, row):
    for i in range(out.size):
        out[i] += row[i]


@_inlined
def _add_product(out, weight, row, factor):
    for i in range(out.size):
        out[i] += weight * row[i] * factor[i]


@_inlined
def _horner(out, factor, row, weight):
    for i in range(out.size):
        out[i] = out[i] * factor[i] + weight * row[i]


@_inlined
def _tile(out, row):
    """The same value in every row."""
    width = row.size
    for low in range(0, out.size, width):
        part = out[low : low + width]
        for lane in range(width):
            part[lane] = row[lane]


@_inlined
def _weigh(out, weights, rows):
    """``out[lane] = Σ_k weights_k rows[k, lane]``."""
    width = out.size
    for lane in range(width):
        out[lane] = weights[0] * rows[lane]
    for k in range(1, weights.size):
        if weights[k] != 0.0:
            weight, row = weights[k], rows[k * width : (k + 1) * width]
            for lane in range(width):
                out[lane] += weight * row[lane]


@_pasted
def _set_mode(problem, lanes, lane, mode):
    lanes.mode[lane] = mode
    lanes.p[lanes.p.size - 2 * WIDTH + lane] = 1.0 if mode == 0.0 else 0.0
    lanes.p[lanes.p.size - WIDTH + lane] = problem.delta * mode


@_pasted
def _enter_piece(problem, lanes, lane, piece):
    member = problem.member[lanes.run[lane]]
    lanes.piece[lane], lanes.start[lane] = piece, problem.starts[piece]
    last = problem.first[member + 1] - 1
    lanes.stop[lane] = problem.starts[piece + 1] if piece < last else np.inf
    degrees, m = problem.coefficients.shape[1], problem.coefficients.shape[2]
    for k in range(degrees):
        for j in range(m):
            lanes.local[k, j * WIDTH + lane] = problem.coefficients[piece, k, j]


@_inlined
def _signals(problem, lanes, work, node):
    """The signals at ``t + node h`` of every lane."""
    u, since, local, size = work.u, work.since, lanes.local, work.u.size
    for lane in range(WIDTH):
        work.error[lane] = lanes.t[lane] + node * lanes.h[lane] - lanes.start[lane]
    _tile(since, work.error)
    for i in range(size):
        u[i] = local[local.shape[0] - 1, i]
    for k in range(local.shape[0] - 2, -1, -1):
        _horner(u, since, local[k], 1.0)
    for lane in range(WIDTH):
        time = lanes.t[lane] + node * lanes.h[lane]
        if time >= lanes.stop[lane]:
            _signals_beyond(problem, lanes, u, lane, time)


@_pasted
def _signals_beyond(problem, lanes, out, lane, time):
    """The same for one lane whose step leaves its piece."""
    piece, last = lanes.piece[lane], problem.first[problem.member[lanes.run[lane]] + 1] - 1
    while piece < last and time >= problem.starts[piece + 1]:
        piece += 1
    c, s = problem.coefficients[piece], time - problem.starts[piece]
    for j in range(c.shape[1]):
        value = c[c.shape[0] - 1, j]
        for k in range(c.shape[0] - 2, -1, -1):
            value = value * s + c[k, j]
        out[j * WIDTH + lane] = value


@_inlined
def _signal_rates(lanes, work):
    """Time derivatives of the signals, within the lanes' pieces, where :func:`_signals` was called last."""
    du, since, local, size = work.du, work.since, lanes.local, work.du.size
    for i in range(size):
        du[i] = 0.0
    for k in range(local.shape[0] - 1, 0, -1):
        _horner(du, since, local[k], k)
