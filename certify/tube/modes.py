"""Real modes of the nominal loop to high precision, and the block diagonal matrix they leave
(docs/certificate-direct.md section 2)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from fractions import Fraction

import numpy as np
from flint import acb, acb_mat, arb, arb_mat, ctx, fmpq

from certify.agent_model import Matrix
from certify.tube.loop import Loop

BITS = 200
WITNESS_BITS = 96
NEAR = 1 / 50  # the inverse of the modes is some fifty times larger than it need be where directions are this close


@dataclass(frozen=True)
class Modes:
    """``H`` (exact, columns are modes), block sizes, and floats: eigenvalues per column, ``C' = C H``,
    ``J' = H⁻¹[B | Y]``.

    Eigenvalues of a block of size 2 are ``σ ± iω`` on its two columns.
    """

    H: Matrix
    blocks: tuple[int, ...]
    decay: np.ndarray
    frequency: np.ndarray
    outputs: np.ndarray
    columns: np.ndarray


class NoModes(Enum):
    """Why a loop has no modes to work with, as far as numbers tell."""

    UNSTABLE = "an eigenvalue whose real part is not negative"
    DEFECTIVE = "eigenvectors that hardly span"


def modes(loop: Loop) -> Modes | NoModes:
    """Numerically; eigenvectors that are parallel though their eigenvalues (nearly) agree are ``DEFECTIVE``."""
    size = loop.size
    with ctx.workprec(BITS):
        A = arb_mat([[_ball(entry) for entry in row] for row in loop.A])
        try:
            values, vectors = acb_mat(A).eig(right=True, algorithm="approx")
        except (ValueError, ZeroDivisionError):
            return NoModes.DEFECTIVE
        if not all(float(value.real.mid()) < 0 for value in values):
            return NoModes.UNSTABLE
        found = _real_columns(values, vectors, size)
        if found is None or _parallel(values, vectors, size):
            return NoModes.DEFECTIVE
        columns, blocks, decay, frequency = found
        H = tuple(tuple(_dyadic(columns[j][i]) for j in range(size)) for i in range(size))
        exact = arb_mat([[_ball(entry) for entry in row] for row in H])
        try:
            inverse = exact.inv()
        except ZeroDivisionError:
            return NoModes.DEFECTIVE
        C = arb_mat([[_ball(entry) for entry in row] for row in loop.outputs]) * exact
        J = arb_mat([[_ball(row[i]) for row in (*loop.columns, *loop.starts)] for i in range(size)])
        return Modes(
            H,
            blocks,
            np.array(decay),
            np.array(frequency),
            _floats(C),
            _floats(inverse * J),
        )


def _real_columns(
    values: list[acb], vectors: acb_mat, size: int
) -> tuple[list[list[arb]], tuple[int, ...], list[float], list[float]] | None:
    order = sorted(range(size), key=lambda k: float(values[k].real.mid()))
    columns: list[list[arb]] = []
    blocks: list[int] = []
    decay: list[float] = []
    frequency: list[float] = []
    for k in order:
        sigma, omega = float(values[k].real.mid()), float(values[k].imag.mid())
        vector = _direction(vectors, k, size)
        if abs(omega) <= 1e-12 * abs(sigma):
            columns.append([entry.real.mid() for entry in vector])
            blocks.append(1)
            decay.append(-sigma)
            frequency.append(0.0)
        elif omega > 0:
            columns.append([entry.real.mid() for entry in vector])
            columns.append([entry.imag.mid() for entry in vector])
            blocks.append(2)
            decay += [-sigma, -sigma]
            frequency += [omega, omega]
    return (columns, tuple(blocks), decay, frequency) if len(columns) == size else None


def _direction(vectors: acb_mat, k: int, size: int) -> list[acb]:
    """An eigenvector with its largest entry 1."""
    vector = [vectors[i, k] for i in range(size)]
    largest = max(vector, key=lambda entry: float(abs(entry)))
    return [entry / largest for entry in vector]


def _parallel(values: list[acb], vectors: acb_mat, size: int) -> bool:
    """Whether two eigenvalues and their directions agree to within ``NEAR``: states have no common unit, so every
    entry is compared with the largest of its row."""
    flat = np.array([[complex(entry) for entry in _direction(vectors, k, size)] for k in range(size)])
    roots = np.array([complex(value) for value in values])
    rows = np.abs(flat).max(axis=0)
    for k in range(size):
        apart = np.abs(roots[k + 1 :] - roots[k]) / abs(roots[k])
        turned = (np.abs(flat[k + 1 :] - flat[k]) / np.where(rows > 0, rows, 1)).max(axis=1)
        if np.any((apart < NEAR) & (turned < NEAR)):
            return True
    return False


def _ball(value: Fraction) -> arb:
    return arb(fmpq(value.numerator, value.denominator))


def _dyadic(value: arb) -> Fraction:
    """A rational with ``WITNESS_BITS`` bits after the point near a number of size at most one."""
    scaled = (value * arb(2) ** WITNESS_BITS).floor().mid()
    return Fraction(int(scaled.unique_fmpz() or 0), 1 << WITNESS_BITS)


def _floats(matrix: arb_mat) -> np.ndarray:
    return np.array([[float(entry.mid()) for entry in row] for row in matrix.tolist()])
