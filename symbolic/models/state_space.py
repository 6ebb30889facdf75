"""Linear models: state space and transfer functions of python-control, or plain matrices, with exact entries."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import sympy

from symbolic.constants import as_rational
from symbolic.errors import InputError
from symbolic.models.affine import INPUT, AffineModel, box_of
from symbolic.plant import symbol
from symbolic.toml_value import exact_number

STATE = "q"


def from_state_space(system: Any, B: Any = None, C: Any = None, D: Any = 0, *, initial: Any = None) -> AffineModel:
    """The model of a linear system with one input and one output, in continuous time.

    ``system`` is a ``StateSpace`` or ``TransferFunction`` of python-control (or anything with ``A, B, C, D`` or
    ``num, den``), or the matrix ``A`` with ``B``, ``C`` and ``D`` beside it. Entries are exact: floats are the decimals
    that Python prints for them. ``initial`` has a number or a pair for each state. The states of a transfer function
    are those of its controllable canonical form, which nobody has measured: leave ``initial`` out there and give the
    network a box for ``x`` and ``z``. Raises ``InputError``.

    >>> model = from_state_space([[0, 1], [-2, -3]], [[0], [1]], [[1, 0]])
    >>> model.agent("s^2")["f"]
    '-2*x1 - 3*x2'
    """
    if getattr(system, "dt", None) not in (None, 0, 0.0):
        raise InputError("the model is in discrete time, and agents are in continuous time: convert it first")
    if hasattr(system, "num") and hasattr(system, "den"):
        A, B, C, D = _canonical(*(_polynomial(getattr(system, key), key) for key in ("num", "den")))
    elif hasattr(system, "A"):
        A, B, C, D = (_matrix(getattr(system, key), key) for key in "ABCD")
    else:
        A, B, C, D = _matrix(system, "A"), _matrix(B, "B"), _matrix(C, "C"), _matrix(D, "D")
    n = A.rows
    B = B.T if B.shape == (1, n) and n > 1 else B
    if A.shape != (n, n) or B.shape != (n, 1) or C.shape != (1, n) or D.shape != (1, 1):
        sizes = ", ".join(
            f"{key} {matrix.rows}×{matrix.cols}" for key, matrix in zip("ABCD", (A, B, C, D), strict=True)
        )
        raise InputError(f"one input and one output are needed, A n×n, B n×1, C 1×n, D 1×1; found {sizes}")
    if D[0, 0] != 0:
        raise InputError(
            "D is not 0: the input acts on the output at once, and agents have a relative degree of at least 1"
        )
    states = [symbol(f"{STATE}{k}") for k in range(1, n + 1)]
    column = sympy.Matrix(states)
    if initial is not None and len(initial) != n:
        raise InputError(f"initial: a number or a pair for each of {n} states is needed, found {len(initial)}")
    return AffineModel(
        states=tuple(states),
        rates=tuple(A * column + B * INPUT),
        output=(C * column)[0, 0],
        initial=() if initial is None else tuple(box_of(side, f"initial[{k}]") for k, side in enumerate(initial, 1)),
    )


def _canonical(num: Sequence[Fraction], den: Sequence[Fraction]) -> tuple[sympy.Matrix, ...]:
    """The controllable canonical form of ``num/den``, highest powers first."""
    if not den:
        raise InputError("den: the denominator is 0")
    if len(num) > len(den):
        raise InputError("num: of higher degree than den: the transfer function is not proper")
    n = len(den) - 1
    monic = [as_rational(entry / den[0]) for entry in den]
    above = [as_rational(entry / den[0]) for entry in [Fraction(0)] * (n + 1 - len(num)) + list(num)]
    direct = above[0]
    A = sympy.Matrix(n, n, lambda i, j: -monic[n - j] if i == n - 1 else int(j == i + 1))
    B = sympy.Matrix(n, 1, lambda i, _: int(i == n - 1))
    C = sympy.Matrix(1, n, lambda _, j: above[n - j] - direct * monic[n - j])
    return A, B, C, sympy.Matrix([[direct]])


def _polynomial(value: Any, key: str) -> list[Fraction]:
    """Coefficients, highest power first, without leading zeros; python-control nests them by output and input."""
    entries = _listed(value)
    while entries and isinstance(entries[0], list):
        if len(entries) != 1:
            raise InputError(f"{key}: one input and one output are needed")
        entries = entries[0]
    numbers = [_entry(entry, key) for entry in entries]
    while numbers and numbers[0] == 0:
        numbers = numbers[1:]
    return numbers


def _matrix(value: Any, key: str) -> sympy.Matrix:
    if value is None:
        raise InputError(f"{key} is missing: A, B and C are needed")
    rows = _listed(value)
    if not isinstance(rows, list):
        rows = [[rows]]
    elif rows and not isinstance(rows[0], list):
        rows = [[entry] for entry in rows] if key == "B" else [rows]
    if not rows or any(len(row) != len(rows[0]) for row in rows):
        raise InputError(f"{key}: rows of one length are needed")
    return sympy.Matrix([[as_rational(_entry(entry, key)) for entry in row] for row in rows])


def _listed(value: Any) -> Any:
    if hasattr(value, "tolist"):
        value = value.tolist()
    return [_listed(entry) for entry in value] if isinstance(value, list | tuple) else value


def _entry(value: Any, key: str) -> Fraction:
    found = exact_number(value, key)
    if found is None:
        raise InputError(f"{key}: a number is needed, found {value!r:.60}")
    return found
