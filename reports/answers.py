"""What simulation, search, region and report answer: a status with a reason, and what was found."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from certify.files import write_atomically, write_together
from reports.runs import LAST
from symbolic.answers import Answer, Rows
from symbolic.errors import InputError
from symbolic.plant import Interval, Plant

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from certify.export.package import Package
    from certify.region import CertifiedRegion
    from reports.study import Study
    from sims.closed_loop import Trajectory
    from sims.falsifier import FalsifierResult

PAGE_SUFFIX = ".html"


@dataclass(frozen=True, repr=False)
class Simulation(Answer):
    """One run in floats, which proves nothing: ``simulated``, unless it contradicts a claim (``refuted``), the checker
    rejects the certificate (``rejected``), or nothing could be run (``inconclusive``, perhaps without a trajectory).

    ``certificate`` is the checker's answer on the certificate whose gains these are, ``None`` where nothing is claimed.
    """

    status: Literal["simulated", "refuted", "rejected", "inconclusive"]
    reason: str
    trajectory: Trajectory | None = None
    certificate: Mapping[str, str] | None = None

    def said(self) -> list[str]:
        return [f"{self.status}: {self.reason}"]

    @property
    def final_error(self) -> float | None:
        """The largest ``|y_i − s*|`` over the last twentieth of the run; ``None`` for a run cut short."""
        if self.trajectory is None:
            return None
        error = self.trajectory.final_error(LAST * self.trajectory.end)
        return error if error < math.inf else None

    def plot(self, ax: Axes | None = None, signal: str = "outputs") -> Axes:
        """Draw ``outputs``, ``references``, ``inputs`` or ``tracking_error`` on the axes, which are returned.

        Raises ``InputError`` for another signal or without a trajectory.
        """
        from sims import plots

        drawings = {
            "outputs": plots.plot_outputs,
            "references": plots.plot_references,
            "inputs": plots.plot_inputs,
            "tracking_error": plots.plot_tracking_error,
        }
        if signal not in drawings:
            raise InputError(f"signal: {signal!r} is not one of {', '.join(drawings)}")
        if self.trajectory is None:
            raise InputError(f"there is nothing to draw: {self.status}: {self.reason}")
        return drawings[signal](self.trajectory, ax)


@dataclass(frozen=True, repr=False)
class Falsification(Answer):
    """A search for a trajectory that breaks the claim: ``refuted`` with a witness, ``survived``, which proves nothing,
    ``rejected`` where the checker rejects the certificate whatever survived, or ``inconclusive``."""

    status: Literal["refuted", "survived", "rejected", "inconclusive"]
    reason: str
    found: FalsifierResult | None
    certificate: Mapping[str, str]
    seed: int

    def said(self) -> list[str]:
        lines = [f"{self.status}: {self.reason}"]
        if self.status == "rejected" and self.found is not None:
            lines.append(f"searched: {self.found.reason}")
        return lines

    def rows(self) -> Rows:
        if self.found is None:
            return ()
        head = ("agent", "trajectories", "failed", "slow", "worst |y - s*|", "peak |state|")
        tried = self.found.tried
        return [
            head,
            *(
                (*map(str, (a.agent, a.trajectories, a.failed, a.slow)), f"{a.worst:.3g}", f"{a.peak:.3g}")
                for a in tried
            ),
        ]


@dataclass(frozen=True, repr=False)
class Report(Answer):
    """The report on a plant and a certificate, with the conclusion of its first page: ``pdf`` and the interactive
    ``page`` (HTML) are made when they are asked for."""

    status: Literal["certified", "refuted", "rejected", "inconclusive"]
    reason: str
    verified: bool
    study: Study

    @cached_property
    def pdf(self) -> bytes:
        from reports.document import build_report

        return build_report(self.study)

    @cached_property
    def page(self) -> bytes:
        from reports.interactive.page import build_page

        return build_page(self.study)

    def as_file(self, name: str | Path) -> bytes:
        """What belongs into a file of that name: the page for ``.html``, else the PDF."""
        return self.page if is_page(name) else self.pdf

    def said(self) -> list[str]:
        return [f"{self.status}: {self.reason}" if self.reason else self.status]

    def save(self, path: str | Path) -> None:
        """Raises ``InputError`` where the file cannot be written."""
        write_atomically(Path(path), self.as_file(path))


def is_page(name: str | Path) -> bool:
    """Whether a file of that name is the interactive page and not the PDF."""
    return Path(name).suffix.lower() == PAGE_SUFFIX


@dataclass(frozen=True, repr=False)
class Export(Answer):
    """Code of a certified controller: the contents of ``files`` by name. ``verified`` is the certificate; the periods
    are not (docs/export.md). ``rejected`` without files where the checker does not accept it."""

    status: Literal["verified", "rejected"]
    reason: str
    files: Mapping[str, bytes] = field(default_factory=dict)
    package: Package | None = None

    def said(self) -> list[str]:
        if self.package is None:
            return [self.reason]
        return [*self.package.notice, f"claim {self.package.digest}"]

    def save(self, folder: str | Path) -> None:
        """Raises ``InputError`` where the files cannot be written."""
        write_together(Path(folder), dict(self.files))


@dataclass(frozen=True, repr=False)
class Region(Answer):
    """``found`` holds the boxes with their plants and certificates where the status is ``certified``."""

    status: Literal["certified", "rejected", "inconclusive"]
    reason: str
    plant: Plant
    found: CertifiedRegion | None = None

    def said(self) -> list[str]:
        return [f"{self.status}: {self.reason}", *("  ".join(row) for row in self.rows()[1:])]

    def rows(self) -> Rows:
        """The plant's own boxes and the larger ones, agent by agent."""
        if self.found is None:
            return ()
        head = ("agent", "times", "box")
        rows = []
        for index, agent in enumerate(self.plant.agents):
            factor = Fraction(1) if self.found.uniform is None else max(self.found.uniform.factors[index])
            box = " × ".join(f"{name} [{float(s.lo):.4g}, {float(s.hi):.4g}]" for name, s in self._grown(index))
            rows.append((f"agent {agent.id}", f"{float(factor):.4g}", box))
        return [head, *rows]

    def plot(self, ax: Axes | None = None, agent: int = 1) -> Axes:
        """The first two sides of an agent's box: the plant's own (grey) in the certified one.

        Raises ``InputError`` where there is none or the agent has one plant state only.
        """
        import matplotlib.pyplot as plt
        from matplotlib.patches import Rectangle

        if self.found is None or not 1 <= agent <= len(self.plant.agents):
            raise InputError(f"there is nothing to draw for agent {agent}: {self.status}: {self.reason}")
        grown = self._grown(agent - 1)[:2]
        own = _sides(self.plant, agent - 1)[:2]
        if len(own) < 2:
            raise InputError(f"agent {agent} has one plant state only; see rows()")
        if ax is None:
            _, ax = plt.subplots(layout="constrained")
        for sides, look in ((grown, {"fill": False, "color": "#0072B2"}), (own, {"color": "0.85"})):
            (left, width), (below, height) = [(float(side.lo), float(side.hi - side.lo)) for _, side in sides]
            ax.add_patch(Rectangle((left, below), width, height, **look))
        ax.autoscale_view()
        ax.set_xlabel(own[0][0])
        ax.set_ylabel(own[1][0])
        return ax

    def _grown(self, index: int) -> list[tuple[str, Interval]]:
        uniform = None if self.found is None else self.found.uniform
        return _sides(self.plant if uniform is None else uniform.plant, index)


def _sides(plant: Plant, index: int) -> list[tuple[str, Interval]]:
    agent = plant.agents[index]
    names = [*map(str, agent.zero_states), *map(str, agent.chain)]
    return list(zip(names, (*agent.initial.z, *agent.initial.x), strict=True))
