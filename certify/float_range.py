"""Floats only guide the searches: where a number leaves their range a trial has failed, and no warning is printed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

BEYOND = "a number on the way is beyond the range of floats, or rounds to 0; other units may do"
_NOT_NUMBERS = ("cannot convert", "array must not contain infs or NaNs")  # how Fraction and SciPy refuse NaN


class BeyondFloatsError(OverflowError):
    """A search or a simulation met a number that floats cannot hold."""

    def __init__(self) -> None:
        super().__init__(BEYOND)


@contextmanager
def float_range() -> Iterator[None]:
    """Overflow, division by a number that was rounded to 0 and NaN inside raise ``BeyondFloatsError``."""
    import numpy as np  # lazily: the command line knows the error before it loads anything heavy

    try:
        with np.errstate(all="ignore"):
            yield
    except (OverflowError, ZeroDivisionError, FloatingPointError, np.linalg.LinAlgError) as fault:
        raise BeyondFloatsError from fault
    except ValueError as fault:
        if not str(fault).startswith(_NOT_NUMBERS):
            raise
        raise BeyondFloatsError from fault
