"""Straight-line code for the steps of a Rosenbrock method: right-hand side, ``∂f/∂t``, a sparse LU factorisation.

The sources are written by the allow-list printer of ``sims.codegen`` from the expressions the proofs use. All of them
read and write *rows*, ``q[0], q[1], …``: with arrays of shape ``(rows, batch)`` NumPy runs a batch of trajectories at
once, with arrays of shape ``(rows,)`` the same text can be compiled for one trajectory.

Within a step the saturation is frozen: ``sat_δ(r)`` is ``free · r + bias`` with ``(free, bias) = (1, 0)`` inside and
``(0, ±δ)`` at a bound, so every step sees a smooth right-hand side and the integrator looks for the kink itself.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import sympy
from sympy.utilities.iterables import numbered_symbols

from sims.codegen import Saturation, expression_source
from sims.equations import ClosedLoopEquations

Function = Callable[..., None]
Groups = Mapping[str, Sequence[sympy.Symbol]]

_FREE = sympy.Dummy("free", real=True)
_BIAS = sympy.Dummy("bias", real=True)


@dataclass(frozen=True)
class StageSources:
    """Sources of four functions that fill their last argument row by row; ``u = (y^r, v…)``, ``p = (w…, free, bias)``.

    ``rhs(q, u, p, out)``, ``rate(q, u, du, p, out)`` for ``∂f/∂u · u̇``, ``factor(q, u, p, d, lu)`` for the sparse LU
    of ``d I − ∂f/∂q`` without pivoting, ``solve(lu, x)`` in place, ``argument(q, u, out)`` for ``r`` of ``sat_δ(r)``.
    ``entries`` is the number of rows of ``lu``, ``delta`` the bound δ.
    """

    states: int
    parameters: int
    inputs: int
    entries: int
    delta: float
    rhs: str
    rate: str
    factor: str
    solve: str
    argument: str


def stage_sources(equations: ClosedLoopEquations) -> StageSources:
    """The order of the states is ``(z, x, η, e)`` (:func:`state_order`), whose leading blocks are the state-feedback
    loop: its eigenvalues, not those of the observer alone, decide whether a pivot can vanish.
    """
    order = state_order(equations)
    states = [equations.states[k] for k in order]
    (argument, delta) = _saturated(equations)
    smooth = [equations.derivative[k].xreplace({Saturation(argument, delta): _FREE * argument + _BIAS}) for k in order]
    inputs = [equations.reference, *equations.exogenous]
    rates = [sympy.Dummy(f"rate{k}", real=True) for k in range(len(inputs))]
    parameters = [*equations.parameters, _FREE, _BIAS]
    in_time = [sympy.Add(*(sympy.diff(row, u) * du for u, du in zip(inputs, rates, strict=True))) for row in smooth]
    groups: Groups = {"q": states, "u": inputs, "p": parameters}
    factor, solve, entries = _elimination(states, smooth, groups)
    return StageSources(
        states=len(states),
        parameters=len(parameters),
        inputs=len(inputs),
        entries=entries,
        delta=float(delta),
        rhs=_rows("rhs(q, u, p, out)", groups, smooth),
        rate=_rows("rate(q, u, du, p, out)", {**groups, "du": rates}, in_time),
        factor=factor,
        solve=solve,
        argument=_rows("argument(q, u, out)", {"q": states, "u": inputs}, [argument]),
    )


def state_order(equations: ClosedLoopEquations) -> list[int]:
    """Positions in ``equations.states`` of ``(z, x, η, e)``."""
    nzx, ne = len(equations.z) + len(equations.x), len(equations.e)
    total = len(equations.states)
    return [*range(nzx), *range(nzx + ne, total), *range(nzx, nzx + ne)]


def numpy_functions(sources: StageSources) -> dict[str, Function]:
    """The functions over NumPy rows."""
    return {name: load(getattr(sources, name), name, _NUMPY) for name in ("rhs", "rate", "factor", "solve", "argument")}


def load(source: str, name: str, namespace: dict[str, object]) -> Function:
    """Compile one of the sources."""
    scope = dict(namespace)
    exec(compile(source, f"<generated {name}>", "exec"), scope)  # noqa: S102 - only what expression_source can emit
    function: Function = scope[name]  # type: ignore[assignment]  # just defined by the source
    return function


_NUMPY: dict[str, object] = {
    "__builtins__": {},
    **{name: getattr(np, name) for name in "sin cos tan exp log tanh sinh cosh sqrt".split()},
    "atan": np.arctan,
    "pow": np.power,
}


def _saturated(equations: ClosedLoopEquations) -> tuple[sympy.Expr, sympy.Expr]:
    (saturation,) = equations.u.atoms(Saturation)
    argument, delta = saturation.args
    return argument, delta


def _rows(signature: str, groups: Groups, rows: Sequence[sympy.Expr]) -> str:
    names = _names(groups)
    lines, reduced = _shared(rows, names)
    lines += [f"out[{i}] = {expression_source(row, names)}" for i, row in enumerate(reduced)]
    return _function(signature, lines)


def _elimination(states: Sequence[sympy.Symbol], smooth: Sequence[sympy.Expr], groups: Groups) -> tuple[str, str, int]:
    """Gaussian elimination of ``d I − J``, unrolled over the entries that are not identically zero; ``lu`` holds the
    multipliers, the upper entries and the inverses of the pivots.
    """
    n = len(states)
    names = _names(groups)
    jacobian = [[sympy.diff(row, state) for state in states] for row in smooth]
    filled = {(i, j) for i in range(n) for j in range(n) if i == j or jacobian[i][j] != 0}
    for k in range(n):
        filled |= {(i, j) for i in range(k + 1, n) if (i, k) in filled for j in range(k + 1, n) if (k, j) in filled}
    place = {entry: index for index, entry in enumerate(sorted(filled))}
    present = [(i, j) for i, j in sorted(filled) if jacobian[i][j] != 0]
    lines, reduced = _shared([jacobian[i][j] for i, j in present], names)
    values = {entry: expression_source(expression, names) for entry, expression in zip(present, reduced, strict=True)}
    for i, j in sorted(filled):
        value = f"-({values[i, j]})" if (i, j) in values else "0.0"
        lines.append(f"m{i}_{j} = {'d + ' if i == j else ''}{value}")
    for k in range(n):
        lines.append(f"m{k}_{k} = 1.0/m{k}_{k}")
        for i in range(k + 1, n):
            if (i, k) not in filled:
                continue
            lines.append(f"m{i}_{k} = m{i}_{k}*m{k}_{k}")
            lines += [f"m{i}_{j} = m{i}_{j} - m{i}_{k}*m{k}_{j}" for j in range(k + 1, n) if (k, j) in filled]
    lines += [f"lu[{index}] = m{i}_{j}" for (i, j), index in place.items()]
    substitution = [f"x{i} = x[{i}]" for i in range(n)]
    for i in range(n):
        terms = [f"lu[{place[i, j]}]*x{j}" for j in range(i) if (i, j) in filled]
        if terms:
            substitution.append(f"x{i} = x{i} - ({' + '.join(terms)})")
    for i in reversed(range(n)):
        terms = [f"lu[{place[i, j]}]*x{j}" for j in range(i + 1, n) if (i, j) in filled]
        above = f"(x{i} - ({' + '.join(terms)}))" if terms else f"x{i}"
        substitution.append(f"x{i} = {above}*lu[{place[i, i]}]")
    substitution += [f"x[{i}] = x{i}" for i in range(n)]
    return _function("factor(q, u, p, d, lu)", lines), _function("solve(lu, x)", substitution), len(place)


def _names(groups: Groups) -> dict[sympy.Symbol, str]:
    return {symbol: f"{group}[{k}]" for group, symbols in groups.items() for k, symbol in enumerate(symbols)}


def _shared(expressions: Sequence[sympy.Expr], names: dict[sympy.Symbol, str]) -> tuple[list[str], list[sympy.Expr]]:
    shared, reduced = sympy.cse(list(expressions), symbols=numbered_symbols("t", cls=sympy.Dummy), order="none")
    lines = []
    for i, (symbol, expression) in enumerate(shared):
        lines.append(f"t{i} = {expression_source(expression, names)}")
        names[symbol] = f"t{i}"
    return lines, reduced


def _function(signature: str, lines: Sequence[str]) -> str:
    return "\n    ".join([f"def {signature}:", *lines]) + "\n"
