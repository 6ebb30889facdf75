"""Section 2 of docs/certificate-direct.md: ``|(C e^(At) J)_ij| ≤ Σ_a c_ija e^(−μ_a t)`` for all ``t ≥ 0``.

In the witness's coordinates ``A`` is a block-diagonal ``Λ`` up to ``ε``; the exponentials and damped rotations of
``Λ`` are bounded on cells ``[t, t + 2d]`` by lines through the middle, and after the cells by their norms.
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

COARSEST, FINEST = 16, 512  # the start of a cell over its width
FIRST = 64  # the first cell is 1/64 of the shortest time constant
LAST = 32  # the cells end after 32 of the longest; no mode makes them short after 32 of its own
MAX_CELLS = 8_192
CHUNK = 256
END_BITS = 64
TANGENT = ball(Fraction(1, 2))  # the largest μ d for which the line below e^(−μ s) is the tangent at the middle


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
        turns = ((interval(-mode.real).lo, interval(mode.turn).magnitude.hi) for mode in self.modes)
        self.turning = [(decay, turn) for decay, turn in turns if turn > 4 * decay]
        gap = self.slowest - self.epsilon - self.rates[0]
        require(
            bool(gap > 0),
            f"{name}: kernels: μ_1 < σ − ε",
            rate=witness.rates[0],
            decay=shown(self.slowest),
            epsilon=shown(self.epsilon),
        )
        self.pairs = [(i, j) for i in range(len(self.C)) for j in range(len(self.J))]
        self.c = [[ball(entry) for entry in witness.kernels[i][j]] for i, j in self.pairs]
        self.rest = [_norm(self.C[i]) * _norm(self.J[j]) * self.epsilon / gap for i, j in self.pairs]
        sizes_C, sizes_J = ([[mode.norm(row) for mode in self.modes] for row in rows] for rows in (self.C, self.J))
        self.products = [[a * b for a, b in zip(sizes_C[i], sizes_J[j], strict=True)] for i, j in self.pairs]

    def check(self) -> None:
        cells = list(self.cells())
        spend(len(cells) * (len(self.C[0]) + len(self.rates)) * (3 * len(self.pairs) + 400))
        values = [self.weights(i, j) for i, j in self.pairs]
        for row in range(0, len(self.pairs), CHUNK):
            part = slice(row, row + CHUNK)
            weights = zip(self.c[part], self.products[part], self.rest[part], strict=True)
            margin = arb_mat(
                [
                    [*map(_positive, c), *map(_negative, c), *[-entry for entry in sizes], -rest]
                    for c, sizes, rest in weights
                ]
            )
            for start in range(0, len(cells), CHUNK):
                self.check_cells(row, cells[start : start + CHUNK], arb_mat(values[part]), margin)
        self.check_tail(cells[-1][1])

    def cells(self) -> Iterator[tuple[Fraction, Fraction]]:
        """``[0, τ]``, then ``[t, t + width(t)]``, up to the first end beyond ``32/σ``; ends are short numbers."""
        fastest = max(interval(mode.square.sqrt()).hi for mode in self.modes)
        last = Fraction(LAST) / interval(self.slowest).lo
        start, end = Fraction(0), _short(1 / (FIRST * fastest))
        for _ in range(MAX_CELLS):
            yield start, end
            if end >= last:
                return
            start, end = end, _short(end + self.width(end))
        raise Undecided("the modes are too far apart")

    def width(self, t: Fraction) -> Fraction:
        """``t/16``; less while there are modes that turn often, by which it is ``(1 + σ_a t)/(4 ω_a)``."""
        turning = [max(t / FINEST, (1 + decay * t) / (4 * turn)) for decay, turn in self.turning if decay * t < LAST]
        return min([t / COARSEST, *turning])

    def weights(self, i: int, j: int) -> list[arb]:
        """The coefficients of the modes' functions in ``k``."""
        result = []
        for mode in self.modes:
            c, b = self.C[i][mode.at : mode.at + mode.size], self.J[j][mode.at : mode.at + mode.size]
            result.append(sum((x * y for x, y in zip(c, b, strict=True)), arb(0)))
            if mode.size == 2:
                result.append(c[0] * b[1] - c[1] * b[0])
        return result

    def check_cells(self, row: int, cells: list[tuple[Fraction, Fraction]], values: arb_mat, margin: arb_mat) -> None:
        """``|k(m) ± d k'(m)| ≤ Σ_a (c_a⁺ L_a − c_a⁻ U_a) − ½d² Σ_a |C'_a||J'_a||λ_a|² e^(−σ_a t) − η e^(−μ_1 t)`` at
        both ends of each cell, ``L_a`` and ``U_a`` lines below and above ``e^(−μ_a s)`` on it."""
        lines, rooms = [], []
        for start, end in cells:
            m, d, times = ball((start + end) / 2), ball((end - start) / 2), map(ball, (start, (start + end) / 2, end))
            at_start, at_middle, at_end = ([(-rate * time).exp() for rate in self.rates] for time in times)
            functions = [pair for mode in self.modes for pair in _functions(mode, m)]
            bends = [d**2 / 2 * mode.square * (mode.real * ball(start)).exp() for mode in self.modes]
            for step, above in ((-d, at_start), (d, at_end)):
                lines.append([value + step * slope for value, slope in functions])
                below = [
                    middle * (1 - rate * step) if rate * d <= TANGENT else last
                    for rate, middle, last in zip(self.rates, at_middle, at_end, strict=True)
                ]
                rooms.append([*below, *above, *bends, at_start[0]])
        k, room = (left * arb_mat(right).transpose() for left, right in ((values, lines), (margin, rooms)))
        for pair in range(k.nrows()):
            for at in range(len(lines)):
                if not abs(k[pair, at]) <= room[pair, at]:
                    self.reject(row + pair, cells[at // 2], abs(k[pair, at]), room[pair, at])

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
        require(
            False,
            f"{self.name}: kernels: |(C e^(At) J)_ij| ≤ Σ_a c_ija e^(−μ_a t)",
            i=i + 1,
            j=j + 1,
            from_t=_short(cell[0]),
            to_t="∞" if cell[1] is None else _short(cell[1]),
            left=shown(left),
            right=shown(right),
        )


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


def _functions(mode: Mode, t: arb) -> list[tuple[arb, arb]]:
    """``e^(Re λ t)``, or that times ``cos`` and ``sin`` of ``Im λ t``, with their derivatives."""
    size = (mode.real * t).exp()
    if mode.size == 1:
        return [(size, mode.real * size)]
    even, odd = size * (mode.turn * t).cos(), size * (mode.turn * t).sin()
    return [(even, mode.real * even - mode.turn * odd), (odd, mode.real * odd + mode.turn * even)]


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
