"""Several piecewise-polynomial signals, read by many trajectories at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sims.signals import Array, PiecewisePolynomial

Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class SignalPool:
    """Members laid end to end: member ``m`` owns the pieces ``first[m] … first[m + 1] − 1``. A piece begins at
    ``starts`` and has ``coefficients`` of shape ``(degree + 1, signals)`` in the time since then. ``ends`` in seconds,
    per member.
    """

    starts: Array
    coefficients: Array
    first: Indices
    ends: Array


def pool(members: Sequence[PiecewisePolynomial], rows: Sequence[int]) -> SignalPool:
    """The signals ``rows`` of all members."""
    pieces = [len(member.coefficients) for member in members]
    coefficients = np.concatenate([member.coefficients[:, :, list(rows)] for member in members])
    return SignalPool(
        starts=np.concatenate([member.breaks[:-1] for member in members]),
        coefficients=np.ascontiguousarray(coefficients),
        first=np.concatenate([[0], np.cumsum(pieces)]).astype(np.intp),
        ends=np.array([member.end for member in members]),
    )


class PoolReader:
    """The pool at one time per trajectory: each keeps the coefficients of the piece it is in."""

    def __init__(self, signals: SignalPool, member: Indices) -> None:
        self.pool, self.member = signals, member
        self.piece = signals.first[member]
        self.start: Array = signals.starts[self.piece]
        self.stop: Array = self._stop(self.piece, member)
        self.local: Array = np.ascontiguousarray(np.moveaxis(signals.coefficients[self.piece], 0, -1))

    def advance(self, times: Array) -> None:
        """Move every trajectory to the piece that holds its time, which is not before the last one."""
        ahead = np.flatnonzero(times >= self.stop)
        if not ahead.size:
            return
        piece = self._later(ahead, times[ahead])
        self.piece[ahead] = piece
        self.start[ahead] = self.pool.starts[piece]
        self.stop[ahead] = self._stop(piece, self.member[ahead])
        self.local[:, :, ahead] = np.moveaxis(self.pool.coefficients[piece], 0, -1)

    def values(self, times: Array) -> Array:
        """Signals at times that are not before those of :meth:`advance`, shape ``(signals, batch)``."""
        value = _horner(self.local, times - self.start)
        beyond = np.flatnonzero(times >= self.stop)
        if beyond.size:
            piece = self._later(beyond, times[beyond])
            far = np.moveaxis(self.pool.coefficients[piece], 0, -1)
            value[:, beyond] = _horner(far, times[beyond] - self.pool.starts[piece])
        return value

    def rates(self, times: Array) -> Array:
        """Time derivatives within the present pieces, shape ``(signals, batch)``."""
        degrees = np.arange(1, len(self.local), dtype=float)
        return _horner(self.local[1:] * degrees[:, None, None], times - self.start)

    def keep(self, mask: Mask) -> None:
        """Forget the other trajectories."""
        self.member, self.piece = self.member[mask], self.piece[mask]
        self.start, self.stop = self.start[mask], self.stop[mask]
        self.local = np.ascontiguousarray(self.local[:, :, mask])

    def _stop(self, piece: Indices, member: Indices) -> Array:
        last = self.pool.first[member + 1] - 1
        return np.where(piece < last, self.pool.starts[np.minimum(piece + 1, last)], np.inf)

    def _later(self, chosen: Indices, times: Array) -> Indices:
        piece, member = self.piece[chosen], self.member[chosen]
        while True:
            ahead = times >= self._stop(piece, member)
            if not ahead.any():
                return piece
            piece = piece + ahead


def _horner(coefficients: Array, s: Array) -> Array:
    value = coefficients[-1] * s
    for row in coefficients[-2:0:-1]:
        value += row
        value *= s
    value += coefficients[0]
    return value
