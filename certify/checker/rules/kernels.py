"""Section 2 of docs/certificate-direct.md: ``|(C e^(At) J)_ij| ≤ Σ_a c_ija e^(−μ_a t)`` for all ``t ≥ 0``.

In the witness's coordinates ``A`` is a block-diagonal ``Λ`` up to ``ε``; the exponentials and damped rotations of
``Λ`` are bounded on cells ``[t, t + 2d]`` from value and slope at the middle, and after the cells by their norms.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

from flint import arb, arb_mat

from certify.checker import linear
from certify.checker.balls import BITS, ball, balls, exact, interval, middle, precision, shown
from certify.checker.certificate import DirectAgentWitness
from certify.checker.linear import Matrix
from certify.checker.rules.loop import Loop
from certify.checker.verdict import Undecided, require, spend

GROWTH = Fraction(33, 32)
FIRST = 64  # the first cell is 1/64 of the shortest time constant
LAST = 32  # the cells end after 32 of the longest
MAX_CELLS = 4_096
CHUNK = 256
END_BITS = 64


@dataclass(frozen=True)
class Mode:
    """A block of ``Λ``: ``real``, or ``[[real, turn], [−turn, real]]`` in the coordinates ``at, at + 1``."""

    at: int
    size: int
    real: arb
    turn: arb

    @property
    def square(self) -> arb:
        """``|λ|²``"""
        return self.real**2 + self.turn**2

    def norm(self, entries: Sequence[arb]) -> arb:
        return _norm(entries[self.at : self.at + self.size])


def prove(name: str, loop: Loop, witness: DirectAgentWitness) -> None:
    """The obligation of section 2; the sizes of the witness are already known to fit. Raises ``Rejected``."""
    with precision(BITS):
        _Kernels(name, loop, witness).check()


class _Kernels:
    def __init__(self, name: str, loop: Loop, witness: DirectAgentWitness) -> None:
        self.name, self.rates = name, [ball(rate) for rate in witness.rates]
        columns = [[*inputs, *starts] for inputs, starts in zip(loop.inputs, loop.starts, strict=True)]
        _spend_on_inverse(witness.modes, loop.A, loop.starts)
        H = exact(witness.modes)
        try:
            R = H.inv()
        except ZeroDivisionError:
            require(False, f"{name}: modes: H is nonsingular")
        A = balls(R * exact(loop.A) * H)
        self.C, self.J = balls(exact(loop.outputs) * H).tolist(), balls(R * exact(columns)).transpose().tolist()
        self.modes = _modes(A, witness.blocks)
        self.epsilon = _distance(A, self.modes)
        self.decay = [-mode.real for mode in self.modes]
        self.slowest = self.decay[0]
        for decay in self.decay:
            self.slowest = self.slowest if self.slowest <= decay else decay
        gap = self.slowest - self.epsilon - self.rates[0]
        require(bool(gap > 0), f"{name}: kernels: μ_1 < σ − ε", rate=witness.rates[0], decay=shown(self.slowest),
                epsilon=shown(self.epsilon))
        self.pairs = [(i, j) for i in range(len(self.C)) for j in range(len(self.J))]
        self.c = [[ball(entry) for entry in witness.kernels[i][j]] for i, j in self.pairs]
        self.rest = [_norm(self.C[i]) * _norm(self.J[j]) * self.epsilon / gap for i, j in self.pairs]
        sizes_C, sizes_J = ([[mode.norm(row) for mode in self.modes] for row in rows] for rows in (self.C, self.J))
        self.products = [[a * b for a, b in zip(sizes_C[i], sizes_J[j], strict=True)] for i, j in self.pairs]

    def check(self) -> None:
        cells = list(self.cells())
        spend(3 * len(self.pairs) * len(cells) * (10 + len(self.C[0]) + len(self.rates)))
        values, slopes = self.weights()
        for row in range(0, len(self.pairs), CHUNK):
            part = slice(row, row + CHUNK)
            weights = zip(self.c[part], self.products[part], self.rest[part], strict=True)
            margin = arb_mat([[*map(_positive, c), *map(_negative, c), *[-entry for entry in sizes], -rest]
                              for c, sizes, rest in weights])
            matrices = arb_mat(values[part]), arb_mat(slopes[part]), margin
            for start in range(0, len(cells), CHUNK):
                self.check_cells(row, cells[start : start + CHUNK], *matrices)
        self.check_tail(cells[-1][1])

    def cells(self) -> Iterator[tuple[Fraction, Fraction]]:
        """``[0, τ]``, then ``[t, 33/32 t]`` with ends rounded to short numbers, up to the first end beyond ``32/σ``."""
        fastest = max(interval(mode.square.sqrt()).hi for mode in self.modes)
        last = Fraction(LAST) / interval(self.slowest).lo
        start, end = Fraction(0), _short(1 / (FIRST * fastest))
        for _ in range(MAX_CELLS):
            yield start, end
            if end >= last:
                return
            start, end = end, _short(end * GROWTH)
        raise Undecided("the modes are too far apart")

    def weights(self) -> tuple[list[list[arb]], list[list[arb]]]:
        """Per pair the coefficients of ``k`` and ``k'`` in the functions of the modes."""
        values, slopes = [], []
        for i, j in self.pairs:
            value, slope = [], []
            for mode in self.modes:
                c, b = self.C[i][mode.at : mode.at + mode.size], self.J[j][mode.at : mode.at + mode.size]
                if mode.size == 1:
                    value.append(c[0] * b[0])
                    slope.append(mode.real * c[0] * b[0])
                else:
                    even, odd = c[0] * b[0] + c[1] * b[1], c[0] * b[1] - c[1] * b[0]
                    value += [even, odd]
                    slope += [mode.real * even + mode.turn * odd, mode.real * odd - mode.turn * even]
            values.append(value)
            slopes.append(slope)
        return values, slopes

    def check_cells(self, row: int, cells: list[tuple[Fraction, Fraction]], values: arb_mat, slopes: arb_mat,
                    margin: arb_mat) -> None:
        """``|k(m)| + |k'(m)| d ≤ Σ_a (c_a⁺ e^(−μ_a(t+2d)) − c_a⁻ e^(−μ_a t)) − ½d² Σ_a |C'_a||J'_a||λ_a|² e^(−σ_a t)
        − η e^(−μ_1 t)``."""
        basis, scaled, bounds = [], [], []
        for start, end in cells:
            m, d = ball((start + end) / 2), ball((end - start) / 2)
            at_middle = [entry for mode in self.modes for entry in _functions(mode, m)]
            basis.append(at_middle)
            scaled.append([d * entry for entry in at_middle])
            t, last = ball(start), ball(end)
            bend = d**2 / 2
            at_start = [(-rate * t).exp() for rate in self.rates]
            bounds.append([*((-rate * last).exp() for rate in self.rates), *at_start,
                           *(bend * mode.square * (mode.real * t).exp() for mode in self.modes), at_start[0]])
        k, dk, room = (left * arb_mat(right).transpose()
                       for left, right in ((values, basis), (slopes, scaled), (margin, bounds)))
        for pair in range(k.nrows()):
            for cell in range(len(cells)):
                if not abs(k[pair, cell]) + abs(dk[pair, cell]) <= room[pair, cell]:
                    self.reject(row + pair, cells[cell], abs(k[pair, cell]) + abs(dk[pair, cell]), room[pair, cell])

    def check_tail(self, end: Fraction) -> None:
        """``Σ_a |C'_a||J'_a| e^(−(σ_a−μ_1)T) + η ≤ c_1 − Σ_(a>1) c_a⁻ e^(−(μ_a−μ_1)T)``"""
        T = ball(end)
        factors, own = ([((self.rates[0] - decay) * T).exp() for decay in every] for every in (self.decay, self.rates))
        for pair, (c, sizes, rest) in enumerate(zip(self.c, self.products, self.rest, strict=True)):
            left = sum((size * factor for size, factor in zip(sizes, factors, strict=True)), rest)
            right = sum((_negative(entry) * factor for entry, factor in zip(c[1:], own[1:], strict=True)), c[0])
            if not left <= right:
                self.reject(pair, (end, None), left, right)

    def reject(self, pair: int, cell: tuple[Fraction, Fraction | None], left: arb, right: arb) -> None:
        i, j = self.pairs[pair]
        require(False, f"{self.name}: kernels: |(C e^(At) J)_ij| ≤ Σ_a c_ija e^(−μ_a t)", i=i + 1, j=j + 1,
                from_t=_short(cell[0]), to_t="∞" if cell[1] is None else _short(cell[1]), left=shown(left),
                right=shown(right))


def _positive(c: arb) -> arb:
    return c.max(arb(0))


def _negative(c: arb) -> arb:
    """``−c⁻``"""
    return c.min(arb(0))


def _modes(A: arb_mat, blocks: Sequence[int]) -> list[Mode]:
    """``Λ``: means of the diagonal, half differences beside it, as exact points; the blocks add up to the size."""
    modes, at = [], 0
    for size in blocks:
        if size == 1:
            modes.append(Mode(at, 1, middle(A[at, at]), arb(0)))
        else:
            real, turn = (A[at, at] + A[at + 1, at + 1]) / 2, (A[at, at + 1] - A[at + 1, at]) / 2
            modes.append(Mode(at, 2, middle(real), middle(turn)))
        at += size
    return modes


def _distance(A: arb_mat, modes: Sequence[Mode]) -> arb:
    """``ε ≥ ‖A' − Λ‖_F``."""
    rows = A.tolist()
    for mode in modes:
        for k in range(mode.at, mode.at + mode.size):
            rows[k][k] -= mode.real
        if mode.size == 2:
            rows[mode.at][mode.at + 1] -= mode.turn
            rows[mode.at + 1][mode.at] += mode.turn
    return _norm([entry for row in rows for entry in row])


def _norm(entries: Sequence[arb]) -> arb:
    """An upper bound: the square of a ball around 0 is no ball of nonnegative numbers."""
    return sum((entry.abs_upper() ** 2 for entry in entries), arb(0)).sqrt()


def _functions(mode: Mode, t: arb) -> list[arb]:
    """``e^(Re λ t)``, or that times ``cos`` and ``sin`` of ``Im λ t``."""
    size = (mode.real * t).exp()
    return [size] if mode.size == 1 else [size * (mode.turn * t).cos(), size * (mode.turn * t).sin()]


def _short(value: Fraction) -> Fraction:
    """The value to 64 bits, rounded down; positive values stay positive."""
    shift = END_BITS + value.denominator.bit_length() - value.numerator.bit_length()
    return Fraction(int(value * Fraction(2) ** shift)) / Fraction(2) ** shift


def _spend_on_inverse(*matrices: Matrix) -> None:
    """Elimination and products of integers as long as a determinant over the common denominator."""
    for A in matrices:
        bits = max(entry.numerator.bit_length() for row in A for entry in row)
        bits += linear.common_denominator(A).bit_length()
        spend(len(A) ** 3 * (1 + len(A) * bits // 64))
