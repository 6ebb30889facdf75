"""Many trajectories of one agent at once: Rodas5P over NumPy rows, every trajectory with its own step size.

The method has order 5, is L-stable and takes the analytic Jacobian (``sims.rodas5p``). The saturation's kink is
located: within a step the saturation is frozen inside or at a bound (``sims.stage_code``); when the argument has left,
the step is cut at the crossing, found on the dense output, so no step ever runs over the kink. The same call
gives the same bits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sims import rodas5p
from sims.signal_pool import Indices, Mask, PoolReader, SignalPool
from sims.signals import Array
from sims.stage_code import Function, StageSources, numpy_functions
from symbolic.errors import InputError

COMPLETED, ESCAPED, FAILED, ABANDONED = 0, 1, 2, 3
_PROBES = (0.25, 0.5, 0.75, 1.0)
_BISECTIONS = 50
_SAFETY, _SHRINK, _GROW = 0.9, 0.15, 5.0


@dataclass(frozen=True)
class BatchOptions:
    """Tolerances per step, the radius beyond which a plant state counts as escaped, the most steps of a trajectory, and
    whether the others are abandoned once one has escaped (NumPy only). ``compiled`` takes the integrator of
    ``sims.compiled``, which needs the extra ``fast``.
    """

    rtol: float = 1e-6
    atol: float = 1e-8
    escape_radius: float = 1e9
    max_steps: int = 200_000
    stop_at_escape: bool = False
    compiled: bool = False


@dataclass(frozen=True)
class BatchSolution:
    """``samples`` of shape ``(batch, states, times)``, NaN where not reached; ``status`` 0 completed, 1 escaped,
    2 failed, 3 abandoned; ``end`` the last instant reached in seconds; ``peak`` the largest ``|plant state|``; accepted
    ``steps``; ``saturated`` the time at a bound and ``last_saturated`` its last instant.
    """

    samples: Array
    status: NDArray[np.int8]
    end: Array
    peak: Array
    steps: NDArray[np.int64]
    saturated: Array
    last_saturated: Array


def integrate_batch(
    sources: StageSources,
    plant_states: int,
    signals: SignalPool,
    member: Sequence[int] | Indices,
    start: Array,
    parameters: Array,
    end: float,
    times: Array,
    options: BatchOptions = BatchOptions(),
) -> BatchSolution:
    """Integrate from 0 to ``end`` (or the end of the member's signals) and sample at the increasing ``times``.

    ``start`` has shape ``(states, batch)`` in the order of the sources, the plant's ``plant_states`` first;
    ``parameters`` has shape ``(w, batch)``; ``member`` says which signals each trajectory sees.
    """
    members = np.asarray(member, dtype=np.intp)
    if options.compiled:
        return _compiled(sources, plant_states, signals, members, start, parameters, end, times, options)
    run = _Run(sources, plant_states, signals, members, start, parameters, end, times, options)
    with np.errstate(all="ignore"):
        run.begin()
        while run.ids.size:
            run.step()
    return run.solution


def _compiled(
    sources: StageSources,
    plant_states: int,
    signals: SignalPool,
    member: Indices,
    start: Array,
    parameters: Array,
    end: float,
    times: Array,
    options: BatchOptions,
) -> BatchSolution:
    try:
        from sims.compiled import integrate_compiled
    except ModuleNotFoundError as error:
        raise InputError("the compiled integrator needs numba: pip install 'numba>=0.61'") from error
    limits = (options.rtol, options.atol, options.escape_radius, options.max_steps)
    weights = _argument_weights(sources, numpy_functions(sources)["argument"])
    samples, counts, results = integrate_compiled(
        sources, weights, plant_states, signals, member, start, parameters, end, times, limits
    )
    return BatchSolution(
        samples=samples,
        status=counts[:, 0].astype(np.int8),
        end=results[:, 0],
        peak=results[:, 1],
        steps=counts[:, 1],
        saturated=results[:, 2],
        last_saturated=results[:, 3],
    )


class _Run:
    """The state of :func:`integrate_batch`: arrays over the trajectories that are still running."""

    def __init__(
        self,
        sources: StageSources,
        plant_states: int,
        signals: SignalPool,
        member: Indices,
        start: Array,
        parameters: Array,
        end: float,
        times: Array,
        options: BatchOptions,
    ) -> None:
        self.code: dict[str, Function] = numpy_functions(sources)
        self.sources, self.options = sources, options
        self.plant, self.times = plant_states, times
        size = start.shape[1]
        self.solution = BatchSolution(
            samples=np.full((size, sources.states, len(times)), np.nan),
            status=np.zeros(size, dtype=np.int8),
            end=np.zeros(size),
            peak=np.abs(start[:plant_states]).max(axis=0),
            steps=np.zeros(size, dtype=np.int64),
            saturated=np.zeros(size),
            last_saturated=np.zeros(size),
        )
        self.ids = np.arange(size)
        self.inputs = PoolReader(signals, member)
        self.weights, self.input_weights = _argument_weights(sources, self.code["argument"])
        self.q = np.ascontiguousarray(start, dtype=float)
        self.p = np.vstack([parameters.reshape(sources.parameters - 2, size), np.zeros((2, size))])
        self.t = np.zeros(size)
        self.end = np.minimum(end, signals.ends[member])
        self.h = np.zeros(size)
        self.next_sample = np.zeros(size, dtype=np.intp)
        self.tries = np.zeros(size, dtype=np.int64)

    def begin(self) -> None:
        """Modes of the saturation, first step sizes, samples at ``t = 0``."""
        u = self.inputs.values(self.t)
        r = self.weights @ self.q + self.input_weights @ u
        self._set_modes(np.where(r >= self.sources.delta, 1.0, np.where(r <= -self.sources.delta, -1.0, 0.0)))
        rate = np.empty_like(self.q)
        self.code["rhs"](self.q, u, self.p, rate)
        scale = self.options.atol + self.options.rtol * np.abs(self.q)
        speed = np.sqrt(((rate / scale) ** 2).mean(axis=0))
        size = np.sqrt(((self.q / scale) ** 2).mean(axis=0))
        self.h = np.minimum(0.01 * (size + 1.0) / np.maximum(speed, 1e-300), 0.01 * self.end)
        if len(self.times) and self.times[0] == 0.0:
            self.solution.samples[:, :, 0] = self.q.T
            self.next_sample += 1
        self._retire(np.where(np.isfinite(speed), -1, FAILED))

    def step(self) -> None:
        """One attempted step of every running trajectory."""
        q, h, t = self.q, np.minimum(self.h, self.end - self.t), self.t
        K = np.empty((rodas5p.STAGES, *q.shape))
        inputs = self._stages(K, h)
        flat = K.reshape(rodas5p.STAGES, -1)
        new = q + _combine(rodas5p.A[7, :7], flat).reshape(q.shape) + K[7]
        scale = self.options.atol + self.options.rtol * np.maximum(np.abs(q), np.abs(new))
        error = np.sqrt(((K[7] / scale) ** 2).mean(axis=0))
        error = np.where(np.isfinite(error), np.maximum(error, 1e-10), 1e9)
        factor = np.clip(_SAFETY * error ** (-1.0 / rodas5p.ORDER), _SHRINK, _GROW)
        accepted = error <= 1.0
        self.tries += 1
        dense = np.array([_combine(row, flat).reshape(q.shape) for row in rodas5p.H])
        cut, crossing, argument = self._crossings(dense, new, inputs, accepted)
        reached = np.where((cut == 1.0) & (h >= self.end - t), self.end, t + h * cut)
        self._sample(dense, new, h, reached, accepted)
        self._record(accepted, h * cut, reached)
        if crossing.any():
            new[:, crossing] = _interpolate(dense[:, :, crossing], q[:, crossing], new[:, crossing], cut[crossing])
        self.q = np.where(accepted, new, q)
        self.t = np.where(accepted, reached, t)
        self.h = np.where(crossing, np.maximum(cut, 0.2), factor) * h
        self.inputs.advance(self.t)
        if crossing.any():
            mode = np.sign(self.p[-1])
            self._set_modes(np.where(crossing, np.where(mode == 0.0, np.sign(argument), 0.0), mode))
        size = np.abs(self.q[: self.plant]).max(axis=0)
        self.solution.peak[self.ids] = np.fmax(self.solution.peak[self.ids], size)
        self._retire(self._verdicts(size))

    def _stages(self, K: Array, h: Array) -> list[Array]:
        """Fills ``K``; returns ``input_weights @ u`` at the nodes of ``rodas5p.LAGRANGE``."""
        code, q, p, t = self.code, self.q, self.p, self.t
        flat = K.reshape(rodas5p.STAGES, -1)
        lu, ft = np.empty((self.sources.entries, q.shape[1])), np.empty_like(q)
        u = self.inputs.values(t)
        code["factor"](q, u, p, 1.0 / (rodas5p.GAMMA * h), lu)
        code["rate"](q, u, self.inputs.rates(t), p, ft)
        inverse = 1.0 / h
        seen = []
        for i in range(rodas5p.STAGES):
            at = q if i == 0 else q + _combine(rodas5p.A[i, :i], flat).reshape(q.shape)
            if i and rodas5p.NODES[i] != rodas5p.NODES[i - 1]:
                u = self.inputs.values(t + rodas5p.NODES[i] * h)
            if i < 6:
                seen.append(self.input_weights @ u)
            right = K[i]
            code["rhs"](at, u, p, right)
            if i:
                right += _combine(rodas5p.C[i, :i], flat).reshape(q.shape) * inverse
            if rodas5p.D[i]:
                right += (rodas5p.D[i] * h) * ft
            code["solve"](lu, right)
        return [seen[i] for i in rodas5p.LAGRANGE_STAGES]

    def _set_modes(self, mode: Array) -> None:
        self.p[-2] = mode == 0.0
        self.p[-1] = self.sources.delta * mode

    def _crossings(self, dense: Array, new: Array, inputs: list[Array], accepted: Mask) -> tuple[Array, Mask, Array]:
        """The fraction of each step that is kept, where the mode ends there, and the saturation's argument there.

        Along a step the argument is a polynomial of degree 4: the dense output's, and the reference's through five
        nodes. The crossing is kept however near it is to the start: beyond it the whole unsaturated zone may be gone.
        """
        rows = np.array([self.q, new - self.q + dense[0], dense[1] - dense[0], dense[2] - dense[1], -dense[2]])
        r = np.einsum("j,ijk->ik", self.weights, rows) + np.einsum("ji,jk->ik", rodas5p.LAGRANGE, np.array(inputs))
        delta, mode = self.sources.delta, np.sign(self.p[-1])

        def value(theta: Array | float, at: Indices | slice) -> Array:
            c = r[:, at]
            found: Array = c[0] + theta * (c[1] + theta * (c[2] + theta * (c[3] + theta * c[4])))
            return found

        def held(theta: Array | float, at: Indices | slice) -> Mask:
            argument, m = value(theta, at), mode[at]
            inside: Mask = np.where(m == 0.0, np.abs(argument) <= delta, m * argument >= delta)
            return inside

        cut, low = np.ones(mode.size), np.zeros(mode.size)
        crossing = np.zeros(mode.size, dtype=bool)
        open_ = accepted.copy()
        for probe in _PROBES:
            inside = held(probe, slice(None))
            left = open_ & ~inside
            cut[left] = probe
            crossing |= left
            open_ &= inside
            low[open_] = probe
        found = np.flatnonzero(crossing)
        if found.size:
            lower, upper = low[found], cut[found]
            for _ in range(_BISECTIONS):
                middle = 0.5 * (lower + upper)
                inside = held(middle, found)
                lower, upper = np.where(inside, middle, lower), np.where(inside, upper, middle)
            cut[found] = upper
        return cut, crossing, value(cut, slice(None))

    def _sample(self, dense: Array, new: Array, h: Array, reached: Array, accepted: Mask) -> None:
        times = self.times
        if not len(times):
            return
        upcoming = np.append(times, np.inf)
        due = np.flatnonzero(accepted & (upcoming[self.next_sample] <= reached))
        while due.size:
            at = self.next_sample[due]
            theta = (times[at] - self.t[due]) / h[due]
            values = _interpolate(dense[:, :, due], self.q[:, due], new[:, due], theta)
            self.solution.samples[self.ids[due], :, at] = values.T
            self.next_sample[due] += 1
            due = due[upcoming[self.next_sample[due]] <= reached[due]]

    def _record(self, accepted: Mask, width: Array, reached: Array) -> None:
        solution, ids = self.solution, self.ids
        solution.steps[ids] += accepted
        solution.end[ids] = np.where(accepted, reached, solution.end[ids])
        saturated = accepted & (self.p[-2] == 0.0)
        solution.saturated[ids] += np.where(saturated, width, 0.0)
        solution.last_saturated[ids] = np.where(saturated, reached, solution.last_saturated[ids])

    def _verdicts(self, size: Array) -> NDArray[np.int_]:
        radius = self.options.escape_radius
        stuck = (self.h <= 4e-16 * np.maximum(self.t, 1e-9)) | (self.tries >= self.options.max_steps)
        lost = np.where(size > np.sqrt(radius), ESCAPED, FAILED)
        verdict = np.where(self.t >= self.end, COMPLETED, np.where(stuck, lost, -1))
        verdict = np.where(size > radius, ESCAPED, verdict)
        if self.options.stop_at_escape and (verdict == ESCAPED).any():
            return np.where(verdict < 0, ABANDONED, verdict)
        return verdict

    def _retire(self, verdict: NDArray[np.int_]) -> None:
        done = verdict >= 0
        if not done.any():
            return
        self.solution.status[self.ids[done]] = verdict[done]
        keep = ~done
        self.inputs.keep(keep)
        for name in ("ids", "t", "end", "h", "next_sample", "tries"):
            setattr(self, name, getattr(self, name)[keep])
        self.q = np.ascontiguousarray(self.q[:, keep])
        self.p = np.ascontiguousarray(self.p[:, keep])


def _argument_weights(sources: StageSources, argument: Function) -> tuple[Array, Array]:
    """``r = weights · q + input_weights · u``: the feedback is linear in the states and the reference."""
    n, m = sources.states, sources.inputs
    q, u = np.hstack([np.eye(n), np.zeros((n, m))]), np.hstack([np.zeros((m, n)), np.eye(m)])
    out = np.empty((1, n + m))
    argument(q, u, out)
    return out[0, :n].copy(), out[0, n:].copy()


def _combine(weights: Array, rows: Array) -> Array:
    """``Σ_j weights_j rows_j``, by ``einsum``: a BLAS would start threads that wait for each other."""
    result: Array = np.einsum("j,jk->k", weights, rows[: len(weights)])
    return result


def _interpolate(dense: Array, q: Array, new: Array, theta: Array) -> Array:
    rest = 1.0 - theta
    result: Array = rest * q + theta * (new + rest * (dense[0] + theta * (dense[1] + theta * dense[2])))
    return result
