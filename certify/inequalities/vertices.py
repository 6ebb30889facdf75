"""Matrices over a box of parameters, by their values at its vertices.

A matrix that is multi-affine in its parameters (affine in each of them alone) takes its values on a box in the convex
hull of those at the vertices, so an inequality that is linear in the matrix holds on the box when it holds at the
vertices.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product

import sympy

from certify.bounds.balls import compile_expression
from certify.inequalities.matrices import Matrix
from symbolic.plant import Interval


def vertex_matrices(entries: sympy.MatrixBase, box: Mapping[sympy.Symbol, Interval]) -> tuple[Matrix, ...]:
    """The values of a matrix that is multi-affine in its parameters at the vertices of the parameter box.

    Raises ``ValueError`` if an entry is of higher degree in a parameter, not rational, or has a symbol without an
    interval.
    """
    names = tuple(sorted(entries.free_symbols, key=str))
    missing = [str(name) for name in names if name not in box]
    if missing:
        raise ValueError(f"the box says nothing about {', '.join(missing)}")
    programs = [
        [compile_expression(sympy.sympify(entry), names) for entry in entries.row(i)] for i in range(entries.rows)
    ]
    for row in programs:
        for program in row:
            for name, degree in zip(names, program.degrees, strict=True):
                if not box[name].is_point and (degree is None or degree > 1):
                    raise ValueError(f"the matrix is not affine in {name}: its vertices do not bound it")
    result = []
    for vertex in product(*(sorted({box[name].lo, box[name].hi}) for name in names)):
        values = [[program.exact(vertex) for program in row] for row in programs]
        if any(value is None for row in values for value in row):
            raise ValueError("an entry of the matrix is not rational at a vertex")
        result.append(tuple(tuple(value for value in row if value is not None) for row in values))
    return tuple(result)
