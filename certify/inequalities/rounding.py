"""Short rationals near the floats of a solver; they stay estimates until they are checked."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction

from certify.inequalities.matrices import FloatMatrix, Matrix

PRECISIONS = (10, 14, 20, 28, 38, 50)


def round_symmetric(values: FloatMatrix, bits: int) -> Matrix:
    """The symmetric part on the grid ``2^-bits`` times the largest entry's power of two; exactly symmetric.

    Raises ``ValueError`` for entries that are not finite.
    """
    import numpy as np

    if not np.all(np.isfinite(values)):
        raise ValueError("only finite numbers can be rounded to rationals")
    size = float(np.max(np.abs(values), initial=0.0))
    if size == 0:
        return tuple(tuple(Fraction(0) for _ in row) for row in values)
    step = Fraction(2) ** (int(np.frexp(size)[1]) - bits)
    rounded = [[Fraction(float(entry)) for entry in row] for row in (values + values.T) / 2]
    upper = [[round(entry / step) * step for entry in row] for row in rounded]
    return tuple(tuple(upper[min(i, j)][max(i, j)] for j in range(len(upper))) for i in range(len(upper)))


def roundings(values: FloatMatrix, precisions: Sequence[int] = PRECISIONS) -> Iterator[Matrix]:
    """``round_symmetric`` with more and more bits; equal results are given once."""
    previous: Matrix | None = None
    for bits in precisions:
        candidate = round_symmetric(values, bits)
        if candidate != previous:
            yield candidate
        previous = candidate


def round_vector(values: Sequence[float], bits: int) -> tuple[Fraction, ...]:
    """The same for a list of coefficients, each relative to the largest one."""
    import numpy as np

    column = np.asarray(values, dtype=np.float64)
    return tuple(row[i] for i, row in enumerate(round_symmetric(np.diag(column), bits)))


def power_of_two(value: float) -> Fraction:
    """The power of two nearest to a positive float, in the sense of its logarithm."""
    import numpy as np

    if not value > 0 or not np.isfinite(value):
        raise ValueError(f"{value} has no power of two near it")
    return Fraction(2) ** round(float(np.log2(value)))
