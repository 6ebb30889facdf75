"""What a plant file asks of coordinator, gains, requirements and implementation as values."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

from symbolic.interval import Interval


@dataclass(frozen=True)
class CoordinatorChoice:
    """What the user fixed in ``[coordinator]``; ``None`` is left to the tool.

    ``alpha1``, ``alpha2``, ``gradient_gain`` (``κ``) and ``mixing_gain`` (``β``) are positive; ``mixing_time``
    (``t_mix``, seconds) and ``softening`` (``ν``, per second) are not negative; ``period`` is the time between two
    messages (seconds), only with ``[implementation]``. ``1, 1, 0, 0`` after the alphas is the paper's coordinator.
    """

    alpha1: Fraction | None = None
    alpha2: Fraction | None = None
    gradient_gain: Fraction | None = None
    mixing_gain: Fraction | None = None
    mixing_time: Fraction | None = None
    softening: Fraction | None = None
    period: Fraction | None = None


NOTHING_FIXED = CoordinatorChoice()


@dataclass(frozen=True)
class RequestedGains:
    """What the user fixed in ``[gains]`` for one agent; ``None`` is left to the search."""

    g: Fraction | None = None
    K: Fraction | None = None
    delta: Fraction | None = None
    h: Fraction | None = None


@dataclass(frozen=True)
class Settling:
    """``|y − s*| ≤ band`` for all ``t ≥ time``; ``time ≥ 0`` in seconds, ``band > 0`` in the output's unit."""

    time: Fraction
    band: Fraction


@dataclass(frozen=True)
class Requirements:
    """What ``[requirements]`` asks of one agent; ``None`` where nothing is asked.

    ``input``: ``|u(t)| ≤ input`` for all ``t ≥ 0``; ``bandwidth``: the fastest observer pole in rad/s;
    ``region = "largest"``: of the gains that meet the rest, those whose certified initial box is largest.
    """

    settling: Settling | None = None
    input: Fraction | None = None
    bandwidth: Fraction | None = None
    region: Literal["largest"] | None = None


@dataclass(frozen=True)
class Implementation:
    """How the controller of one agent is run (``[implementation]``); ``None`` where the file is silent.

    ``period`` and ``delay`` (from sample to output) in seconds, ``noise ≥ |measured − true|`` in the output's unit,
    ``input_resolution`` in the input's.
    """

    period: Fraction
    delay: Interval | None = None
    noise: Fraction | None = None
    input_resolution: Fraction | None = None
    arithmetic: Literal["double", "single"] | None = None
