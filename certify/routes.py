"""The routes to a certificate, as values: what the pipeline, the command line and the report know of a route.

To add one: its search in a folder of its own and a record here; its theorem's rule in ``certify/checker/theorems.py``;
what the report says of it in ``reports/templates/routes.typ``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from certify.coordinator.resolution import COARSE, FINE, Resolution

if TYPE_CHECKING:
    from certify.certificate import Json
    from certify.preparation import Prepared
    from certify.results import AgentResult
    from symbolic.controller import AgentController

    Outcome = tuple[AgentResult, AgentController | None, Json | None]
    Report = Callable[[str], None]

__all__ = ["DEFAULT", "ROUTES", "Route", "route_of_theorem"]


@dataclass(frozen=True)
class Route:
    """One way from a prepared network to a certificate.

    ``theorem`` is what its certificates name and a rule of the checker decides. ``resolution`` is that of the
    coordinator's grid. Assumptions in ``proved_on_the_way`` may be unknown when the search starts, since the route
    proves what they are for. ``search`` takes the network, the index of an agent and a listener for progress, and
    returns the result, controller and witness of that agent (the latter two ``None`` when nothing passed). Where it is
    ``long`` the agents are searched in processes of their own. ``proves`` are the tables of a plant file that it can
    prove beside the plant itself.
    """

    name: str
    theorem: str
    resolution: Resolution
    proved_on_the_way: frozenset[str]
    search: Callable[[Prepared, int, Report], Outcome]
    long: bool
    proves: frozenset[str] = frozenset()


def _direct(prepared: Prepared, index: int, report: Report) -> Outcome:
    from certify.tube.route import tube_agent  # lazily: the command line names routes without loading solvers
    from certify.units.reduction import search_in_natural_units

    agent = prepared.derivation.agents[index].id

    def search(network: Prepared, index: int) -> Outcome:
        return tube_agent(network, index, lambda message: report(f"agent {agent}: {message}"))

    outcome = search_in_natural_units(prepared, index, search)
    report(f"agent {agent}: {outcome[0].status}")
    return outcome


def _recipe(prepared: Prepared, index: int, report: Report) -> Outcome:
    from certify.recipe.route import recipe_agent  # lazily, as above

    report(f"agent {prepared.derivation.agents[index].id}: levels and thresholds")
    return recipe_agent(prepared, index)


DIRECT = Route(
    "direct",
    "direct/3",
    FINE,
    frozenset({"A6"}),  # the tube is A6⁺ (iii)
    _direct,
    long=True,
    proves=frozenset({"requirements"}),
)
RECIPE = Route("recipe", "recipe/2", COARSE, frozenset(), _recipe, long=False)
ROUTES = {route.name: route for route in (DIRECT, RECIPE)}
DEFAULT = DIRECT.name


def route_of_theorem(theorem: object) -> Route | None:
    """The route whose certificates name this theorem."""
    return next((route for route in ROUTES.values() if route.theorem == theorem), None)
