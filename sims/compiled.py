"""``sims.batch`` compiled by numba (the optional extra ``fast``): sixteen trajectories abreast on every thread.

The same method, kink location and step control; see ``sims.lanes``. The machine code of the loop is kept beside this
package, or in the user's cache directory, as Python keeps byte code; an agent's right-hand side is compiled once per
process.
"""

from __future__ import annotations

import re
from concurrent.futures import ThreadPoolExecutor
from functools import cache, lru_cache
from typing import Any

import numba
import numpy as np
from numba import types
from numpy.typing import NDArray

from sims import rodas5p
from sims.lane_data import Lanes, Method, Problem, Result, Work, empty_lanes, empty_work
from sims.lanes import OPTIONS, WIDTH, integrate_block
from sims.signal_pool import Indices, SignalPool
from sims.signals import Array
from sims.stage_code import StageSources, load

_BLOCK = 8 * WIDTH
_ROW = types.float64[::1]
_SIGNATURES = {
    "rhs": types.void(_ROW, _ROW, _ROW, _ROW),
    "rate": types.void(_ROW, _ROW, _ROW, _ROW, _ROW),
    "factor": types.void(_ROW, _ROW, _ROW, _ROW, _ROW),
    "solve": types.void(_ROW, _ROW),
}
_MATH: dict[str, object] = {
    "range": range,
    **{name: getattr(np, name) for name in "sin cos tan exp log tanh sinh cosh sqrt".split()},
    "atan": np.arctan,
    "pow": np.power,
}
_METHOD = Method(
    rodas5p.A,
    rodas5p.C,
    rodas5p.D,
    rodas5p.H,
    rodas5p.NODES,
    rodas5p.GAMMA,
    rodas5p.LAGRANGE,
    np.array(rodas5p.LAGRANGE_STAGES, dtype=np.int64),
)


def over_lanes(source: str) -> str:
    """The same function in a loop over the lanes of flat arrays: ``q[2]`` becomes ``q[2 * WIDTH + lane]``."""
    header, *body = source.splitlines()
    text = "\n    ".join(body)
    text = re.sub(r"\b([a-z]+)\[(\d+)\]", lambda at: f"{at[1]}[{int(at[2]) * WIDTH} + lane]", text)
    text = re.sub(r"\bd\b", "d[lane]", text)
    return f"{header}\n    for lane in range({WIDTH}):\n    {text}\n"


@lru_cache(maxsize=64)
def compiled_functions(sources: StageSources) -> tuple[Any, ...]:
    """``rhs, rate, factor, solve`` of one agent as machine code over the lanes."""
    return tuple(
        numba.njit(signature, **OPTIONS)(load(over_lanes(getattr(sources, name)), name, _MATH))
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
    result = Result(
        np.full((size, sources.states, len(times)), np.nan), np.zeros((size, 2), dtype=np.int64), np.zeros((size, 4))
    )
    problem = Problem(
        weights=np.ascontiguousarray(weights[0]),
        input_weights=np.ascontiguousarray(weights[1]),
        delta=sources.delta,
        entries=sources.entries,
        plant_states=plant_states,
        starts=signals.starts,
        coefficients=signals.coefficients,
        first=signals.first.astype(np.int64),
        ends=signals.ends,
        member=np.asarray(member, dtype=np.int64),
        q0=np.ascontiguousarray(start.T, dtype=float),
        parameters=np.ascontiguousarray(parameters.T, dtype=float).reshape(size, sources.parameters - 2),
        horizon=float(end),
        times=np.ascontiguousarray(times, dtype=float),
        rtol=float(options[0]),
        atol=float(options[1]),
        radius=float(options[2]),
        max_steps=options[3],
    )
    functions, loop, threads = compiled_functions(sources), _loop(), numba.config.NUMBA_NUM_THREADS
    width = min(_BLOCK, max(WIDTH, -(-size // (threads * WIDTH)) * WIDTH))

    def block(low: int) -> None:
        degrees, inputs = signals.coefficients.shape[1:]
        lanes = empty_lanes(WIDTH, sources.states, inputs, sources.parameters, degrees)
        work = empty_work(WIDTH, sources.states, inputs, sources.entries)
        loop(*functions, _METHOD, problem, result, lanes, work, low, min(low + width, size))

    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(block, range(0, size, width)))
    return result


@cache
def _loop() -> Any:
    """The loop for any agent: right-hand sides are passed as pointers, so that it is compiled once."""
    functions = [types.FunctionType(signature) for signature in _SIGNATURES.values()]
    matrix, cube, f8, i8 = types.float64[:, ::1], types.float64[:, :, ::1], types.float64, types.int64
    indices = types.int64[::1]
    method = types.NamedTuple((matrix, matrix, _ROW, matrix, _ROW, f8, matrix, indices), Method)
    agent = (_ROW, _ROW, f8, i8, i8, _ROW, cube, indices, _ROW)
    runs = (indices, matrix, matrix, f8, _ROW, f8, f8, f8, i8)
    problem = types.NamedTuple((*agent, *runs), Problem)
    result = types.NamedTuple((cube, types.int64[:, ::1], matrix), Result)
    lanes = types.NamedTuple((*[_ROW] * 6, matrix, _ROW, _ROW, *[indices] * 4), Lanes)
    work = types.NamedTuple((matrix, *[_ROW] * 6, *[matrix] * 3, *[_ROW] * 6), Work)
    signature = types.void(*functions, method, problem, result, lanes, work, i8, i8)
    try:
        return numba.njit(signature, cache=True, **OPTIONS)(integrate_block.py_func)
    except RuntimeError:  # neither this package's directory nor the user's can be written
        return numba.njit(signature, **OPTIONS)(integrate_block.py_func)
